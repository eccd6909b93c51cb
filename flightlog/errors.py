"""Errors that are the user's to mend: one clear line, never a traceback."""


class UserError(Exception):
    """Unusable input: names the file, the key or row, what was found and what would be right. Exit code 2."""
