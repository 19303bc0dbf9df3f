"""Errors that a person can act on."""


class BadInput(ValueError):
    """What the operator gave cannot be used.

    The message is one sentence: what is wrong, where (file, feature, value), and what
    would be right. The command line prints it as it is and exits with code 2.
    """


def shown(value: object, most: int = 120) -> str:
    """A value as a sentence can hold it: a wrong one may be a whole file, as after an open quotation mark."""
    text = repr(value)
    return text if len(text) <= most else f"{text[: most - 1]}…"
