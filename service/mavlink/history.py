"""Where the aircraft was when a picture was taken: a bounded past that can be asked between its samples."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

from service.geometry import moved, turn_deg, wrapped_deg
from service.mavlink.telemetry import Telemetry

_LONGEST_GAP_S = 1.5
_LONGEST_GUESS_S = 0.5


@dataclass(frozen=True, slots=True)
class PastPose:
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
        self._poses: list[PastPose] = []
        self._times: list[float] = []
        self._boots: list[float] = []

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def newest(self) -> PastPose | None:
        """The last pose recorded."""
        return self._poses[-1] if self._poses else None

    def record(self, telemetry: Telemetry) -> None:
        """Add the pose of a snapshot; one that is older than the last is left out.

        What waited in a buffer is taken in at one time, and the last of it is where the aircraft was then.
        """
        time = telemetry.position_time
        if self._times and time < self._times[-1]:
            return
        if self._times and time == self._times[-1]:
            for kept in (self._times, self._boots, self._poses):
                kept.pop()
        heading = telemetry.heading_deg if math.isfinite(telemetry.heading_deg) else telemetry.yaw_deg
        self._times.append(time)
        self._boots.append(-math.inf if telemetry.boot_time_s is None else telemetry.boot_time_s)
        self._poses.append(
            PastPose(
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

    def forget_boot(self) -> None:
        """The vehicle has rebooted: its time since boot means another time now. Where it was stays true."""
        self._boots = [-math.inf] * len(self._boots)

    def time_of_boot(self, boot_s: float) -> float | None:
        """The service's time at the vehicle's time since boot, between the samples that were received around it.

        Up to half a second beyond the newest; None when the past does not reach that far, or the vehicle does not
        tell its time. What the link delays is in it, as it is in the time of every pose.
        """
        at = bisect_right(self._boots, boot_s) if math.isfinite(boot_s) else 0
        if at == 0 or not math.isfinite(self._boots[at - 1]):
            return None
        before, time = self._boots[at - 1], self._times[at - 1]
        if at == len(self._boots):
            return time + boot_s - before if boot_s - before <= _LONGEST_GUESS_S else None
        share = (boot_s - before) / (self._boots[at] - before)
        return time + share * (self._times[at] - time) if math.isfinite(share) else None

    def pose_at(self, time: float) -> PastPose | None:
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


def _between(a: PastPose, b: PastPose, time: float) -> PastPose:
    share = (time - a.time) / (b.time - a.time)

    def mix(x: float, y: float) -> float:
        return x + share * (y - x)

    return PastPose(
        time=time,
        lat=mix(a.lat, b.lat),
        lon=wrapped_deg(a.lon + share * turn_deg(a.lon, b.lon)),
        alt_amsl_m=mix(a.alt_amsl_m, b.alt_amsl_m),
        alt_home_m=mix(a.alt_home_m, b.alt_home_m),
        roll_deg=wrapped_deg(a.roll_deg + share * turn_deg(a.roll_deg, b.roll_deg)),
        pitch_deg=mix(a.pitch_deg, b.pitch_deg),
        heading_deg=(a.heading_deg + share * turn_deg(a.heading_deg, b.heading_deg)) % 360.0,
        north_mps=mix(a.north_mps, b.north_mps),
        east_mps=mix(a.east_mps, b.east_mps),
    )


def _carried_on(last: PastPose, time: float) -> PastPose:
    seconds = time - last.time
    lat, lon = moved((last.lat, last.lon), seconds * last.east_mps, seconds * last.north_mps)
    return PastPose(
        time=time,
        lat=lat,
        lon=lon,
        alt_amsl_m=last.alt_amsl_m,
        alt_home_m=last.alt_home_m,
        roll_deg=last.roll_deg,
        pitch_deg=last.pitch_deg,
        heading_deg=last.heading_deg,
        north_mps=last.north_mps,
        east_mps=last.east_mps,
    )
