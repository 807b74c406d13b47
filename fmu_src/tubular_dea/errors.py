"""The errors that are a user's to mend: their text says what was expected, what came and what to do."""


class UserError(Exception):
    """Shown by the command line as one line, without a traceback."""
