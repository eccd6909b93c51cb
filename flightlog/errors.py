"""What went wrong and can be put right by the one who called."""


class UserError(Exception):
    """Unusable input. The message names the file, the key or row, what was found and what would be right.

    The command line prints it as one line and ends with exit code 2.
    """
