"""A preview as a picture, and as one HTML page around it."""

from __future__ import annotations

import base64
import html
import io

import numpy as np
from matplotlib.figure import Figure

from service.preview.preview import FIRST_S, GOALS, Preview
from service.preview.text import facts
from service.view.picture import outline_regions


def draw(seen: Preview) -> bytes:
    """The prior with the path of one battery, and POS over time, as a PNG."""
    frame, grid = seen.grid.frame, seen.grid
    width, height = frame.cols * frame.cell_m, frame.rows * frame.cell_m
    scale = min(6.0 / width, 5.6 / height)
    figure = Figure(
        figsize=(max(width * scale, 3.6) + 6.2, max(height * scale, 3.4) + 1.4), dpi=110, layout="constrained"
    )
    left, right = figure.subplots(1, 2, width_ratios=(max(width * scale, 3.6) + 1.2, 4.6))
    shown = np.where(grid.searchable, grid.prior * (1.0 - grid.outside), np.nan)
    extent = (0.0, width, height, 0.0)
    image = left.imshow(shown, extent=extent, cmap="viridis", vmin=0.0)
    figure.colorbar(image, ax=left, shrink=0.7, label="probability per cell")
    blocked = np.where(grid.flyable, np.nan, 1.0)
    left.imshow(blocked, extent=extent, cmap="Greys", vmin=0.0, vmax=1.6, alpha=0.35)
    outline_regions(left, frame, seen.labels.labels, "white")
    cells = (np.array(seen.path.cells)[:, ::-1] + 0.5) * frame.cell_m
    within = seen.path.seconds <= seen.battery_s - seen.before_s
    first = seen.path.seconds <= FIRST_S
    left.plot(*cells[within].T, "-", color="tab:orange", lw=1.0, alpha=0.8, label="one battery")
    left.plot(*cells[first].T, "-", color="tab:red", lw=2.0, label=f"first {FIRST_S / 60:.0f} min")
    left.plot(*frame.to_metres([grid.launch])[0], "^", color="white", mec="tab:blue", ms=9, label="launch")
    left.set_xlabel(f"metres, grid turned to {frame.bearing_deg:.0f}° true")
    left.set_aspect("equal")
    for draw_ in seen.draws:
        minutes = (draw_.seconds + seen.before_s) / 60.0
        right.plot(minutes, 100.0 * draw_.pos, color="tab:blue", lw=1.2, alpha=0.7)
    for goal in GOALS:
        right.axhline(100.0 * goal, color="grey", lw=0.7, ls=":")
    right.axhline(100.0 * seen.reachable, color="tab:red", lw=0.9, ls="--", label="all that can be found")
    right.axvline(seen.battery_s / 60.0, color="tab:orange", lw=1.2, label="one battery")
    longest = max(float(draw_.seconds[-1]) for draw_ in seen.draws) + seen.before_s
    right.set(
        xlim=(0, 1.02 * longest / 60.0), ylim=(0, 100), xlabel="minutes since take-off", ylabel="POS, %"
    )
    right.grid(alpha=0.25)
    right.legend(frameon=False, fontsize=9, loc="lower right")
    handles, names = left.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower left", ncols=len(names), frameon=False, fontsize=9)
    figure.suptitle(f"{seen.area.name}: what a search will be like", fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def page(seen: Preview) -> bytes:
    """The picture and the facts as one HTML file that needs no network."""
    title = html.escape(f"Search preview: {seen.area.name}")
    rows = "\n".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(sentence)}</td></tr>'
        for name, sentence in facts(seen)
    )
    picture = base64.b64encode(draw(seen)).decode("ascii")
    style = (
        "body{font:16px/1.45 system-ui,sans-serif;max-width:64rem;margin:1rem auto;padding:0 1rem}"
        "img{max-width:100%}th{text-align:left;vertical-align:top;padding-right:1rem;white-space:nowrap}"
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title><style>{style}</style>'
        f'</head>\n<body><main><h1>{title}</h1>\n<p><img alt="The prior with the planned path, and POS over time" '
        f'src="data:image/png;base64,{picture}"></p>\n<table><tbody>\n{rows}\n</tbody></table></main></body></html>\n'
    ).encode()
