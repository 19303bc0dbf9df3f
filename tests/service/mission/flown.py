"""A mission's core over the soak's field, spoken to in its own words: news and situations in, effects out."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from roisearch import Decision
from roisearch.decision import Effort
from service.area import Grid, build_grid, parse_area
from service.config import Settings
from service.evidence.found import Found
from service.mavlink.events import Home, ModeChanged
from service.mavlink.modes import ModeKind
from service.mavlink.telemetry import Telemetry
from service.mission.core import MissionCore
from service.mission.effects import Action, Arm, Effect, EnterGuided, TakeOff, WriteRow
from service.mission.flight import Flight
from service.mission.limits import PositionTrust
from service.mission.news import Done, Failed, News, Order, Thought
from service.mission.phase import Happen
from service.mission.situation import Situation
from service.mission.standing import Standing, Terms
from service.mission.states import Event, State
from service.reasons import Reason
from service.rows import KnownRow
from sim.soak import ground

CELL_M = 20.0
START = 1000.0
GRID = build_grid(parse_area(json.dumps(ground.area()).encode(), source="field"), CELL_M)


def place(east: float, north: float) -> tuple[float, float]:
    """A place so many metres from the field's south-west corner, in degrees."""
    ring: Any = ground.ring([(east, north)])  # the soak's own way from metres to degrees
    return float(ring[0][1]), float(ring[0][0])


HERE = place(200.0, 50.0)
FOUND = Found(*HERE, probability=0.9995, sigma_m=5.0, ellipse={})
ON_GROUND = {"landed_state": "on_ground", "armed": False, "alt_home_m": 0.0, "alt_amsl_m": 400.0}
LEFT_US = {"in_control": False, "guided": False, "mode": "LOITER"}


def telemetry(**changes: Any) -> Telemetry:
    """An aircraft in the south-east of the field, hovering, in the guided mode, ours; all is well."""
    usual = Telemetry(
        heartbeat_time=START,
        position_time=START,
        autopilot="ardupilot",
        mode="GUIDED",
        guided=True,
        armed=True,
        in_control=True,
        landed_state="in_air",
        lat=HERE[0],
        lon=HERE[1],
        alt_home_m=15.0,
        alt_amsl_m=415.0,
        heading_deg=0.0,
        home=Home(*ground.launch(), 400.0),
        fix=3,
        satellites=12,
        battery_percent=90.0,
        told={"EKF_STATUS_REPORT": START},
    )
    return replace(usual, **changes)


