"""Errors that a person can act on."""


class BadInput(ValueError):
    """What the operator gave cannot be used.

    The message is one sentence: what is wrong, where (file, feature, value), and what
    would be right. The command line prints it as it is and exits with code 2.
    """
