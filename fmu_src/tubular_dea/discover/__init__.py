"""From a residual to its cause: noise, channel, candidates, verdict."""
