"""A preview as a picture, and as one HTML page around it."""

from __future__ import annotations

import base64
import html
import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from service.preview.heights import draw_sides
from service.preview.preview import FIRST_S, GOALS, Preview
from service.preview.priors import draw_priors
from service.preview.text import facts
from service.view.sheet import HEAT, TRACK, Sheet

_STYLE = (
    "body{font:16px/1.45 system-ui,sans-serif;max-width:64rem;margin:1rem auto;padding:0 1rem;overflow-wrap:anywhere}"
    "img{max-width:100%}th{text-align:left;vertical-align:top;padding-right:1rem;white-space:nowrap}"
    ".maps{display:flex;flex-wrap:wrap;gap:.5rem 1rem}.maps>*{flex:1 1 20rem;min-width:0;max-width:30rem;margin:0}"
    ".maps figure img{width:100%}figcaption{font-size:.9rem}"
)


def draw(seen: Preview) -> bytes:
    """The prior with the path of one battery, and POS over time, as a PNG."""
    return _png(figure_of(seen))


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def figure_of(seen: Preview) -> Figure:
    """The same as a figure."""
    figure = Figure(figsize=(11.0, 6.2), dpi=130, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(6.0, 4.6))
    _draw_path(left, seen)
    _draw_times(right, seen)
    handles, names = left.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower left", ncols=len(names), frameon=False, fontsize=9)
    figure.suptitle(f"{seen.area.name}: what a search will be like", fontsize=11)
    return figure


def _draw_for_a_phone(seen: Preview) -> list[bytes]:
    """The same as two PNGs of a phone's width, whose words can be read there."""
    path = Figure(figsize=(4.4, 5.0), dpi=180, layout="constrained")
    axes = path.subplots()
    _draw_path(axes, seen)
    path.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, fontsize=8
    )
    times = Figure(figsize=(4.4, 5.0), dpi=180, layout="constrained")
    _draw_times(times.subplots(), seen)
    return [_png(path), _png(times)]


def _draw_times(axes: Axes, seen: Preview) -> None:
    """POS over time, of each flight that was simulated."""
    for draw_ in seen.draws:
        minutes = (draw_.seconds + seen.before_s) / 60.0
        axes.plot(minutes, 100.0 * draw_.pos, color=TRACK, lw=1.2, alpha=0.7)
    for goal in GOALS:
        axes.axhline(100.0 * goal, color="grey", lw=0.7, ls=":")
    longest = max(float(draw_.seconds[-1]) for draw_ in seen.draws) + seen.before_s
    if seen.reachable < 0.999:  # else it is the frame, and a name in the legend would have no line
        axes.axhline(100.0 * seen.reachable, color="#b00020", lw=0.9, ls="--", label="all that can be found")
    if seen.battery_s <= longest:
        axes.axvline(seen.battery_s / 60.0, color="#8a4b00", lw=1.2, label="one battery")
    beyond = f" (one battery lasts {seen.battery_s / 60.0:.0f})" if seen.battery_s > longest else ""
    axes.set(xlim=(0, 1.02 * longest / 60.0), ylim=(0, 100), ylabel="POS, %")
    axes.set_xlabel(f"minutes since take-off{beyond}")
    axes.grid(alpha=0.25)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=9, loc="lower right")


def _draw_path(axes: Axes, seen: Preview) -> None:
    """The prior with the path of one battery, north up."""
    frame, grid = seen.grid.frame, seen.grid
    sheet = Sheet(axes, grid, seen.area)
    shown = np.where(grid.searchable, grid.prior * (1.0 - grid.outside), np.nan)
    image = sheet.cells(shown, cmap=HEAT, vmin=0.0)
    axes.figure.colorbar(image, ax=axes, orientation="horizontal", shrink=0.7, label="probability per cell")
    sheet.cells(np.where(grid.flyable, np.nan, 1.0), cmap="Greys", vmin=0.0, vmax=1.6, alpha=0.35)
    sheet.regions(seen.labels.labels)
    places = frame.to_latlon(np.array(seen.path.cells))
    within = seen.path.seconds <= seen.battery_s - seen.before_s
    first = seen.path.seconds <= FIRST_S
    sheet.line(places[within].tolist(), "-", color=TRACK, lw=1.0, alpha=0.8, label="one battery")
    sheet.line(places[first].tolist(), "-", color="#5b2a91", lw=2.0, label=f"first {FIRST_S / 60:.0f} min")
    sheet.finish()


def page(seen: Preview) -> bytes:
    """The picture and the facts as one HTML file that needs no network."""
    title = html.escape(f"Search preview: {seen.area.name}")
    rows = "\n".join(
        f'<tr><th scope="row">{html.escape(name)}</th><td>{html.escape(sentence)}</td></tr>'
        for name, sentence in facts(seen)
    )
    words = ("The prior with the planned path, north up", "The probability of success over time")
    pictures = "".join(map(_picture, _draw_for_a_phone(seen), words))
    priors = [
        f"<figure>{_picture(png, f'Map: {sentence}')}<figcaption>{html.escape(sentence)}</figcaption></figure>"
        for sentence, png in draw_priors(seen.area, seen.grid)
    ]
    added = f'<h2>How the priors add up</h2>\n<div class="maps">{"".join(priors)}</div>\n' if priors else ""
    sides = draw_sides(seen)
    if sides is not None:
        added += f"<h2>Above the ground</h2>\n<p>{_picture(sides, 'Ground and flight from the side')}</p>\n"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{title}</title><style>{_STYLE}</style>"
        f'</head>\n<body><main><h1>{title}</h1>\n<div class="maps">{pictures}</div>\n'
        f"<table><tbody>\n{rows}\n</tbody></table>\n{added}</main></body></html>\n"
    ).encode()


def _picture(png: bytes, words: str) -> str:
    data = base64.b64encode(png).decode("ascii")
    return f'<img alt="{html.escape(words, quote=True)}" src="data:image/png;base64,{data}">'
