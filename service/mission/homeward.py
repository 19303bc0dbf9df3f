"""The way home: ours around what must not be flown over, and over ground that the autopilot's own would meet; then the
autopilot's own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.mission.aside import Aside
from service.mission.effects import Land, Note, Rest, ReturnToLaunch, SendWaypoint
from service.mission.limits import Objection
from service.mission.news import Done, Failed, MapChanged, News
from service.mission.phase import Phase, Turn, Way, Wish, touchdown, warn
from service.mission.situation import on_ground
from service.mission.standing import Look

HOME_AGAIN_S = 5.0  # after which a return to launch that is not flown is ordered again
SHORT_S = 3.0  # for so long the battery has to say that it does not last: a single word may be wrong
REROUTE_S = 20.0  # for so long a way home that was planned anew has to be one that may be flown
KEPT_S = 10.0  # for so long our waypoints home may be refused
LANDS_AFTER = 3  # refusals of the return: then it lands where it is


class ByItself:
    """The autopilot's own return, or its landing: ordered until it is flown, in whatever mode the aircraft waits."""

    def __init__(self) -> None:
        self._ordered = -math.inf
        self._flies = self._lands = False
        self._refused = 0

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """It is flown, or it was in vain: where the autopilot does not know the way home, or will not fly it, it
        lands. One that says nothing may only not have heard of it: a landing would be on whatever lies below."""
        if not isinstance(news, (Done, Failed)) or not isinstance(news.action, (ReturnToLaunch, Land)):
            return
        t, lands = look.seen.telemetry, self._lands
        self._flies = isinstance(news, Done)
        if isinstance(news, Failed):
            self._ordered = look.now
            if news.answered:
                self._refused += look.heard() and t.in_control
                self._lands = bool(look.helm.doubts(t, look.now)) or self._refused >= LANDS_AFTER
            if self._lands and not lands:
                yield from warn(f"it lands where it is: {news.reason}", look)

    def land(self) -> None:
        """Not home any longer, but down."""
        self._ordered, self._lands, self._flies = -math.inf, True, False

    def tick(self, look: Look) -> Iterator[Wish]:
        """Order it, and again when it is not flown."""
        waits = look.seen.telemetry.guided or not self._flies
        if not look.busy and waits and look.now - self._ordered > HOME_AGAIN_S:
            self._ordered, self._flies = look.now, False
            yield Land() if self._lands else ReturnToLaunch()


class Homeward(Phase):
    """RETURNING."""

    def __init__(self) -> None:
        self._way: Way | None = None
        self._begun = self._resting = self._made_room = self._down = False
        self._kept_since = self._waits_since = math.inf  # no waypoint was sent since: at all; for the others
        self._rerouted_at = -math.inf
        self._short_since = math.inf  # the battery does not last for the way home
        self._turn = Turn()
        self._aside = Aside()
        self._by_itself = ByItself()

    def lost(self, look: Look) -> None:
        """The last point may not have arrived."""
        if self._way is not None:
            self._way.lost(look)

    def refused(self, objection: Objection, look: Look) -> None:
        """A point is tried again; for how long depends on what speaks against it. The ground is the core's to judge."""
        if objection.cause == "apart":
            self._waits_since = min(self._waits_since, look.now)
        elif objection.cause != "ground":
            self._kept_since = min(self._kept_since, look.now)
        self.lost(look)

    def elsewhere(self, look: Look) -> bool:
        """It may have left its way, to make room or in a wind: another one is planned from where it is now, but not
        again and again."""
        if self._resting or self._way is None or look.now - self._rerouted_at < REROUTE_S:
            return False
        self._rerouted_at, self._begun, self._way = look.now, False, None
        return True

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """A point is on its way, the ground has changed, or what became of the autopilot's own return."""
        if isinstance(news, Done) and isinstance(news.action, SendWaypoint):
            self._kept_since = self._waits_since = math.inf
        if isinstance(news, MapChanged) and not self._resting:
            self._begun, self._way = False, None  # another way may be free
        yield from self._by_itself.on(news, look)

    def tick(self, look: Look) -> Iterator[Wish]:
        """Fly around, then let the autopilot land; with other aircraft in the air all the way is flown by us, in our
        own layer, and only the landing leaves it."""
        if not self._begun:
            self._begin(look)
        if why := self._falls_short(look):
            self._way, self._resting, self._down = None, True, True
            self._by_itself.land()
            yield Rest()
            yield from warn(f"{why}: it lands where it is", look)
        if not self._resting and (why := self._in_vain(look)):
            self._way, self._resting = None, True
            yield Rest()
            yield from warn(f"{why}: the autopilot flies home by itself", look)
        if self._way is not None and not self._resting:  # who lands already makes room by being down
            yield from self._fly(self._way, look)
            if self._way is None or not self._way.flown:  # a point that may not be flown to leads elsewhere
                return
        t = look.seen.telemetry
        if not self._resting and t.guided and t.armed and not look.standing.direct:
            why = look.helm.traffic.landing(t, look.seen.others, look.now)
            yield from self._turn.wait(why, "to land", look)
            self._waits_since = min(self._waits_since, look.now) if why else math.inf
            if why:
                return
        if not self._resting:  # the autopilot steers from here: it need not come nearer to a waypoint of ours
            self._resting = True
            yield Rest()
        if not t.armed:
            yield touchdown(look, "on the ground, disarmed")
        else:
            yield from self._by_itself.tick(look)

    def _begin(self, look: Look) -> None:
        t = look.seen.telemetry
        self._begun = True
        stands = bool(look.seen.others) and on_ground(t)  # it has waited to take off, and need not any more
        if t.guided and not look.standing.direct and not stands:
            points = look.chart.route((t.lat, t.lon), look.chart.home(t))
            if not look.seen.others and look.helm.returns_clear([(t.lat, t.lon), *points][-2], t):
                points = points[:-1]  # from there the autopilot flies
            self._way = Way(points, climb=bool(points))

    def _fly(self, way: Way, look: Look) -> Iterator[Wish]:
        """The next point, or out of another's way first."""
        if (place := self._aside.place(look)) is not None:
            yield Note(f"makes room for the others at {look.chart.written(place)}")
            home = look.chart.home(look.seen.telemetry)
            self._way = way = Way([place, *look.chart.route(place, home)], climb=False)
            self._made_room = True
        yield from way.tick(look)

    def _falls_short(self, look: Look) -> str:
        """Why it has to come down before it falls, or nothing."""
        t = look.seen.telemetry
        if self._down or on_ground(t) or not (t.armed and t.in_control and look.heard()):
            return ""
        why = look.energy.falls_short(t.alt_home_m, look.settings.flight)
        self._short_since = min(self._short_since, look.now) if why else math.inf
        return why if look.now - self._short_since >= SHORT_S else ""

    def _in_vain(self, look: Look) -> str:
        """Why our own way home is not flown on, or nothing: it cannot be, or waiting for the others takes too long."""
        flight, waited_s = look.settings.flight, look.now - self._waits_since
        if look.now - self._kept_since > KEPT_S:
            return f"no waypoint on the way home was sent for {KEPT_S:.0f} s"
        if waited_s > flight.max_hold_s:
            return f"it has waited for the others for {waited_s:.0f} s"
        waits = self._made_room or math.isfinite(self._waits_since)
        return look.energy.spent(flight) if waits else ""
