"""The pictures of the report: the map as it stands, what is left to search, and POS over time."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from service.export.gaps import Gap, gap_cells
from service.export.model import ExportedRun
from service.export.wishes import Wishes
from service.view.picture import PictureScene, draw_belief, draw_one, draw_pod
from service.view.sheet import Sheet

WELL = 0.8
"""From this POD on, ground is drawn as well searched."""

COLOURS = ("#dfe4e8", "#b00020", "#fda03c", "#005c6e")
NAMES = ("little probability, little searched", "gap: fly again", "searched once or badly", "searched well")


def draw_maps(run: ExportedRun) -> tuple[bytes, bytes]:
    """Two maps as PNGs: the belief, and how well each cell was searched."""
    here, find = run.aircraft, run.find
    scene = PictureScene(
        grid=run.grid,
        probability=run.poa,
        pod=run.pod,
        labels=run.labels,
        tracks=[[(fix.lat, fix.lon) for fix in piece] for piece in run.track],
        ahead=[],
        hits=run.hits,
        aircraft=(here.lat, here.lon) if here and not run.over else None,
        found=(find.lat, find.lon) if find else None,
        title=run.area.name,
        subtitle="",
        area=run.area,
        names=run.region_names,
    )
    return draw_one(scene, draw_belief), draw_one(scene, draw_pod)


def draw_gaps(run: ExportedRun, gaps: Sequence[Gap], wishes: Wishes) -> bytes:
    """The ground in four classes, with the numbers of the gaps, as a PNG."""
    classes = np.where(run.pod >= WELL, 3.0, np.where(run.pod >= wishes.pod_below, 2.0, 0.0))
    classes = np.where(gap_cells(run, wishes), 1.0, classes)
    figure = Figure(figsize=(4.4, 4.8), dpi=180, layout="constrained")
    axes = figure.subplots()
    sheet = Sheet(axes, run.grid, run.area)
    shown = np.where(run.grid.searchable, classes, np.nan)
    sheet.cells(shown, cmap=ListedColormap(COLOURS), vmin=-0.5, vmax=3.5)
    for number, gap in enumerate(gaps, 1):
        sheet.name(str(number), sheet.at([gap.middle])[0], fontsize=10, weight="bold")
    sheet.finish()
    patches = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, NAMES, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return png(figure)


def draw_curve(run: ExportedRun) -> bytes:
    """POS over the minutes of the run, as a PNG."""
    figure = Figure(figsize=(4.4, 2.4), dpi=180, layout="constrained")
    axes = figure.subplots()
    minutes, percent = [seconds / 60.0 for seconds, _ in run.curve], [100.0 * pos for _, pos in run.curve]
    axes.step(minutes, percent, where="post", color="#0b4aa2")
    axes.axhline(100.0 * (1.0 - run.grid.outside), ls=":", color="grey", lw=1)
    axes.set_ylim(0, 100)
    axes.set_xlim(left=0)
    axes.set_xlabel("minutes of searching")
    axes.set_ylabel("POS, %")
    axes.grid(alpha=0.3)
    return png(figure)


def png(figure: Figure) -> bytes:
    """A figure as PNG bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
