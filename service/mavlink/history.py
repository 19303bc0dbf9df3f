"""Where the aircraft was when a picture was taken: a bounded past that can be asked between its samples."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

from service.mavlink.telemetry import Telemetry

_LONGEST_GAP_S = 1.5
_LONGEST_GUESS_S = 0.5
_METRES_PER_DEGREE = 111_194.93


@dataclass(frozen=True, slots=True)
class Pose:
    """Place, attitude and speed at one time of the service's clock; degrees, metres, m/s."""

    time: float
    lat: float
    lon: float
    alt_amsl_m: float
    alt_home_m: float
    roll_deg: float
    pitch_deg: float
    heading_deg: float
    north_mps: float
    east_mps: float


class PoseHistory:
    """Poses of the last `length_s` seconds, oldest first, taken at each GLOBAL_POSITION_INT received."""

    def __init__(self, length_s: float) -> None:
        self._length_s = length_s
        self._poses: list[Pose] = []
        self._times: list[float] = []
        self._boots: list[float] = []

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def newest(self) -> Pose | None:
        """The last pose recorded."""
        return self._poses[-1] if self._poses else None

    def record(self, telemetry: Telemetry) -> None:
        """Add the pose of a snapshot; one that is not newer than the last is left out."""
        time = telemetry.position_time
        if self._times and time <= self._times[-1]:
            return
        heading = telemetry.yaw_deg if math.isfinite(telemetry.yaw_deg) else telemetry.heading_deg
        self._times.append(time)
        self._boots.append(-math.inf if telemetry.boot_time_s is None else telemetry.boot_time_s)
        self._poses.append(
            Pose(
                time=time,
                lat=telemetry.lat,
                lon=telemetry.lon,
                alt_amsl_m=telemetry.alt_amsl_m,
                alt_home_m=telemetry.alt_home_m,
                roll_deg=telemetry.roll_deg,
                pitch_deg=telemetry.pitch_deg,
                heading_deg=heading,
                north_mps=telemetry.velocity_ned_mps[0],
                east_mps=telemetry.velocity_ned_mps[1],
            )
        )
        if self._times[0] < time - 1.25 * self._length_s:
            keep = bisect_right(self._times, time - self._length_s)
            del self._times[:keep], self._poses[:keep], self._boots[:keep]

    def clear(self) -> None:
        """Forget everything, as after a reboot of the vehicle."""
        self._poses.clear()
        self._times.clear()
        self._boots.clear()

    def time_of_boot(self, boot_s: float) -> float | None:
        """The service's time at the vehicle's time since boot, between the samples that were received around it.

        Up to half a second beyond the newest; None when the past does not reach that far, or the vehicle does not
        tell its time. What the link delays is in it, as it is in the time of every pose.
        """
        if not math.isfinite(boot_s) or not self._boots or not self._boots[0] <= boot_s:
            return None
        at = bisect_right(self._boots, boot_s)
        before, time = self._boots[at - 1], self._times[at - 1]
        if at == len(self._boots):
            return time + boot_s - before if boot_s - before <= _LONGEST_GUESS_S else None
        share = (boot_s - before) / (self._boots[at] - before)
        return time + share * (self._times[at] - time) if math.isfinite(share) else None

    def pose_at(self, time: float) -> Pose | None:
        """The pose at a time, between two samples or carried on from the newest for up to half a second.

        None when the past does not reach that far, or the position was not received around that time.
        """
        if not self._times or not math.isfinite(time):
            return None
        at = bisect_right(self._times, time)
        if at == 0:
            return None
        before = self._poses[at - 1]
        if before.time == time:
            return before
        if at == len(self._poses):
            return _carried_on(before, time) if time - before.time <= _LONGEST_GUESS_S else None
        after = self._poses[at]
        if after.time - before.time > _LONGEST_GAP_S:
            return None
        return _between(before, after, time)


def _between(a: Pose, b: Pose, time: float) -> Pose:
    share = (time - a.time) / (b.time - a.time)

    def mix(x: float, y: float) -> float:
        return x + share * (y - x)

    return Pose(
        time=time,
        lat=mix(a.lat, b.lat),
        lon=_wrapped(a.lon + share * _turn(a.lon, b.lon)),
        alt_amsl_m=mix(a.alt_amsl_m, b.alt_amsl_m),
        alt_home_m=mix(a.alt_home_m, b.alt_home_m),
        roll_deg=_wrapped(a.roll_deg + share * _turn(a.roll_deg, b.roll_deg)),
        pitch_deg=mix(a.pitch_deg, b.pitch_deg),
        heading_deg=(a.heading_deg + share * _turn(a.heading_deg, b.heading_deg)) % 360.0,
        north_mps=mix(a.north_mps, b.north_mps),
        east_mps=mix(a.east_mps, b.east_mps),
    )


def _carried_on(last: Pose, time: float) -> Pose:
    seconds = time - last.time
    narrowing = max(math.cos(math.radians(last.lat)), 1e-6)
    return Pose(
        time=time,
        lat=last.lat + seconds * last.north_mps / _METRES_PER_DEGREE,
        lon=_wrapped(last.lon + seconds * last.east_mps / (_METRES_PER_DEGREE * narrowing)),
        alt_amsl_m=last.alt_amsl_m,
        alt_home_m=last.alt_home_m,
        roll_deg=last.roll_deg,
        pitch_deg=last.pitch_deg,
        heading_deg=last.heading_deg,
        north_mps=last.north_mps,
        east_mps=last.east_mps,
    )


def _turn(a: float, b: float) -> float:
    """From one angle to another the short way, degrees."""
    return (b - a + 180.0) % 360.0 - 180.0


def _wrapped(angle: float) -> float:
    """The same angle between -180 and 180."""
    return (angle + 180.0) % 360.0 - 180.0 if not -180.0 <= angle <= 180.0 else angle
