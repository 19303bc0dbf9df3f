"""What can be asked of an export beside its format."""

from __future__ import annotations

from dataclasses import dataclass

from service.errors import BadInput


@dataclass(frozen=True)
class Wishes:
    """What counts as a gap, and how long a mission over what is left may be.

    Attributes:
        pod_below: ground with less probability of detection than this counts as not searched well.
        poa_above: ground where the target is with less than this part of what an average cell held at the start
            is not worth the flight.
        minutes: the longest mission, take-off to landing; None: as long as `flight.max_flight_s` allows.

    Raises:
        BadInput: a value is out of range.
    """

    pod_below: float = 0.5
    poa_above: float = 0.5
    minutes: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 < self.pod_below <= 1.0:
            raise BadInput(f"--pod-below must be above 0 and at most 1, not {self.pod_below:g}")
        if not 0.0 <= self.poa_above < float("inf"):
            raise BadInput(f"--poa-above must be 0 or more, not {self.poa_above:g}")
        if self.minutes is not None and not 0.0 < self.minutes < float("inf"):
            raise BadInput(f"--minutes must be above 0, not {self.minutes:g}")
