"""A map sheet for reports: true north up, in the page's colours, with a coordinate grid, names, scale and north mark.

A sheet is drawn in metres east and north of the point where the grid's plane touches the earth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.patheffects import withStroke
from numpy.typing import ArrayLike, NDArray

from service.area import Grid, SearchArea
from service.geometry import LatLon
from service.view.names import place_names

HEAT = LinearSegmentedColormap.from_list(
    "heat", ["#fff7bc", "#fed976", "#fda03c", "#f0541e", "#bd1128", "#620842"]
)
LOOKED = LinearSegmentedColormap.from_list("looked", ["#f7f7f2", "#005c6e"])
INK, SOFT, GROUND, TRACK = "#0d1620", "#46525f", "#f7f7f2", "#0b4aa2"
"""The page's: `service/page/cells.js` and `style.css`."""
_HALO = [withStroke(linewidth=2.2, foreground="white")]
_MARGIN = 0.06
_MOST_NAMES, _LONGEST_NAME = 30, 24
_DECADES = 3.0
_MOST_DECADES = 8.0


class Sheet:
    """Axes that a map is drawn on."""

    def __init__(self, axes: Axes, grid: Grid, area: SearchArea | None = None) -> None:
        """`area` brings names; without it the sheet has none."""
        self.axes, self.grid, self.area = axes, grid, area
        self._said: list[str] = []
        corners = self.at([*grid.frame.corners().tolist(), grid.launch])
        low, high = corners.min(axis=0), corners.max(axis=0)
        room = _MARGIN * float((high - low).max())
        self.low, self.high = low - room, high + room
        axes.set(xlim=(self.low[0], self.high[0]), ylim=(self.low[1], self.high[1]), facecolor=GROUND)
        axes.set_aspect("equal")

    def at(self, places: Sequence[LatLon] | ArrayLike) -> NDArray[np.float64]:
        """Places (lat, lon) [k, 2] as metres [k, 2] east and north."""
        return np.asarray(
            self.grid.frame.projection.forward(np.asarray(places, dtype=np.float64).reshape(-1, 2))
        )

    def of_cells(self, corners: ArrayLike) -> NDArray[np.float64]:
        """Corners of cells, (row, col) [k, 2] counted in cells from the grid's north-west, as metres east and north."""
        frame = self.grid.frame
        points = np.asarray(corners, dtype=np.float64).reshape(-1, 2) * frame.cell_m
        east, north = points[:, 1] + frame.west_m, frame.north_m - points[:, 0]
        turn = math.radians(frame.bearing_deg)
        sin, cos = math.sin(turn), math.cos(turn)
        return np.stack([east * cos + north * sin, north * cos - east * sin], axis=1)

    def cells(self, values: NDArray[np.float64], **style: Any) -> Any:
        """Values of cells, [rows, cols], as colours; nothing where they are not a number."""
        rows, cols = self.grid.frame.shape
        corners = np.indices((rows + 1, cols + 1)).reshape(2, -1).T
        plane = self.of_cells(corners).reshape(rows + 1, cols + 1, 2)
        return self.axes.pcolormesh(
            plane[..., 0], plane[..., 1], np.ma.masked_invalid(values), rasterized=True, **style
        )

    def regions(self, labels: NDArray[np.integer], names: Sequence[str] = ()) -> None:
        """The border of each region of interest, int [rows, cols] with 0 for none, and its name, or else its number.

        `names` has that of region 1 first.
        """
        padded = np.pad(labels, 1)
        borders = []
        for row, col in np.argwhere(padded[1:, 1:-1] != padded[:-1, 1:-1]):
            borders.append(self.of_cells([(row, col), (row, col + 1)]))
        for row, col in np.argwhere(padded[1:-1, 1:] != padded[1:-1, :-1]):
            borders.append(self.of_cells([(row, col), (row + 1, col)]))
        self.axes.add_collection(LineCollection(borders, colors=INK, linewidths=0.7, alpha=0.7))
        for label in np.unique(labels[labels > 0]):  # some may be spent
            middle = np.argwhere(labels == label).mean(axis=0) + 0.5
            text = names[label - 1] if label <= len(names) else f"ROI {label}"
            self.name(text, self.of_cells(middle)[0])
            self._said.append(text)

    def line(self, places: Sequence[LatLon], style: str, **options: Any) -> None:
        """Places joined by a line, or marks at them; legible over any colour."""
        if len(places):
            self.axes.plot(*self.at(places).T, style, path_effects=_HALO, **options)

    def name(self, text: str, at: NDArray[np.float64], **options: Any) -> None:
        """A name, legible over any colour."""
        style = {"ha": "center", "va": "center", "fontsize": 7, "color": INK, **options}
        self.axes.text(at[0], at[1], text, path_effects=_HALO, clip_on=True, **style)

    def finish(self) -> None:
        """What makes it a map: the area with its names, coordinates, scale and north."""
        if self.area is not None:
            self._outlines(self.area)
        self.line([self.grid.launch], "^", color="white", mec=TRACK, mew=1.5, ms=8, label="launch")
        self._coordinates()
        self._scale()
        self.axes.annotate(
            "N", xy=(0.95, 0.985), xytext=(0.95, 0.885), xycoords="axes fraction", ha="center", va="center",
            fontsize=10, weight="bold", color=INK, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.6},
            path_effects=_HALO,
        )  # fmt: skip

    def _outlines(self, area: SearchArea) -> None:
        self._outline(area.polygon, color=INK, lw=1.4)
        for each in area.exclusions:
            self._outline(each.polygon, color="#b00020", lw=1.0, ls="--")
        below = np.array([0.0, 0.02 * (self.high[1] - self.low[1])])
        for place_name in [one for one in place_names(area) if one["role"] != "cover"][:_MOST_NAMES]:
            if not any(said.startswith(place_name["name"]) for said in self._said):
                place = self.at([(place_name["lat"], place_name["lon"])])[0]
                self.name(place_name["name"][:_LONGEST_NAME], place - below, style="italic")

    def _outline(self, shape: shapely.Geometry, **style: Any) -> None:
        for part in shapely.get_parts(shape):
            for ring in (part.exterior, *part.interiors):
                lonlat = np.asarray(ring.coords)[:, :2]
                self.axes.plot(*self.at(lonlat[:, ::-1]).T, **style)

    def _coordinates(self) -> None:
        """Parallels and meridians at round degrees."""
        frame = self.grid.frame
        inverse = frame.projection.inverse
        (south, west), (north, east) = inverse(self.low[None])[0], inverse(self.high[None])[0]
        step = _round_step(max(north - south, (east - west) * math.cos(math.radians(frame.lat))) / 3.0)
        digits = max(0, -math.floor(math.log10(step) + 1e-9))
        lats, lons = _between(south, north, step), _between(west, east, step)
        middle_lat, middle_lon = (south + north) / 2.0, (west + east) / 2.0
        self.axes.set_yticks(
            [self.at([(lat, middle_lon)])[0, 1] for lat in lats], [f"{v:.{digits}f}°" for v in lats]
        )
        self.axes.set_xticks(
            [self.at([(middle_lat, lon)])[0, 0] for lon in lons], [f"{v:.{digits}f}°" for v in lons]
        )
        self.axes.tick_params(labelsize=7, colors=SOFT, length=2)
        for label in self.axes.get_yticklabels():
            label.set(rotation=90, va="center")
        self.axes.grid(color=SOFT, alpha=0.35, lw=0.5)

    def _scale(self) -> None:
        """A bar of a round number of metres, at the foot."""
        span = float(self.high[0] - self.low[0])
        length = _round_step(span / 5.0)
        x, y = self.low + 0.04 * (self.high - self.low)
        self.axes.plot([x, x + length], [y, y], color=INK, lw=3.0, solid_capstyle="butt", path_effects=_HALO)
        text = f"{length:g} m" if length < 1000.0 else f"{length / 1000.0:g} km"
        self.name(
            text,
            np.array([x + length / 2.0, y + 0.012 * (self.high[1] - self.low[1])]),
            va="bottom",
            fontsize=8,
        )


def heat_norm(shown: NDArray[np.float64]) -> LogNorm:
    """A logarithmic scale from the peak three decades down, or as far as it takes to tell the ground apart where one
    cell holds nearly all, as after a find."""
    top = float(np.nanmax(shown))
    some = shown[np.isfinite(shown) & (shown > 0.0)]
    low = float(np.quantile(some, 0.25)) if some.size else top
    decades = min(max(math.log10(top / low) if low > 0.0 else _MOST_DECADES, _DECADES), _MOST_DECADES)
    return LogNorm(vmin=max(top / 10.0**decades, 1e-300), vmax=top)


def _round_step(least: float) -> float:
    """1, 2 or 5 times a power of ten, not below."""
    decade = 10.0 ** math.floor(math.log10(least))
    return next(each * decade for each in (1.0, 2.0, 5.0, 10.0) if each * decade >= least * 0.999)


def _between(low: float, high: float, step: float) -> list[float]:
    return [number * step for number in range(math.ceil(low / step), math.floor(high / step) + 1)]
