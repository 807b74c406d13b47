"""Experiments to come: the next one, and what every effect would show in the usual ones."""
