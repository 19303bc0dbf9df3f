"""The one error that is shown to a person instead of a traceback."""

from __future__ import annotations


class BadInput(ValueError):  # noqa: N818
    """What a person gave cannot be used; the message is one sentence: what, where, what would be right."""
