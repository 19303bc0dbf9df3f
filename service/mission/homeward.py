"""The way home: ours around what must not be flown over, and over ground that the autopilot's own would meet; then the
autopilot's own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from service.mission.aside import Aside
from service.mission.effects import Land, Note, Rest, ReturnToLaunch
from service.mission.news import Failed, MapChanged, News
from service.mission.phase import Phase, Turn, Way, Wish, touchdown
from service.mission.situation import on_ground
from service.mission.standing import Look

HOME_AGAIN_S = 5.0  # after which a return to launch that is not flown is ordered again


class Homeward(Phase):
    """RETURNING."""

    def __init__(self) -> None:
        self._way: Way | None = None
        self._ordered = -math.inf
        self._begun = self._resting = self._lands = False
        self._turn = Turn()
        self._aside = Aside()

    def lost(self, look: Look) -> None:
        """The last point may not have arrived."""
        if self._way is not None:
            self._way.lost(look)

    def on(self, news: News, look: Look) -> Iterator[Wish]:
        """A point that was not sent is tried again; where the autopilot does not know the way home, it lands."""
        if self._way is not None:
            self._way.on(news, look)
        if isinstance(news, Failed) and isinstance(news.action, ReturnToLaunch):
            self._lands = bool(look.helm.doubts(look.seen.telemetry, look.now))
        if isinstance(news, MapChanged) and not self._resting:
            self._begun, self._way = False, None  # another way may be free
        yield from ()

    def tick(self, look: Look) -> Iterator[Wish]:
        """Fly around, then let the autopilot land; with other aircraft in the air all the way is flown by us, in our
        own layer, and only the landing leaves it."""
        t = look.seen.telemetry
        if not self._begun:
            self._begun = True
            stands = bool(look.seen.others) and on_ground(
                t
            )  # it has waited to take off, and need not any more
            if t.guided and not look.standing.direct and not stands:
                points = look.chart.route((t.lat, t.lon), look.chart.home(t))
                if not look.seen.others and look.helm.returns_clear([(t.lat, t.lon), *points][-2], t):
                    points = points[:-1]  # from there the autopilot flies
                self._way = Way(points, climb=bool(points))
        ours = self._way is not None and not self._resting  # who lands already makes room by being down
        if ours and (place := self._aside.place(look)) is not None:
            yield Note(f"makes room for the others at {look.chart.written(place)}")
            self._way = Way([place, *look.chart.route(place, look.chart.home(t))], climb=False)
        if self._way is not None and not self._resting:
            yield from self._way.tick(look)
            if not self._way.flown:
                return
        if not self._resting and t.guided and t.armed and not look.standing.direct:
            why = look.helm.traffic.landing(t, look.seen.others, look.now)
            yield from self._turn.wait(why, "to land", look)
            if why:
                return
        if not self._resting:  # the autopilot steers from here: it need not come nearer to a waypoint of ours
            self._resting = True
            yield Rest()
        if not t.armed:
            yield touchdown(look, "on the ground, disarmed")
        elif not look.busy and (
            self._ordered < 0.0 or (t.guided and look.now - self._ordered > HOME_AGAIN_S)
        ):
            self._ordered = look.now
            yield Land() if self._lands else ReturnToLaunch()
