"""What a flight has been so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from service.geometry import LatLon
from service.mavlink.telemetry import Telemetry
from service.rows import FlightRow, SortieRow

TRACK_EVERY_S = 1.0
ROW_EVERY_S = 5.0  # of the track that a killed service may lose


@dataclass
class Flight:
    """What the flights of a run have been so far; times in the service's clock, distances in metres.

    `carried_s` were flown before `began`, by earlier processes or before a landing; `earlier_s` of all seconds were
    flown before the aircraft last stood on the ground. `left_at` is when an earlier process last wrote of it; 0: none
    did. `told_s` and `told_at`: the seconds by the last row of any kind that it wrote, and when that was.
    """

    began: float = 0.0
    ended: float = 0.0
    steps: int = 0
    decisions: int = 0
    waypoints: int = 0
    track: list[tuple[float, float, float, float]] = field(default_factory=list)  # time, lat, lon, height
    hits: list[LatLon] = field(default_factory=list)
    sorties: list[SortieRow] = field(default_factory=list)
    """The flights that are over, from take-off to landing."""
    latencies_s: list[float] = field(default_factory=list)
    cell: tuple[int, int] | None = None
    """The last cell of the search that the aircraft was over."""
    flown: bool = False
    """There has been a flight, by this process or an earlier one."""
    carried_s: float = 0.0
    earlier_s: float = 0.0
    left_at: float = 0.0
    told_s: float = 0.0
    told_at: float = 0.0
    goal: LatLon | None = None
    """Where an earlier process sent it last."""
    by: tuple[int, str] | None = None
    """Who flies: the MAVLink system id and the autopilot."""
    _written: int = 0
    _written_at: float = 0.0

    def seconds(self, now: float) -> float:
        """Seconds in the air so far, in all flights of the run."""
        return self.carried_s + ((self.ended or now) - self.began if self.began else 0.0)

    def aloft_s(self, now: float) -> float:
        """Seconds in the air since the aircraft last stood on the ground."""
        return self.seconds(now) - self.earlier_s

    def begin(self, now: float) -> None:
        """The aircraft is in the air, or about to be."""
        self.flown = True
        if self.ended:
            self.carried_s, self.began, self.ended = self.seconds(now), now, 0.0
        elif not self.began:
            self.began = now

    def stand(self, now: float) -> None:
        """The aircraft stands on the ground before a flight: what was flown before is not of that."""
        self.earlier_s = self.seconds(now)

    def go_on(self, now: float) -> None:
        """The aircraft is in the air: if an earlier process left it there, it was so all the time."""
        if not self.began:
            was_aloft = self.aloft_s(now) > 0.0
            self.carried_s += max(0.0, now - self.left_at) if was_aloft else 0.0
            self.began = now

    def enter(self, cell: tuple[int, int]) -> None:
        """The aircraft is over another cell: a step, unless it is the first."""
        self.steps += self.cell is not None
        self.cell = cell

    def record(self, t: Telemetry, now: float) -> None:
        """Add the aircraft's place to the track, once a second, while it flies."""
        if t.armed and t.position_known and (not self.track or now - self.track[-1][0] >= TRACK_EVERY_S):
            self.track.append((now, t.lat, t.lon, t.alt_home_m))

    def row(self, now: float, *, at_once: bool = False) -> FlightRow | None:
        """What the journal is to keep of it, when it is time; what is kept once is not kept again."""
        if len(self.track) == self._written or not (at_once or now - self._written_at >= ROW_EVERY_S):
            return None
        points = tuple(self.track[self._written :])
        self._written, self._written_at = len(self.track), now
        return FlightRow(self.seconds(now), self.earlier_s, self.steps, points)

    def left_sortie_row(self, pos: float, why: str) -> SortieRow | None:
        """The flight of an earlier process that is over, of which it did not live to write the end; None when there is
        none. It is told as far as the rows tell it."""
        if self.began or not self.flown or self.aloft_s(self.left_at) <= 0.0:
            return None
        self.carried_s = max(self.carried_s, self.told_s)
        return self.sortie_row(max(self.left_at, self.told_at), pos, why)

    def sortie_row(self, now: float, pos: float, why: str) -> SortieRow | None:
        """The flight that is over now, and why; None when there was none. `pos` is the probability of success."""
        aloft_s = self.aloft_s(now)
        if not self.flown or aloft_s <= 0.0:
            return None
        steps = self.steps - sum(each.steps for each in self.sorties)
        sortie = SortieRow(len(self.sorties) + 1, now, aloft_s, steps, pos, why, *(self.by or (None, None)))
        self.sorties.append(sortie)
        self.stand(now)
        return sortie

    def recall_sortie(self, sortie: SortieRow) -> None:
        """Take up a flight that was over before."""
        self.sorties.append(sortie)
        self.earlier_s = self.carried_s

    def recall(self, row: FlightRow, time: float) -> None:
        """Take up what an earlier process has written."""
        self.carried_s, self.earlier_s, self.steps, self.left_at = row.seconds, row.earlier_s, row.steps, time
        self.track += row.track
        self._written = len(self.track)
