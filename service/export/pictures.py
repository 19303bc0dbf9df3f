"""The pictures of the report: the map as it stands, what is left to search, and POS over time."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from service.export.gaps import Gap, gap_cells
from service.export.run import Run
from service.export.wishes import Wishes
from service.view.picture import Scene, draw_scene

WELL = 0.8
"""From this POD on, ground is drawn as well searched."""

COLOURS = ("#d9d9d9", "#d7301f", "#fdbb84", "#2b8cbe")
NAMES = ("little probability, little searched", "gap: fly again", "searched once or badly", "searched well")


def draw_map(run: Run) -> bytes:
    """Belief and POD with track and find, as the run's own map.png, as a PNG."""
    here, find = run.aircraft, run.find
    return draw_scene(
        Scene(
            grid=run.grid,
            probability=run.poa,
            pod=run.pod,
            labels=run.labels,
            track=[(fix.lat, fix.lon) for piece in run.track for fix in piece],
            ahead=[],
            hits=run.hits,
            aircraft=(here.lat, here.lon) if here and not run.over else None,
            found=(find.lat, find.lon) if find else None,
            title=run.area.name,
            subtitle=f"POS {run.pos:.0%} after {run.looks} looks",
        )
    )


def draw_gaps(run: Run, gaps: Sequence[Gap], wishes: Wishes) -> bytes:
    """The ground in four classes, with the numbers of the gaps, as a PNG."""
    grid, frame = run.grid, run.frame
    width, height = frame.cols * frame.cell_m, frame.rows * frame.cell_m
    classes = np.where(run.pod >= WELL, 3.0, np.where(run.pod >= wishes.pod_below, 2.0, 0.0))
    classes = np.where(gap_cells(run, wishes), 1.0, classes)
    scale = min(6.4 / width, 5.2 / height)
    figure = Figure(
        figsize=(max(width * scale, 4.0) + 1.0, height * scale + 1.4), dpi=110, layout="constrained"
    )
    axes = figure.subplots()
    axes.imshow(
        np.where(grid.searchable, classes, np.nan),
        extent=(0.0, width, height, 0.0),
        cmap=ListedColormap(COLOURS),
        vmin=-0.5,
        vmax=3.5,
    )
    for number, gap in enumerate(gaps, 1):
        east, south = frame.to_metres([gap.middle])[0]
        axes.text(
            east, south, str(number), ha="center", va="center", fontsize=9, weight="bold", color="white"
        )
    launch = frame.to_metres([grid.launch])[0]
    axes.plot(*launch, "^", color="black", ms=9)
    axes.annotate(" launch", launch, fontsize=8)
    axes.set_xlabel(f"metres, grid turned to {frame.bearing_deg:.0f}° true")
    axes.set_aspect("equal")
    patches = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, NAMES, strict=True)]
    figure.legend(handles=patches, loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return png(figure)


def draw_curve(run: Run) -> bytes:
    """POS over the minutes of the run, as a PNG."""
    figure = Figure(figsize=(7.0, 2.6), dpi=110, layout="constrained")
    axes = figure.subplots()
    minutes, percent = [seconds / 60.0 for seconds, _ in run.curve], [100.0 * pos for _, pos in run.curve]
    axes.step(minutes, percent, where="post", color="#2b8cbe")
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
