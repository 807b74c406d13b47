"""Options: sets of effects, fitted and validated, and when one is accepted."""
