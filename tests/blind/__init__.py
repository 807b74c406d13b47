"""Blind trials: a bench that knows nothing of the package writes recordings, and the command's verdict is scored."""
