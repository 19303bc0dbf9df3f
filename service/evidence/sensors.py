"""The sensor as the settings describe it: one of the paper's fields of view, or a camera.

A profile answers two questions: which cells a frame from a pose shows (`footprint`), and what a report of such a
frame says (`read`). The planner's field of view and the cell size follow from the same settings.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from roisearch import FieldOfView
from service.area import Grid, GridFrame
from service.camera import Detectability, Errors, Flat, Ground, Pinhole, look_at_cells, terrain_of
from service.camera.sensor import CameraSensor, Mount, nominal_view
from service.config import Settings, about, each_aircraft
from service.errors import BadInput
from service.evidence.calibration import calibration_of
from service.evidence.mask import Sensor
from service.evidence.observe import Footprint, FramePose, Reading
from service.evidence.reports import Report

FIELDS_OF_VIEW: dict[str, Callable[[float, float], FieldOfView]] = {
    "point": FieldOfView.point,
    "donut": FieldOfView.donut,
    "wide-angle": FieldOfView.wide_angle,
}
_FINE = 40  # cells along the height of flight in which a footprint is measured


class Profile(Protocol):
    """What the intake and the display need of a sensor."""

    def footprint(self, pose: FramePose) -> Footprint: ...
    def read(self, pose: FramePose, report: Report) -> Reading: ...


def make_sensor(settings: Settings, grid: Grid) -> Profile:
    """The profile on a grid. Raises BadInput when a camera cannot be what the settings say, or a file of theirs is
    not what it should be."""
    sensor, height = settings.sensor, settings.flight.altitude_m
    fov = field_of_view(settings, grid.frame.cell_m)
    if sensor.profile != "camera":
        return Sensor(
            frame=grid.frame,
            fov=fov,
            p_tp=sensor.p_tp,
            p_tn=sensor.p_tn,
            overlap=sensor.overlap,
            min_covered=sensor.min_covered,
            height_m=height,
            calibration=calibration_of(settings),
            classes=frozenset(sensor.classes),
            sigma_m=math.hypot(sensor.position_sigma_m, height * math.radians(sensor.attitude_sigma_deg)),
            relief=grid.relief,
        )
    ground: Ground = Flat() if grid.relief is None else terrain_of(grid.relief)
    return camera_sensor(settings, grid.frame, ground)


def field_of_view(settings: Settings, cell_m: float) -> FieldOfView:
    """What the planner takes a look to see. Raises BadInput when no cell of that size is ever in view."""
    sensor = settings.sensor
    if sensor.profile != "camera":
        return FIELDS_OF_VIEW[sensor.profile](sensor.p_tp, sensor.p_tn)
    try:
        return nominal_view(camera_sensor(settings, _unit_frame(cell_m)), settings.flight.altitude_m, cell_m)
    except ValueError as error:
        raise BadInput(
            f"{error}; fly lower, tilt the camera down, give it a wider lens, or smaller cells (sensor.cell_m)"
        ) from None


def cell_size(settings: Settings) -> float:
    """The cell size in metres: as given, else from the footprint, less the overlap.

    One cell fills the shorter side of a footprint of the paper's profiles. A camera's is taken twice as fine, so that
    two rows or more are in view and a detection is told apart from its neighbours.
    """
    sensor = settings.sensor
    if sensor.cell_m is not None:
        return sensor.cell_m
    if sensor.profile == "camera":
        return round(0.5 * _shorter_side(settings) * (1.0 - sensor.overlap), 1)
    return round(_seen_m(settings) * (1.0 - sensor.overlap), 1)


def cell_for_all(settings: Settings) -> float:
    """The cell size in metres; where aircraft have sensors of their own, the smallest that one of them would have, so
    that each sees a cell whole. Raises BadInput."""
    if not any(each.sensor.given for each in settings.aircraft):
        return cell_size(settings)
    sizes = []
    for (name, alone), own in zip(each_aircraft(settings).items(), settings.aircraft, strict=True):
        with about(name):
            sizes.append(cell_size(alone))
            if own.sensor.given.keys() & {"horizontal_fov_deg", "vertical_fov_deg"}:
                check_whole_cell(alone)
    return min(sizes)


def check_whole_cell(settings: Settings) -> None:
    """Raises BadInput when a lens of the paper's profiles sees less than a cell of the size that is given."""
    sensor, seen_m = settings.sensor, _seen_m(settings)
    if sensor.profile != "camera" and sensor.cell_m is not None and seen_m < sensor.cell_m:
        raise BadInput(
            f"from {settings.flight.altitude_m:g} m its sensor sees {seen_m:.0f} m of the ground, less than a cell of "
            f"{sensor.cell_m:g} m; fly it higher, give it a wider lens, or all of them smaller cells (sensor.cell_m)"
        )


