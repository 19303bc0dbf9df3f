"""What a caller of the link has to expect; every message is one sentence for a person."""

from __future__ import annotations


class LinkError(Exception):
    """The link or the vehicle did not do what was asked."""

    answered = False
    """Whether the vehicle has heard of it, and answered."""


class NotPermitted(LinkError):
    """Nothing was sent, because it would not be safe or is not ours to do now."""


class CommandFailed(LinkError):
    """The vehicle refused, did not answer, or answered and did something else."""

    answered = True


class NotAnswered(CommandFailed):
    """The vehicle did not answer, and did not do it: whether it has heard of it, nobody knows."""

    answered = False


class NoVehicle(LinkError):
    """No vehicle that can be flown was heard on the link in time."""