class Talk:
    """A conversation with a core. Time goes on with every tick, and heartbeat, position and reports with it, unless
    `silent` names them."""

    def __init__(
        self,
        settings: Mapping[str, Any] | None = None,
        *,
        may_take_off: bool = False,
        standing: Standing | None = None,
        flight: Flight | None = None,
        grid: Grid = GRID,
        **changes: Any,
    ) -> None:
        base: dict[str, dict[str, Any]] = {"flight": {"altitude_m": 15.0}, "sensor": {"cell_m": CELL_M}}
        base["run"] = {
            "next_sortie_within_s": 0.0
        }  # a run ends at its first landing, unless a test says otherwise
        for section, values in (settings or {}).items():
            base.setdefault(section, {}).update(values)
        self.settings = Settings.model_validate(base)
        terms = Terms(may_take_off=may_take_off)
        self.core = MissionCore(self.settings, grid, terms, standing=standing, flight=flight)
        self.now = START
        self.seen = Situation(telemetry(**changes), reported_at=START)
        self.silent: set[str] = set()
        self.wanted: list[Effect] = []
        """All that was wanted so far."""

    @property
    def state(self) -> State:
        """The state now."""
        return self.core.state

    @property
    def rows(self) -> list[KnownRow]:
        """The rows so far."""
        return [effect.row for effect in self.wanted if isinstance(effect, WriteRow)]

    def shows(self, **changes: Any) -> None:
        """The telemetry changes."""
        self.seen = replace(self.seen, telemetry=replace(self.seen.telemetry, **changes))

    def sees(self, **changes: Any) -> None:
        """The situation changes otherwise."""
        self.seen = replace(self.seen, **changes)

    def on(self, news: News) -> list[Effect]:
        """Tell the core; what it wants."""
        effects = self.core.on(news, self.seen, self.now)
        self.wanted += effects
        return effects

    def flew(self, there: tuple[float, float] | None = None) -> None:
        """The aircraft has flown to where it is shown now (or to `there`), and has not jumped."""
        if there is not None:
            self.shows(lat=there[0], lon=there[1])
        self.core.helm.trust = PositionTrust(self.settings.flight, self.core.terms.position_fresh_s)

    def tick(self, seconds: float = 0.1) -> list[Effect]:
        """Let time pass in one step; what the core wants then."""
        self.now += seconds
        if "heartbeat" not in self.silent:
            self.shows(heartbeat_time=self.now)
        if "position" not in self.silent:
            self.shows(position_time=self.now)
        if "detector" not in self.silent:
            self.sees(reported_at=self.now)
        effects = self.core.tick(self.seen, self.now)
        self.wanted += effects
        return effects

    def pass_by(self, seconds: float) -> list[Effect]:
        """Let time pass in steps of half a second."""
        return [effect for _ in range(int(seconds * 2)) for effect in self.tick(0.5)]

    def doing(self) -> Action:
        """The action under way."""
        assert self.core.doing is not None, self.state
        return self.core.doing

    def done(self) -> list[Effect]:
        """The action under way is done."""
        return self.on(Done(self.doing()))

    def failed(self, reason: str, *, answered: bool = True) -> list[Effect]:
        """The action under way was in vain."""
        return self.on(Failed(self.doing(), reason, answered))

    def happens(self, event: Event) -> list[Effect]:
        """What follows when a phase wishes an event."""
        self.core._want([Happen(event, "for a test")])  # the one way in that no news leads to for every pair
        return self.on(Order("nothing"))

    def pilot(self, mode: str = "LOITER") -> list[Effect]:
        """The pilot selects a mode; the link has let go of the aircraft by then."""
        previous = self.seen.telemetry.mode
        self.shows(mode=mode, guided=False, in_control=False)
        return self.on(ModeChanged(self.now, mode, previous, ModeKind.PILOT, False, False, False))

    def decides(self, *path: tuple[int, int], worth: Iterable[tuple[int, int]] = ()) -> list[Effect]:
        """A decision arrives, with cells that are worth a look."""
        decision = Decision(path=path, action="go", value=0.0, effort=Effort(1, 0.01))
        return self.on(Thought(decision, Reason("there is something"), frozenset(worth)))


def reached(state: State, settings: Mapping[str, Any] | None = None, **terms: Any) -> Talk:
    """A conversation that has come to a state by what usually leads there."""
    if state == State.TAKEOFF:
        talk = Talk(settings, may_take_off=True, **{**ON_GROUND, **terms})
    else:
        talk = Talk(settings, **terms)
    if state == State.WAITING:
        return talk
    talk.tick()
    talk.done()
    talk.tick()
    if state == State.READY:
        return talk
    talk.tick()
    if state == State.TAKEOFF:
        talk.done()
        return talk
    talk.tick()
    talk.done()
    if state == State.CONFIRMING:
        talk.happens(Event.SUSPECT)
    elif state == State.FOUND:
        talk.happens(Event.CONFIRMED)
    elif state == State.HOLDING:
        talk.on(Order("hold"))
    elif state == State.RETURNING:
        talk.on(Order("return"))
    elif state == State.YIELDED:
        talk.pilot()
    elif state == State.ABORTED:
        talk.on(Order("abort"))
    elif state == State.GROUNDED:
        talk.on(Order("return"))
        talk.happens(Event.DOWN)
    elif state == State.DONE:
        talk.happens(Event.LANDED)
    assert talk.state == state
    return talk


def searching(settings: Mapping[str, Any] | None = None, **terms: Any) -> Talk:
    """A conversation in which the search looks for something: its speed is set, and it is where it begins."""
    talk = reached(State.SEARCHING, settings, **terms)
    talk.tick()
    talk.done()
    talk.tick()
    return talk


def takes_off(talk: Talk) -> None:
    """The guided mode, armed, and up: each is wanted once the one before is done; then the aircraft hovers."""
    for step in (EnterGuided, Arm, TakeOff):
        assert isinstance(talk.doing(), step)
        talk.done()
    talk.shows(
        landed_state="in_air", armed=True, alt_home_m=15.0, alt_amsl_m=415.0, in_control=True, guided=True
    )
