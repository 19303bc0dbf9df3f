"""The sensor profile "camera": detector reports become evidence through the camera's geometry.

What a report tells about its camera (gimbal, intrinsics, the footprint's outline) goes before the settings. A
detection with a pixel box is projected onto the ground with its uncertainty; one with latitude and longitude has its
own `accuracy_m`, else what the camera's errors make of that place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from roisearch import FieldOfView
from service.area.frame import GridFrame
from service.camera.detect import Detectability
from service.camera.ground import Flat, Ground
from service.camera.in_view import behind_box, beside_image, beside_outline
from service.camera.locate import Errors, Spot, locate_pixel, spread_hits
from service.camera.look import Looks, look_at_cells
from service.camera.optics import Floats, Pinhole, Sight, rotation, sight_from
from service.evidence.calibration import Calibration
from service.evidence.observe import Footprint, FramePose, Reading, Sighting, Unreadable
from service.evidence.plausible import SIGMAS, check_box, check_place
from service.evidence.reports import Detection, Gimbal, Intrinsics, Report
from service.evidence.targets import not_the_target, only_targets

_FAR_CORNER = 10.0  # times the range: so far from the camera may a corner of an outline be
_NO_HEADING = "where the nose pointed is not known, and the camera turns with it"
_NO_LEAN = "how the aircraft leaned is not known, and the camera leans with it"
_NOTHING = Footprint(np.empty((0, 2), dtype=np.int64), *np.empty((2, 0)), *np.empty((2, 0)))


@dataclass(frozen=True)
class Mount:
    """How the camera sits: angles to the nose. Stabilised: a gimbal holds pitch and roll to the horizon and only the
    heading turns it; else the aircraft's attitude turns it too."""

    pitch_deg: float
    yaw_deg: float = 0.0
    roll_deg: float = 0.0
    stabilised: bool = True


