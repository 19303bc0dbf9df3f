"""What of a flight goes to the journal, and when: its track, and each sortie once it is over."""

from __future__ import annotations

from collections.abc import Iterator

from service.mavlink.telemetry import Telemetry
from service.mission.effects import WriteRow
from service.mission.flight import Flight
from service.mission.situation import Situation
from service.mission.standing import Standing
from service.rows import FlightRow, SortieRow

BOOTED_S = 5.0  # by so much clocks may differ


class Logbook:
    """The rows of one aircraft's flights; `left` is how the run that this one goes on with was left."""

    def __init__(self, flight: Flight, left: Standing) -> None:
        self._flight, self._left = flight, left

    def track(self, now: float, *, at_once: bool) -> Iterator[WriteRow]:
        """Where it has been, when it is time to write that down."""
        yield from _written(self._flight.row(now, at_once=at_once))

    def begins(self, t: Telemetry, now: float) -> None:
        """It is in the air, or about to be."""
        self._flight.begin(now)
        self._flight.by = _who(t)

    def stands(self, seen: Situation, now: float) -> Iterator[WriteRow]:
        """It stands on the ground before a flight."""
        yield from self._left_sortie(seen)
        self._flight.stand(now)

    def goes_on(self, seen: Situation, now: float) -> Iterator[WriteRow]:
        """It is in the air when this process comes up."""
        if self._booted_since(seen.telemetry, now):
            yield from self._left_sortie(seen)
        self._flight.go_on(now)
        self._flight.by = _who(seen.telemetry)

    def lands(self, seen: Situation, now: float, why: str) -> Iterator[WriteRow]:
        """A sortie is over, and why; one that was over before is not once more."""
        if self._flight.ended:
            return
        self._flight.ended = now
        yield from _written(self._flight.sortie_row(now, seen.searched, why))

    def _left_sortie(self, seen: Situation) -> Iterator[WriteRow]:
        """What an earlier process flew is over, if it did not live to say so itself."""
        left = self._left
        why = left.why_stopped or left.why or "it landed while no service was there"
        yield from _written(self._flight.left_sortie_row(seen.searched, why))

    def _booted_since(self, t: Telemetry, now: float) -> bool:
        """Whether the aircraft has been switched on since an earlier process last told of it: it flies once more."""
        told_at = self._flight.told_at
        return t.boot_time_s is not None and bool(told_at) and now - t.boot_time_s > told_at + BOOTED_S


def _who(t: Telemetry) -> tuple[int, str] | None:
    """Which aircraft it is."""
    return (t.system_id, t.autopilot) if t.system_id else None


def _written(row: FlightRow | SortieRow | None) -> Iterator[WriteRow]:
    if row is not None:
        yield WriteRow(row)
