"""What is new in the state of a search: a suspect, the place found, a find that was taken back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

from service.chances import sure
from service.geometry import LatLon, distance_m
from service.view.state import RunState

AnnouncementKind = Literal["suspect", "found", "withdrawn"]

SAME_M = 30.0
"""A suspect nearer than this to one that was told is that one: evidence moves it a little."""
MOST_SUSPECTS = 200
"""Told in one run; a detector that sees more than that says nothing that helps."""


@dataclass(frozen=True)
class Announcement:
    """Something to tell at once.

    Attributes:
        id: the same for the same thing whenever it is told, in this run and after a restart.
        time: seconds since the epoch by the computer's clock.
        place, written: where, in degrees and as the team writes places.
        probability: that the target is there.
        within_m: the long semi-axis of what holds it with 95 %, once it is found.
        text: a sentence for people.
    """

    id: str
    kind: AnnouncementKind
    time: float
    run: str
    area: str
    state: str
    place: LatLon
    written: str
    probability: float
    within_m: float | None
    text: str

    def body(self) -> dict[str, Any]:
        """As JSON values, for a webhook."""
        return {
            "id": self.id,
            "kind": self.kind,
            "time": iso(self.time),
            "run": self.run,
            "area": self.area,
            "state": self.state,
            "lat": self.place[0],
            "lon": self.place[1],
            "written": self.written,
            "probability": self.probability,
            "within_m": self.within_m,
            "text": self.text,
        }


def iso(time: float) -> str:
    """A time as RFC 3339 in UTC, with milliseconds."""
    return datetime.fromtimestamp(time, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


class Newsdesk:
    """Compares each state with what was told before."""

    def __init__(self, run: str) -> None:
        self._run = run
        self._suspects: list[LatLon] = []
        self._found: LatLon | None = None
        self._found_written = ""

    def news(self, state: RunState, time: float) -> list[Announcement]:
        """What has to be told now; each thing once."""
        told: list[Announcement] = []
        found = state["found"]
        if found is not None:
            place = (found["lat"], found["lon"])
            if self._found is None or distance_m(place, self._found) > SAME_M:
                within = found["ellipse"]["semi_major_m"]
                text = f"FOUND at {found['written']}, probability {sure(found['probability'])}"
                text += f", 95 % within {within:.0f} m"
                told.append(
                    self._new(
                        "found", state, time, place, found["written"], found["probability"], within, text
                    )
                )
                self._found, self._found_written = place, found["written"]
        elif self._found is not None:
            text = f"the find at {self._found_written} is taken back: the search goes on"
            told.append(
                self._new("withdrawn", state, time, self._found, self._found_written, 0.0, None, text)
            )
            self._found = None
        for each in state["suspects"]:
            place = (each["lat"], each["lon"])
            if len(self._suspects) < MOST_SUSPECTS and not _among(place, self._suspects):
                self._suspects.append(place)
                text = f"suspect at {each['written']}, probability {sure(each['probability'])}: look there"
                told.append(
                    self._new("suspect", state, time, place, each["written"], each["probability"], None, text)
                )
        return told

    def _new(self, kind: AnnouncementKind, state: RunState, *rest: Any) -> Announcement:
        time, place, written, probability, within, text = rest
        name = f"{self._run}-{kind}-{place[0]:.4f},{place[1]:.4f}"
        text = f"{state['area']}: {text}"
        return Announcement(
            name,
            kind,
            time,
            self._run,
            state["area"],
            state["state"],
            place,
            written,
            probability,
            within,
            text,
        )


def _among(place: LatLon, others: Sequence[LatLon]) -> bool:
    return any(distance_m(place, other) <= SAME_M for other in others)
