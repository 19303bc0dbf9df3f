"""The sensor profiles of the paper: a mask of cells around the aircraft, the same wherever it is.

A frame shows the cells of the mask around the aircraft at the moment of capture. It counts as a look only when the
aircraft was well enough centred on its cell for the footprint to cover the cells (`covered`), and about as high as the
search is flown. A detection lies in a cell in view or beside one, or its report is refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from roisearch import FieldOfView
from service.area.frame import GridFrame
from service.camera.locate import Spot, spread_hits
from service.camera.optics import Floats
from service.evidence.calibration import Calibration
from service.evidence.observe import Footprint, FramePose, Reading, Sighting, Unreadable, grid_heading
from service.evidence.plausible import SIGMAS, check_place, ground_metres
from service.evidence.reports import Report
from service.evidence.targets import not_the_target, only_targets
from service.geometry import Cell
from service.ground.relief import Relief

LOWEST, HIGHEST = 0.7, 1.5  # times the height of the search: from elsewhere a look is worth something else
_ON_THE_PLANE_M = 50_000.0  # farther off the grid's plane is not the ground any more
BESIDE = "a detection lies beside the cells in view, so the frame says nothing about these"


def looks_count(above_m: float, height_m: float) -> bool:
    """Whether looks count from so far above the ground, where the search is flown at `height_m`; not where unknown."""
    return LOWEST * height_m <= above_m <= HIGHEST * height_m


@dataclass
class Sensor:
    """A mask on this grid: which cells a pose shows, and what a report says about them.

    `overlap` is how much wider than a cell the footprint is (0.2: a fifth), so how far off the cell's centre
    the aircraft may be and still see all of it. `sigma_m` is the standard deviation, in each direction, of a detection
    that tells no accuracy; None: not known. `classes` of detections are the target; none named: all. `height_m` is
    above the ground, which is `relief`; None: flat.
    """

    frame: GridFrame
    fov: FieldOfView
    p_tp: float
    p_tn: float
    overlap: float
    min_covered: float
    height_m: float
    calibration: Calibration | None = None
    sigma_m: float | None = None
    classes: frozenset[str] = frozenset()
    relief: Relief | None = None

    def read(self, pose: FramePose, report: Report) -> Reading:
        """The evidence in a report of a frame taken from `pose`.

        Raises:
            Unreadable: the report says what this profile cannot interpret, or what its frame cannot show.
        """
        if report.footprint is not None or report.gimbal is not None:
            given = "footprint" if report.footprint is not None else "gimbal"
            raise Unreadable(f"the sensor profile fixes what a frame shows: it has no use for a {given}")
        report, ignored = only_targets(report, self.classes)
        if any(detection.box is not None for detection in report.detections):
            raise Unreadable(
                "the sensor profile cannot place a pixel box; give the lat and lon of each detection"
            )
        self._check(pose, report)
        footprint = self.footprint(pose)
        if (
            self.calibration is not None
            and (looks := self.calibration.at(report.threshold_share)) is not None
        ):
            k = len(footprint.cells)
            footprint = replace(footprint, p_tp=np.full(k, looks[0]), p_tn=np.full(k, looks[1]))
        hits, all_placed = self._hits(report, footprint)
        if not all_placed and footprint.counts.any():
            footprint = footprint.in_vain(BESIDE)
        note = not_the_target(ignored, self.classes) if ignored else ""
        return Reading(footprint, hits, self._sightings(report, hits), note)

    def footprint(self, pose: FramePose) -> Footprint:
        """The cells in view from `pose`; none when it is too low or high, off the grid or far between cells."""
        if why_not := self._wrong_height(pose.height_m - self._ground_m(pose)):
            return self._nothing(why_not)
        south, east = self._cells_from_corner(pose)
        rows, cols = self.frame.shape
        if not (0.0 <= south < rows and 0.0 <= east < cols):
            return self._nothing("the aircraft was not over the grid")
        cell: Cell = (math.floor(south), math.floor(east))
        spare = 0.5 * self.overlap / (1.0 - self.overlap)
        off = (abs(south - cell[0] - 0.5), abs(east - cell[1] - 0.5))
        covered = math.prod(1.0 - min(max(along - spare, 0.0), 1.0) for along in off)
        between = f"the aircraft was between cells: {covered:.0%} of each in view, {self.min_covered:.0%} make a look"
        if covered < 0.5 * self.min_covered:
            return self._nothing(between)
        cells = self._in_view(cell, pose.heading_deg)
        if not len(cells):
            return self._nothing(
                "no cell of the grid was in view"
                if math.isfinite(pose.heading_deg)
                else "where the nose pointed is not known, and this sensor looks ahead"
            )
        counts = covered >= self.min_covered
        return self._alike(cells, covered, "" if counts else between)

    # ---- what is in view

    def _cells_from_corner(self, pose: FramePose) -> tuple[float, float]:
        """Rows and columns from the grid's corner, with fractions."""
        east, south = (self.frame.to_metres([[pose.lat, pose.lon]])[0] / self.frame.cell_m).tolist()
        return south, east

    def _ground_m(self, pose: FramePose) -> float:
        """The ground below, above that at the launch point; NaN: not known."""
        if self.relief is None:
            return 0.0
        return float(self.relief.height_at(self.frame.to_metres([[pose.lat, pose.lon]]))[0])

    def _wrong_height(self, height_m: float) -> str:
        if looks_count(height_m, self.height_m):
            return ""
        if not math.isfinite(height_m):
            return "the aircraft's height above the ground is not known"
        low, high = LOWEST * self.height_m, HIGHEST * self.height_m
        if height_m < low:
            return f"the aircraft was {low - height_m:.0f} m too low at {height_m:.0f} m; looks count from {low:.0f} m"
        return f"the aircraft was {height_m - high:.0f} m too high at {height_m:.0f} m; looks count to {high:.0f} m"

    def _in_view(self, cell: Cell, heading_deg: float) -> NDArray[np.int64]:
        """The mask's cells on the grid; where the heading is not known, those that every heading shows."""
        if math.isfinite(heading_deg):
            return self.fov.cells(cell, grid_heading(heading_deg, self.frame.bearing_deg), self.frame.shape)
        north, *others = (set(map(tuple, turned.tolist())) for turned in self.fov.offsets)
        always = np.array(sorted(north.intersection(*others)), dtype=np.int64).reshape(-1, 2) + np.array(cell)
        inside = ((always >= 0) & (always < np.array(self.frame.shape))).all(axis=1)
        return np.asarray(always[inside], dtype=np.int64)

    def _nothing(self, why_not: str) -> Footprint:
        return self._alike(np.empty((0, 2), dtype=np.int64), 0.0, why_not)

    def _alike(self, cells: NDArray[np.int64], covered: float, why_not: str) -> Footprint:
        counts = covered >= self.min_covered
        return Footprint.alike(
            cells, covered=covered, counts=counts, p_tp=self.p_tp, p_tn=self.p_tn, why_not=why_not
        )

    # ---- detections

    def _check(self, pose: FramePose, report: Report) -> None:
        """Refuse detections that no heading and no place between cells explains."""
        south, east = self._cells_from_corner(pose)
        spare = 0.5 * self.overlap / (1.0 - self.overlap)
        reach = (float(np.abs(self.fov.offsets).max()) + 0.5 + spare) * self.frame.cell_m

        def gap(lat: float, lon: float) -> float:
            metres = ground_metres(pose.lat, pose.lon, lat, lon)
            if metres > _ON_THE_PLANE_M:
                return metres - reach
            x, y = self.frame.to_metres([[lat, lon]])[0].tolist()
            off = (x - east * self.frame.cell_m, y - south * self.frame.cell_m)
            return math.hypot(*(max(abs(along) - reach, 0.0) for along in off))

        for seen in report.detections:
            check_place(seen, gap, self.frame.cell_m + SIGMAS * (seen.accuracy_m or self.sigma_m or 0.0))

    def _hits(self, report: Report, footprint: Footprint) -> tuple[dict[Cell, float], bool]:
        """The cells of the footprint that a detection lies in, or next to (its position is not exact); one with a
        known accuracy is spread over all that it may lie in. And whether every detection is the hit of some cell."""
        if not report.detections or not len(footprint.cells):
            return {}, not report.detections
        points = self.frame.to_metres(np.array([[seen.lat, seen.lon] for seen in report.detections]))
        sure = [
            (self._spot(point, seen.accuracy_m, footprint), seen)
            for point, seen in zip(points, report.detections, strict=True)
            if seen.accuracy_m is not None
        ]
        hits, on_it = spread_hits(
            [(spot, self._ratio(report.share(seen.score))) for spot, seen in sure],
            footprint.cells, footprint.p_tp, footprint.p_tn, self.frame.cell_m,
        )  # fmt: skip
        placed = len(on_it)
        cells, _ = self.frame.locate(np.array([[seen.lat, seen.lon] for seen in report.detections]))
        for cell, seen in zip(cells, report.detections, strict=True):
            if seen.accuracy_m is not None:
                continue
            gap = np.abs(footprint.cells - cell).max(axis=1)
            nearest = int(gap.argmin())
            if gap[nearest] <= 1:
                placed += 1
                row, col = (int(index) for index in footprint.cells[nearest])
                hits[row, col] = max(self._ratio(report.share(seen.score)), hits.get((row, col), 0.0))
        return hits, placed == len(report.detections)

    def _spot(self, point: Floats, accuracy_m: float, footprint: Footprint) -> Spot:
        """Where a detection with an accuracy is. It lies in what the frame shows, so an accuracy that is worse than
        that is long says no more than that it lies there."""
        long = (np.ptp(footprint.cells, axis=0).max() + 1.0) * self.frame.cell_m
        return Spot(point, np.eye(2) * min(accuracy_m, float(long)) ** 2)

    def _sightings(self, report: Report, hits: Mapping[Cell, float]) -> tuple[Sighting, ...]:
        """The detections of a report that lie in the cells of `hits` or beside them."""
        found = []
        for seen in report.detections if hits else ():
            if seen.lat is None or seen.lon is None:
                continue
            row, col = self.frame.to_cells([[seen.lat, seen.lon]])[0].tolist()
            if any((row + r, col + c) in hits for r in (-1, 0, 1) for c in (-1, 0, 1)):
                sigma = seen.accuracy_m or self.sigma_m
                square = None if sigma is None else (sigma**2, 0.0, sigma**2)
                score = None if seen.score is None else report.share(seen.score)
                found.append(Sighting(seen.lat, seen.lon, square, report.picture_of(seen), score))
        return tuple(found)

    def _ratio(self, score: float) -> float:
        """What a hit with this score is worth."""
        return self.p_tp / (1.0 - self.p_tn) if self.calibration is None else self.calibration.ratio(score)
