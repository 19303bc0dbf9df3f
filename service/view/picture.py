"""The picture of a search: what is left of the probability, what was looked at, where the aircraft flew.

True north is up; see `service.view.sheet`."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from service.area import Grid, SearchArea
from service.geometry import LatLon
from service.view.sheet import HEAT, LOOKED, TRACK, Sheet, heat_norm


@dataclass(frozen=True)
class PictureScene:
    """What a picture shows. Arrays are [rows, cols]; positions are (lat, lon)."""

    grid: Grid
    probability: NDArray[np.float64]
    pod: NDArray[np.float64]
    labels: NDArray[np.integer[Any]]
    tracks: Sequence[Sequence[LatLon]]
    ahead: Sequence[LatLon]
    hits: Sequence[LatLon]
    aircraft: LatLon | None
    found: LatLon | None
    title: str
    subtitle: str
    area: SearchArea | None = None
    names: Sequence[str] = ()
    """Of the regions, region 1 first."""


def draw_scene(scene: PictureScene) -> bytes:
    """The scene as a PNG: the belief on the left, the cumulative probability of detection on the right."""
    figure = Figure(figsize=(10.4, 6.2), dpi=130, layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_belief(left, scene)
    draw_pod(right, scene)
    handles, names = left.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False, fontsize=9)
    figure.suptitle(f"{scene.title}\n{scene.subtitle}", fontsize=11)
    return _png(figure)


def draw_one(scene: PictureScene, draw: Callable[[Axes, PictureScene], None]) -> bytes:
    """One of the two maps as a PNG of a phone's width, whose words can be read there."""
    figure = Figure(figsize=(4.4, 5.0), dpi=180, layout="constrained")
    axes = figure.subplots()
    draw(axes, scene)
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return _png(figure)


def draw_belief(axes: Axes, scene: PictureScene) -> None:
    """Where the target may be now."""
    sheet = Sheet(axes, scene.grid, scene.area)
    shown = np.where(scene.grid.searchable, scene.probability, np.nan)
    norm = heat_norm(shown)
    image = sheet.cells(np.maximum(shown, norm.vmin or 0.0), cmap=HEAT, norm=norm)
    _bar(axes, image, "probability per cell")
    axes.set_title("where the target may be now", fontsize=10)
    _finish(sheet, scene)


def draw_pod(axes: Axes, scene: PictureScene) -> None:
    """How well it has been searched."""
    sheet = Sheet(axes, scene.grid, scene.area)
    shown = np.where(scene.grid.searchable, scene.pod, np.nan)
    image = sheet.cells(shown, cmap=LOOKED, vmin=0.0, vmax=1.0)
    _bar(axes, image, "probability of detection so far")
    axes.set_title("how well it has been searched", fontsize=10)
    _finish(sheet, scene)


def _bar(axes: Axes, image: Any, label: str) -> None:
    bar = axes.figure.colorbar(image, ax=axes, orientation="horizontal", shrink=0.8, pad=0.02, aspect=30)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=8)


def _finish(sheet: Sheet, scene: PictureScene) -> None:
    """Regions, tracks, hits, aircraft, the place found, and what every map has."""
    blocked = np.where(scene.grid.flyable, np.nan, 1.0)
    sheet.cells(blocked, cmap="Greys", vmin=0.0, vmax=1.6, alpha=0.35)
    sheet.regions(scene.labels, scene.names)
    for number, track in enumerate(each for each in scene.tracks if each):
        sheet.line(track, "-", color=TRACK, lw=0.9, alpha=0.8, label="" if number else "track")
    sheet.line(scene.ahead, "--", color="#5b2a91", lw=1.4, label="decided")
    sheet.line(scene.hits, "x", color="#b00020", ms=6, mew=1.6, label="hits")
    if scene.aircraft is not None:
        sheet.line([scene.aircraft], "o", color="#ff7a1a", mec="black", ms=8, label="aircraft")
    if scene.found is not None:
        sheet.line([scene.found], "*", color="#ffe14d", mec="black", ms=16, label="found here")
    sheet.finish()


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
