"""The wind as the autopilot tells it, else as the aircraft's lean says; nothing where neither is known.

A multicopter that leans by an angle pulls with g times its tangent. What of that does not accelerate it pays for the
air: a drag along its way through the air, about as the square of its airspeed. The square root of that pull, with its
direction, is therefore the airspeed but for one factor: velocity over ground = wind + factor * root. Over a while of
flying in several directions, or at several speeds, both follow by least squares (the wind is what does not turn with
the aircraft); a hover alone tells neither. The factor depends on the airframe and is learnt with the wind.

An aircraft at the limit of its lean is as fast as it can be, so that what it lacks of `flight.max_airspeed_mps` is wind
against it, also when it never turns. One that is slow because its legs are short does not lean, and feels none.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from service.config import FlightSettings
from service.mavlink.telemetry import Telemetry, Wind

_GRAVITY_MPS2 = 9.81
_PIECE_S = 0.9  # lean and acceleration are averaged over so long at least
_LONGEST_PIECE_S = 3.0  # a longer gap tells nothing
_KEPT_S = 120.0
_FEWEST = 15
_SPREAD_MPS = 2.0  # standard deviation of the velocity that the factor can be learnt from
_GUST_S = 6.0  # a gust is the same for so long: pieces of it are no evidence of their own
_SURE_MPS = 1.5  # standard error of the wind that is believed
_FACTORS = (2.0, 12.0)  # metres a second by the root of a pull of 1 m/s²: 4 to 0.15 of drag at 10 m/s
_HARD_MPS2 = 4.5  # a lean of 25 degrees, forward
_AHEAD = 0.9  # of the lean at least is forward: what is leant sideways against is a wind from the side
_STEADY_MPS, _STEADY_S = 0.7, 4.0
_FELT_FOR_S = 300.0
_SLOWEST_MPS = 0.5  # slower over ground counts as not getting anywhere at all


@dataclass(frozen=True, slots=True)
class _Moment:
    """Velocity over ground and the pull of the lean, both (north, east), at one time of the service's clock."""

    time: float
    velocity: tuple[float, float]
    pull: tuple[float, float]


def pull_of(t: Telemetry) -> tuple[float, float] | None:
    """The horizontal acceleration that the lean gives, (north, east) in m/s²; None while the attitude is unknown."""
    heading = t.yaw_deg if math.isfinite(t.yaw_deg) else t.heading_deg
    if not (math.isfinite(t.roll_deg) and math.isfinite(t.pitch_deg) and math.isfinite(heading)):
        return None
    if max(abs(t.roll_deg), abs(t.pitch_deg)) > 60.0:
        return None
    ahead = -_GRAVITY_MPS2 * math.tan(math.radians(t.pitch_deg))
    right = _GRAVITY_MPS2 * math.tan(math.radians(t.roll_deg))
    yaw = math.radians(heading)
    return ahead * math.cos(yaw) - right * math.sin(yaw), ahead * math.sin(yaw) + right * math.cos(yaw)


class WindFelt:
    """Looks at an aircraft several times a second."""

    def __init__(self, flight: FlightSettings) -> None:
        self._flight = flight
        self._piece: list[_Moment] = []
        self._pieces: deque[tuple[float, tuple[float, float], tuple[float, float]]] = deque()
        self._reckoned: Wind | None = None
        self._felt: Wind | None = None
        self._reckoned_at = self._felt_at = self._steady_since = -math.inf
        self._speed = math.nan

    def update(self, t: Telemetry, under_way: bool, now: float) -> Wind | None:
        """Take one moment in: what the vehicle tells, and whether it is too far from its waypoint to brake for it.
        Returns the wind to reckon with; None: it is not known."""
        if t.wind is not None:
            return t.wind
        pull = pull_of(t)
        north, east, _ = t.velocity_ned_mps
        if pull is not None and math.isfinite(north) and math.isfinite(east):
            self._learn(_Moment(t.position_time, (north, east), pull), now)
            speed = math.hypot(north, east)
            forward = (pull[0] * north + pull[1] * east) / speed if speed > 0.0 else 0.0
            hard = forward >= max(_HARD_MPS2, _AHEAD * math.hypot(*pull))
            self._feel((east, north), hard, under_way, now)
        else:
            self._piece.clear()
        if now - self._felt_at <= _FELT_FOR_S and self._felt_at >= self._reckoned_at:
            return self._felt
        return self._reckoned if now - self._reckoned_at <= _FELT_FOR_S else None

    def _learn(self, moment: _Moment, now: float) -> None:
        if self._piece and not 0.0 < moment.time - self._piece[-1].time <= _LONGEST_PIECE_S:
            if moment.time == self._piece[-1].time:
                return
            self._piece.clear()
        self._piece.append(moment)
        first = self._piece[0]
        seconds = moment.time - first.time
        if seconds < _PIECE_S:
            return
        piece, self._piece = self._piece, [moment]
        velocity, pull = _mean([each.velocity for each in piece]), _mean([each.pull for each in piece])
        north, east = (
            pull[axis] - (moment.velocity[axis] - first.velocity[axis]) / seconds for axis in (0, 1)
        )
        root = math.sqrt(math.hypot(north, east))
        against = (north / root, east / root) if root > 0.0 else (0.0, 0.0)
        self._pieces.append((now, velocity, against))
        while now - self._pieces[0][0] > _KEPT_S:
            self._pieces.popleft()
        self._fit(now)

    def _fit(self, now: float) -> None:
        """Least squares of the roots over the velocities, which are the better known of the two."""
        count = len(self._pieces)
        if count < _FEWEST:
            return
        mean_v, mean_r = (
            _mean([piece[1] for piece in self._pieces]),
            _mean([piece[2] for piece in self._pieces]),
        )
        spread = shared = roots = 0.0
        for _, velocity, root in self._pieces:
            for axis in (0, 1):
                away, off = velocity[axis] - mean_v[axis], root[axis] - mean_r[axis]
                spread += away * away / count
                shared += away * off / count
                roots += off * off / count
        if spread < _SPREAD_MPS**2 or shared <= 0.0 or not _FACTORS[0] <= spread / shared <= _FACTORS[1]:
            return
        factor = spread / shared
        left = max(0.0, roots - shared / factor) / (
            count * _PIECE_S / _GUST_S
        )  # of what the gusts alike leave
        wrong = factor * math.sqrt(left * (1.0 + (factor * math.hypot(*mean_r)) ** 2 / spread))
        if wrong > _SURE_MPS:
            return
        self._reckoned = Wind(mean_v[0] - factor * mean_r[0], mean_v[1] - factor * mean_r[1])
        self._reckoned_at = now

    def _feel(self, velocity: tuple[float, float], hard: bool, under_way: bool, now: float) -> None:
        """Wind against an aircraft that leans hard, and is steadily slower than it should be; (east, north)."""
        speed = math.hypot(*velocity)
        leans = under_way and hard
        if not leans or not abs(speed - self._speed) < _STEADY_MPS:
            self._speed, self._steady_since = speed, now if leans else math.inf
        elif now - self._steady_since >= _STEADY_S and speed > _SLOWEST_MPS:
            missing = self._flight.max_airspeed_mps - speed
            if speed < self._flight.speed_mps - 1.0 and missing > 0.0:
                east, north = velocity[0] / speed, velocity[1] / speed
                self._felt, self._felt_at = Wind(-missing * north, -missing * east), now


def _mean(vectors: Sequence[tuple[float, float]]) -> tuple[float, float]:
    norths, easts = zip(*vectors, strict=True)
    return sum(norths) / len(vectors), sum(easts) / len(vectors)