@dataclass(frozen=True, eq=False)
class CameraSensor:
    """The sensor's profile on this grid: which cells a pose shows, and what a report says about them."""

    frame: GridFrame
    ground: Ground
    camera: Pinhole
    mount: Mount
    detect: Detectability
    p_tn: float
    min_covered: float
    max_range_m: float
    min_grazing_deg: float
    errors: Errors
    calibration: Calibration | None = None
    classes: frozenset[str] = frozenset()

    # ---- the two questions of every profile --------------------------------------------------------------

    def footprint(self, pose: FramePose) -> Footprint:
        """The cells that a frame taken from `pose` shows, as the settings have the camera."""
        if why := self._unknown(pose):
            return _NOTHING.in_vain(why)
        return self._footprint(self.sight(pose))

    def read(self, pose: FramePose, report: Report) -> Reading:
        """The evidence in a report of a frame taken from `pose`.

        Raises:
            Unreadable: the report says what no camera of this kind can see, or what its frame cannot show.
        """
        report, ignored = only_targets(report, self.classes)
        note = not_the_target(ignored, self.classes) if ignored else ""
        outline, gimbal = report.footprint, report.gimbal
        if why := self._unknown(pose, gimbal):
            if outline is None or any(seen.box is not None for seen in report.detections):
                return Reading(_NOTHING.in_vain(why), {}, note=note)
            pose = replace(pose, heading_deg=0.0)  # the outline tells where it looked
        sight = self.sight(pose, gimbal, report.intrinsics)
        footprint = self._footprint(sight) if outline is None else self._outlined(outline, sight.position[:2])
        if (
            self.calibration is not None
            and (looks := self.calibration.at(report.threshold_share)) is not None
        ):
            better, worse = looks[0] / self.detect.p_tp, (1.0 - looks[1]) / (1.0 - self.p_tn)
            p_tp, p_tn = footprint.p_tp * better, 1.0 - (1.0 - footprint.p_tn) * worse
            footprint = replace(footprint, p_tp=p_tp, p_tn=p_tn)
        spots = []
        for seen in self._checked(report, sight):
            spot = self.spot(sight, seen)
            if spot is not None:
                spots.append((spot, seen))
            elif seen.box is not None:
                footprint = self._less_what_is_behind(footprint, sight, seen.box)
        looked, worth = footprint.counts, self.calibration
        hits, on_it = spread_hits(
            [(spot, worth.ratio(report.share(seen.score)) if worth else None) for spot, seen in spots],
            footprint.cells[looked], footprint.p_tp[looked], footprint.p_tn[looked], self.frame.cell_m,
        )  # fmt: skip
        return Reading(footprint, hits, tuple(self._sighting(*spots[i], report) for i in on_it), note)

    def _unknown(self, pose: FramePose, gimbal: Gimbal | None = None) -> str:
        """Why it is not known where the camera looked from `pose`, turned as the report's gimbal says, or nothing."""
        if gimbal is not None and gimbal.relative_to == "earth":
            return ""
        if not math.isfinite(pose.heading_deg):
            return _NO_HEADING
        leans = gimbal is not None or not self.mount.stabilised
        return _NO_LEAN if leans and not math.isfinite(pose.pitch_deg + pose.roll_deg) else ""

    def sight(
        self, pose: FramePose, gimbal: Gimbal | None = None, intrinsics: Intrinsics | None = None
    ) -> Sight:
        """The camera at a pose, turned as the report's gimbal says, else as it is mounted."""
        east, south = self.frame.to_metres([[pose.lat, pose.lon]])[0]
        level = self.mount.stabilised if gimbal is None else False
        body = rotation(pose.heading_deg, *((0.0, 0.0) if level else _attitude(pose)))
        if gimbal is None:
            turn = body @ rotation(self.mount.yaw_deg, self.mount.pitch_deg, self.mount.roll_deg)
        else:
            own = rotation(gimbal.yaw_deg, gimbal.pitch_deg, gimbal.roll_deg)
            turn = own if gimbal.relative_to == "earth" else body @ own
        on_grid = rotation(-self.frame.bearing_deg, 0.0, 0.0) @ turn
        return sight_from(_pinhole(intrinsics) or self.camera, (east, south, pose.height_m), on_grid)

    # ---- cells -------------------------------------------------------------------------------------------

    def _footprint(self, sight: Sight) -> Footprint:
        looks = look_at_cells(
            sight,
            self.ground,
            self.frame,
            self.detect,
            max_range_m=self.max_range_m,
            min_grazing_deg=self.min_grazing_deg,
        )
        footprint = self._worth(looks)
        if footprint.counts.any():
            return footprint
        height = float(sight.position[2])
        seen = "no cell of the grid is in view"
        if len(looks.cells):
            seen = f"no cell is seen well enough (at best p_tp {looks.p_tp.max():.2f}, {looks.covered.max():.0%} of it)"
        return footprint.in_vain(f"{seen} from {height:.0f} m above the launch point")

    def _worth(self, looks: Looks) -> Footprint:
        """A false alarm comes from the part of a cell that is in view, so 1 - p_tn is as much less."""
        counts = (looks.covered >= self.min_covered) & (looks.p_tp >= self.detect.floor)
        p_tn = 1.0 - looks.covered * (1.0 - self.p_tn)
        kept = looks.covered >= 0.5 * self.min_covered
        return Footprint(looks.cells[kept], looks.covered[kept], counts[kept], looks.p_tp[kept], p_tn[kept])

    def _outlined(self, outline: tuple[tuple[float, float], ...], camera: Floats) -> Footprint:
        """The cells of a polygon that the sender drew, each worth the nominal p_tp times its part inside.

        Its sides are straight on the grid's plane, so that they cost the same whatever they span.
        """
        corners, most = self.frame.to_metres(outline), _FAR_CORNER * self.max_range_m
        if not (np.linalg.norm(corners - camera, axis=1) <= most).all():  # also what is not finite
            raise Unreadable(
                f"a corner of the footprint is more than {most:g} m from the camera, {_FAR_CORNER:g} times "
                "sensor.max_range_m; give the corners of the ground that the frame shows"
            )
        flat = shapely.Polygon(corners)
        if not flat.is_valid or flat.area < 1.0:
            raise Unreadable(
                "the footprint is not a polygon: its sides cross, or its corners lie in one line"
            )
        west, north, east, south = np.array(flat.bounds) / self.frame.cell_m
        top, bottom = max(0, math.floor(north)), min(self.frame.rows, math.floor(south) + 1)
        left, right = max(0, math.floor(west)), min(self.frame.cols, math.floor(east) + 1)
        rows, cols = np.mgrid[top : max(top, bottom), left : max(left, right)]
        cells = np.stack([rows.ravel(), cols.ravel()], axis=1).astype(np.int64)
        corner = cells[:, ::-1] * self.frame.cell_m
        squares = shapely.box(
            corner[:, 0], corner[:, 1], corner[:, 0] + self.frame.cell_m, corner[:, 1] + self.frame.cell_m
        )
        covered = shapely.area(shapely.intersection(squares, flat)) / self.frame.cell_m**2
        return self._worth(Looks(cells, covered, covered * self.detect.p_tp))

    # ---- detections --------------------------------------------------------------------------------------

    def _checked(self, report: Report, sight: Sight) -> list[Detection]:
        """The detections with boxes in pixels; raises Unreadable for one that cannot be where the frame looks."""
        outline, camera = report.footprint, sight.camera
        gap = beside_image(sight, self.frame, self.ground, self.max_range_m)
        if outline is not None:
            gap = beside_outline(self.frame.to_metres(outline), sight, self.frame)
        checked = []
        for seen in report.detections:
            if seen.box is not None:
                box = report.in_pixels(seen.box, camera.width, camera.height)
                check_box(box, camera.width, camera.height)
                seen = seen.model_copy(update={"box": box})
            else:
                far = min(self.max_range_m, float(sight.position[2]) * 10.0)
                camera_m = math.hypot(self.errors.position_m, far * math.radians(self.errors.attitude_deg))
                check_place(seen, gap, self.frame.cell_m + SIGMAS * max(camera_m, seen.accuracy_m or 0.0))
            checked.append(seen)
        return checked

    def _less_what_is_behind(
        self, footprint: Footprint, sight: Sight, box: tuple[float, float, float, float]
    ) -> Footprint:
        """A detection that cannot be placed, near the horizon, says nothing of the cells that lie behind it."""
        flat: Floats = np.asarray((footprint.cells[:, ::-1] + 0.5) * self.frame.cell_m, dtype=np.float64)
        points: Floats = np.column_stack([flat, self.ground.height_at(flat)])
        margin = SIGMAS * sight.camera.focal_px * math.radians(self.errors.attitude_deg)
        hidden = behind_box(sight, points, box, margin + 0.5 * (box[3] - box[1]))
        return replace(footprint, counts=footprint.counts & ~hidden)

    def spot(self, sight: Sight, seen: Detection) -> Spot | None:
        """Where a detection is on the ground; None where that cannot be told."""
        if seen.box is not None:
            x0, y0, x1, y1 = seen.box
            sigma = np.maximum(np.array([x1 - x0, y1 - y0]) / 4.0, 1.0)
            middle = (0.5 * (x0 + x1), 0.5 * (y0 + y1))
            return locate_pixel(sight, middle, sigma, self.ground, self.errors, self.max_range_m)
        point = self.frame.to_metres(np.array([[seen.lat, seen.lon]], dtype=np.float64))[0]
        if seen.accuracy_m is not None:
            # it lies in what the frame shows: an accuracy worse than the range says no more than that
            return Spot(point, np.eye(2) * min(seen.accuracy_m, self.max_range_m) ** 2)
        there = np.array([[*point, float(self.ground.height_at(point[None])[0])]])
        pixels, depth = sight.project(there)
        located = None
        if depth[0] > 0.0:
            located = locate_pixel(sight, pixels[0], (1.0, 1.0), self.ground, self.errors, self.max_range_m)
        return Spot(point, located.covariance if located else np.eye(2) * self.frame.cell_m**2)

    def _sighting(self, spot: Spot, seen: Detection, report: Report) -> Sighting:
        lat, lon = self.frame.from_metres(spot.point[None])[0]
        c = spot.covariance
        square = (float(c[0, 0]), float(c[0, 1]), float(c[1, 1]))
        score = None if seen.score is None else report.share(seen.score)
        return Sighting(float(lat), float(lon), square, report.picture_of(seen), score)


