"""Errors meant for people."""


class BadInput(ValueError):
    """What a person gave cannot be used; the message is one sentence: what, where, what would be right."""
