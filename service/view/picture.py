"""The picture of a search: what is left of the probability, what was looked at, where the aircraft flew."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from service.area import Grid
from service.area.frame import GridFrame

LatLon = tuple[float, float]


@dataclass(frozen=True)
class Scene:
    """What a picture shows. Arrays are [rows, cols]; positions are (lat, lon)."""

    grid: Grid
    probability: NDArray[np.float64]
    pod: NDArray[np.float64]
    labels: NDArray[np.integer[Any]]
    track: Sequence[LatLon]
    ahead: Sequence[LatLon]
    hits: Sequence[LatLon]
    aircraft: LatLon | None
    found: LatLon | None
    title: str
    subtitle: str


def draw_scene(scene: Scene) -> bytes:
    """The scene as a PNG: the belief on the left, the cumulative probability of detection on the right."""
    grid, frame = scene.grid, scene.grid.frame
    rows, cols = frame.shape
    width, height = cols * frame.cell_m, rows * frame.cell_m
    scale = min(6.4 / width, 6.4 / height)  # inches a metre
    size = (2 * max(width * scale, 3.6) + 2.2, height * scale + 1.5)
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    extent = (0.0, width, height, 0.0)
    shown = np.where(grid.searchable, scene.probability, np.nan)
    top = float(np.nanmax(shown))
    bottom = max(top * 1e-3, 1e-9)
    norm = LogNorm(vmin=bottom, vmax=top)
    image = left.imshow(np.maximum(shown, bottom), extent=extent, cmap="viridis", norm=norm)
    figure.colorbar(image, ax=left, shrink=0.8, label="probability per cell")
    left.set_title("where the target may be now", fontsize=10)
    pod = right.imshow(
        np.where(grid.searchable, scene.pod, np.nan), extent=extent, cmap="YlGn", vmin=0.0, vmax=1.0
    )
    figure.colorbar(pod, ax=right, shrink=0.8, label="probability of detection so far")
    right.set_title("how well it has been searched", fontsize=10)
    for axes, line in ((left, "white"), (right, "black")):
        outline_regions(axes, frame, scene.labels, line)
        _paths(axes, scene, line)
        blocked = np.where(grid.flyable, np.nan, 1.0)
        axes.imshow(blocked, extent=extent, cmap="Greys", vmin=0.0, vmax=1.6, alpha=0.35)
        axes.set_xlabel(f"metres, grid turned to {frame.bearing_deg:.0f}° true")
        axes.set_aspect("equal")
    left.set_ylabel("metres")
    handles, names = left.get_legend_handles_labels()
    if handles:
        figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=9)
    figure.suptitle(f"{scene.title}\n{scene.subtitle}", fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def outline_regions(axes: Axes, frame: GridFrame, regions: NDArray[np.integer[Any]], colour: str) -> None:
    """The border of each region of interest (int [rows, cols], 0 for none) in metres of the grid, with its number."""
    cell = frame.cell_m
    labels = np.pad(regions, 1)
    segments = []
    for row, col in np.argwhere(labels[1:, 1:-1] != labels[:-1, 1:-1]):  # between row - 1 and row
        segments.append(((col * cell, row * cell), ((col + 1) * cell, row * cell)))
    for row, col in np.argwhere(labels[1:-1, 1:] != labels[1:-1, :-1]):
        segments.append(((col * cell, row * cell), (col * cell, (row + 1) * cell)))
    axes.add_collection(LineCollection(segments, colors=colour, linewidths=0.8, alpha=0.8))
    for label in range(1, int(regions.max()) + 1):
        row, col = (np.argwhere(regions == label).mean(axis=0) + 0.5) * cell
        axes.text(col, row, str(label), color=colour, fontsize=8, ha="center", va="center")


def _paths(axes: Axes, scene: Scene, colour: str) -> None:
    """Track, hits, launch, aircraft and the place found."""

    def plot(points: Sequence[LatLon], style: str, **options: Any) -> None:
        if points:
            metres = scene.grid.frame.to_metres(np.array(points, dtype=np.float64))
            axes.plot(metres[:, 0], metres[:, 1], style, **options)

    plot(scene.track, "-", color="tab:orange", lw=1.0, alpha=0.9, label="track")
    plot(scene.ahead, "--", color="tab:red", lw=1.2, label="decided")
    plot(scene.hits, "x", color="tab:red", ms=6, mew=1.5, label="hits")
    plot([scene.grid.launch], "^", color=colour, mec="tab:blue", ms=9, label="launch")
    plot(
        [scene.aircraft] if scene.aircraft else [],
        "o",
        color="tab:orange",
        mec="black",
        ms=8,
        label="aircraft",
    )
    plot([scene.found] if scene.found else [], "*", color="yellow", mec="black", ms=17, label="found here")
