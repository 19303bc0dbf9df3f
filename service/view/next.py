"""What a person is told first: the state in words, and one sentence for what happens next, with the area's names."""

from __future__ import annotations

from collections.abc import Sequence, Set

from typing_extensions import TypedDict  # what pydantic can read on Python 3.11

from service.chances import share
from service.mission.states import FLYING, State
from service.reasons import Option

STATE_WORDS = {
    State.WAITING: "Waiting for the aircraft",
    State.READY: "Ready to take off",
    State.TAKEOFF: "Taking off",
    State.SEARCHING: "Searching",
    State.CONFIRMING: "Looking again",
    State.FOUND: "Found",
    State.HOLDING: "Holding still",
    State.YIELDED: "The pilot flies",
    State.RETURNING: "Flying home",
    State.GROUNDED: "Landed, search not finished",
    State.DONE: "Finished",
    State.ABORTED: "Stopped",
}
"""A state, for people."""

_NEXT = {
    State.WAITING: "Next: the aircraft gets its position and is ready",
    State.READY: "Next: take-off, then the search begins",
    State.TAKEOFF: "Next: at its height the search begins",
    State.FOUND: "Next: it stays above the place until you confirm, reject or finish",
    State.HOLDING: "Next: nothing until you say Resume or Return",
    State.YIELDED: "Next: nothing until the pilot hands over and you say Resume",
    State.RETURNING: "Next: it lands at the launch point",
    State.GROUNDED: "Next: a fresh battery, then Launch",
    State.DONE: "The search is over",
    State.ABORTED: "The search is over",
}

_PASSES = {
    "air": "the autopilot says that it is in the air",
    "apart": "the aircraft are apart",
    "detector": "the detector reports",
    "ground": "it is clear of the ground",
    "journal": "the journal is written",
    "link": "the autopilot is heard",
    "position": "the position is good",
}
"""What a hold waits for that ends by itself; others only a person ends."""


class NextState(TypedDict):
    """What happens next: one sentence, and where it goes, if it goes anywhere: the place's name, the metres to it when
    it was decided, and the probability that the target is there now."""

    words: str
    name: str | None
    distance_m: float | None
    probability: float | None


class ChoiceState(TypedDict):
    """A place that was weighed, in a team's words."""

    name: str
    distance_m: float | None
    probability: float | None
    chosen: bool


def next_state(
    state: State,
    options: Sequence[Option],
    names: Sequence[str],
    regions: Sequence[float],
    again: str = "",
    *,
    causes: Set[str] = frozenset(),
    down: bool = False,
) -> NextState:
    """What happens next.

    Args:
        state: of the search.
        options: what the last decision weighed.
        names: what people call the regions of interest, region 1 first.
        regions: the probability of each now.
        again: the place that gets another look while it is confirming, in words.
        causes: what it holds still for (`Standing.causes`).
        down: it stands on the ground with its motors off.
    """
    if state not in FLYING:
        return {"words": _still(state, causes, down), "name": None, "distance_m": None, "probability": None}
    chosen = next((each for each in choices(options, names, regions) if each["chosen"]), None)
    if chosen is None:
        words = "Next: the ground ahead"
        return {"words": words, "name": None, "distance_m": None, "probability": None}
    words = f"Next: {described(chosen)}"
    if state == State.CONFIRMING:
        words = f"Next: another look at {again or described(chosen)}"
    return {"words": words, **{key: chosen[key] for key in ("name", "distance_m", "probability")}}  # type: ignore[typeddict-item]


def _still(state: State, causes: Set[str], down: bool) -> str:
    """What happens next while nothing is searched."""
    if down and state in (State.HOLDING, State.YIELDED):
        return "Next: nothing until you say Launch"
    if state == State.HOLDING and causes and causes <= _PASSES.keys():
        return (
            f"Next: it goes on by itself when {' and '.join(_PASSES[each] for each in sorted(causes))} again"
        )
    return _NEXT[state]


def choices(options: Sequence[Option], names: Sequence[str], regions: Sequence[float]) -> list[ChoiceState]:
    """What the last decision weighed, as places: the chosen one first, then the likeliest; each place once."""
    told: dict[str, ChoiceState] = {}
    for option in options:
        known = option.region is not None and 0 < option.region <= min(len(names), len(regions))
        number = (option.region or 0) - 1
        name = names[number] if known else "open ground"
        if name not in told or option.chosen:
            told[name] = {
                "name": name,
                "distance_m": option.distance_m,
                "probability": regions[number] if known else option.mass,
                "chosen": option.chosen,
            }
    return sorted(told.values(), key=lambda each: (not each["chosen"], -(each["probability"] or 0.0)))


def described(place: ChoiceState) -> str:
    """A place in words: 'burn, 400 m, 20 %'."""
    away, part = place["distance_m"], place["probability"]
    said = [place["name"]]
    if away is not None:
        said.append(f"{round(away, -1):.0f} m" if away >= 10.0 else "here")
    if part is not None:
        said.append(share(part))
    return ", ".join(said)