def _seen_m(settings: Settings) -> float:
    """The shorter side of what a sensor of the paper's profiles sees of flat ground, in metres."""
    angle = min(settings.sensor.horizontal_fov_deg, settings.sensor.vertical_fov_deg)
    return 2.0 * settings.flight.altitude_m * math.tan(math.radians(angle / 2.0))


def camera_sensor(settings: Settings, frame: GridFrame, ground: Ground | None = None) -> CameraSensor:
    """The camera of the settings on a frame; flat ground unless given. Raises BadInput for one that sees nothing."""
    sensor, height = settings.sensor, settings.flight.altitude_m
    camera = Pinhole.of_angles(
        sensor.image_width_px, sensor.image_height_px, sensor.horizontal_fov_deg, sensor.vertical_fov_deg
    )
    if sensor.min_p_tp > sensor.p_tp:
        raise BadInput(
            f"sensor.min_p_tp = {sensor.min_p_tp:g} is above sensor.p_tp = {sensor.p_tp:g}, so no look would ever "
            "count; give one below it"
        )
    tilt = math.sin(math.radians(-sensor.camera_pitch_deg))
    if sensor.camera_pitch_deg > -sensor.min_grazing_deg or height > sensor.max_range_m * tilt:
        raise BadInput(
            f"sensor.camera_pitch_deg = {sensor.camera_pitch_deg:g}: from {height:g} m the middle of the image shows "
            "the horizon or ground beyond sensor.max_range_m; tilt the camera down"
        )
    detect = Detectability(sensor.p_tp, sensor.target_size_m, sensor.half_seen_px, 1.0, sensor.min_p_tp)
    nominal = float(detect.pixels(camera.focal_px, np.array([height / tilt]), np.array([tilt]))[0])
    if nominal < sensor.half_seen_px:
        raise BadInput(
            f"from {height:g} m a target of sensor.target_size_m = {sensor.target_size_m:g} m has {nominal:.1f} pixels "
            f"a side, fewer than sensor.half_seen_px = {sensor.half_seen_px:g}; fly lower or take a longer lens"
        )
    return CameraSensor(
        frame=frame,
        ground=ground or Flat(),
        camera=camera,
        mount=Mount(
            sensor.camera_pitch_deg, sensor.camera_yaw_deg, sensor.camera_roll_deg, sensor.camera_stabilised
        ),
        detect=Detectability(
            sensor.p_tp, sensor.target_size_m, sensor.half_seen_px, nominal, sensor.min_p_tp
        ),
        p_tn=sensor.p_tn,
        min_covered=sensor.min_covered,
        max_range_m=sensor.max_range_m,
        min_grazing_deg=sensor.min_grazing_deg,
        calibration=calibration_of(settings),
        classes=frozenset(sensor.classes),
        errors=Errors(sensor.attitude_sigma_deg, sensor.position_sigma_m, sensor.height_sigma_m),
    )


def _unit_frame(cell_m: float) -> GridFrame:
    """One cell with its centre at latitude and longitude 0."""
    return GridFrame(0.0, 0.0, 0.0, cell_m, 1, 1, -0.5 * cell_m, 0.5 * cell_m)


def _shorter_side(settings: Settings) -> float:
    """The shorter of a level camera's mean width and depth of view on flat ground, in metres."""
    fine = settings.flight.altitude_m / _FINE
    there = camera_sensor(settings, _unit_frame(fine))
    pose = FramePose(0.0, 0.0, settings.flight.altitude_m, 0.0, 0.0)
    looks = look_at_cells(
        there.sight(pose), there.ground, there.frame, there.detect,
        max_range_m=there.max_range_m, min_grazing_deg=there.min_grazing_deg, bounded=False,
    )  # fmt: skip
    if not len(looks.cells):
        raise BadInput(
            f"nothing is in view from {pose.height_m:g} m well enough to count; fly lower, tilt the camera down, or "
            "give a lower sensor.min_p_tp"
        )
    area = float(looks.covered.sum()) * fine**2
    _, rows = np.unique(looks.cells[:, 1], return_counts=True)
    depth = float(rows.max()) * fine
    return min(depth, area / depth)