def _attitude(pose: FramePose) -> tuple[float, float]:
    """Pitch and roll; level where the telemetry has not told them."""
    known = math.isfinite(pose.pitch_deg) and math.isfinite(pose.roll_deg)
    return (pose.pitch_deg, pose.roll_deg) if known else (0.0, 0.0)


def _pinhole(given: Intrinsics | None) -> Pinhole | None:
    if given is None:
        return None
    if given.horizontal_fov_deg is not None:
        camera = Pinhole.of_angles(given.width, given.height, given.horizontal_fov_deg)
    else:
        assert given.fx is not None
        assert given.fy is not None
        camera = Pinhole(given.width, given.height, given.fx, given.fy, given.width / 2, given.height / 2)
    cx = camera.cx if given.cx is None else given.cx
    cy = camera.cy if given.cy is None else given.cy
    return replace(camera, cx=cx, cy=cy)


def nominal_view(sensor: CameraSensor, height_m: float, cell_m: float) -> FieldOfView:
    """The field of view that the planner plans with: level, at the height of the search, over flat ground.

    Evidence is one look per cell and pass, so of the rows that a straight flight shows one after another, each column
    keeps only its best: planning with all of them would count the same pass as many looks.

    Raises:
        ValueError: no cell of that size is in view well enough to count.
    """
    frame = GridFrame(0.0, 0.0, 0.0, cell_m, 1, 1, -0.5 * cell_m, 0.5 * cell_m)
    middle = FramePose(0.0, 0.0, height_m, 0.0, 0.0)
    there = replace(sensor, frame=frame, ground=Flat())
    looks = look_at_cells(
        there.sight(middle), there.ground, frame, sensor.detect,
        max_range_m=sensor.max_range_m, min_grazing_deg=sensor.min_grazing_deg, bounded=False,
    )  # fmt: skip
    counts = (looks.covered >= sensor.min_covered) & (looks.p_tp >= sensor.detect.floor)
    if not counts.any():
        raise ValueError(f"no cell of {cell_m:g} m is in view from {height_m:g} m well enough to count")
    best: dict[int, int] = {}
    for i in np.flatnonzero(counts):
        col = int(looks.cells[i, 1])
        if col not in best or looks.p_tp[i] > looks.p_tp[best[col]]:
            best[col] = int(i)
    chosen: NDArray[np.int64] = np.array(sorted(best.values()), dtype=np.int64)
    reach = int(np.abs(looks.cells[chosen]).max())
    mask = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.bool_)
    p_tp, p_tn = np.full(mask.shape, sensor.detect.p_tp), np.full(mask.shape, sensor.p_tn)
    rows, cols = (looks.cells[chosen] + reach).T
    mask[rows, cols] = True
    p_tp[rows, cols] = looks.p_tp[chosen]
    p_tn[rows, cols] = 1.0 - looks.covered[chosen] * (1.0 - sensor.p_tn)
    return FieldOfView.from_mask(mask, p_tp, p_tn)
