"""The first minutes and the way home from the side: the ground, and the flight above it."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from service.area import way_home
from service.ground.route import SideView, from_the_side, route_over
from service.ground.words import of_the_ground
from service.places import written
from service.preview.pace import farthest_from_launch
from service.preview.preview import FIRST_S, Preview


@dataclass(frozen=True, eq=False)
class Sides:
    """The profiles of the first minutes, from the launch point on, and of the longest way home."""

    first: SideView
    home: SideView


def sides_of(seen: Preview) -> Sides | None:
    """The profiles; None where the ground is taken as flat."""
    grid, relief, flight = seen.grid, seen.grid.relief, seen.settings.flight
    if relief is None:
        return None
    count = max(1, int(np.searchsorted(seen.path.seconds, FIRST_S)))
    cells = grid.frame.to_latlon(np.array(seen.path.cells[:count]))
    first = [grid.launch, *((float(lat), float(lon)) for lat, lon in cells)]
    far = farthest_from_launch(grid)
    ways = [first, [far, *way_home(grid, far, grid.launch)]]
    flown = [from_the_side(grid, relief, route_over(grid, relief, flight, way)) for way in ways]
    return Sides(*flown)


def height_facts(seen: Preview) -> list[tuple[str, str]]:
    """What to say of ground and clearance."""
    said = [("ground", of_the_ground(seen.grid, seen.settings))]
    sides = sides_of(seen)
    if sides is None:
        return said
    for name, flown in ((f"the first {FIRST_S / 60:.0f} minutes", sides.first), ("the way home", sides.home)):
        clear, along = flown.least
        high = float(np.nanmax(flown.flight - flown.ground))
        said.append(
            (
                "clearance",
                f"{name}: {clear:.0f} m at the least, after {along:.0f} m; {high:.0f} m above ground at the most",
            )
        )
    return said


def cover_facts(seen: Preview) -> list[tuple[str, str]]:
    """What cover leaves to be found from the air."""
    visibility = seen.grid.visibility
    if visibility is None:
        return []
    mass = seen.grid.prior * (1.0 - seen.grid.outside)
    once = float((mass * visibility)[seen.grid.flyable].sum()) * seen.settings.sensor.p_tp
    worst = np.unravel_index(int(np.argmax(mass * (1.0 - visibility))), mass.shape)
    lat, lon = seen.grid.frame.to_latlon([worst])[0]
    place = written((float(lat), float(lon)), seen.settings.run.coordinates)
    return [("cover", f"one look at every cell finds {once:.0%}; the most is hidden at {place}")]


def draw_sides(seen: Preview) -> bytes | None:
    """Both profiles as a PNG; None where the ground is taken as flat."""
    sides = sides_of(seen)
    if sides is None:
        return None
    figure = Figure(figsize=(10.0, 5.6), dpi=110, layout="constrained")
    for axes, name, flown in zip(
        figure.subplots(2, 1),
        (f"first {FIRST_S / 60:.0f} min", "way home"),
        (sides.first, sides.home),
        strict=True,
    ):
        axes.fill_between(
            flown.along, flown.ground, np.nanmin(flown.ground) - 5.0, color="tab:brown", alpha=0.35
        )
        axes.plot(flown.along, flown.roof, color="tab:brown", lw=0.8, label="highest ground within reach")
        axes.plot(flown.along, flown.flight, color="tab:blue", lw=1.5, label="flight")
        clear, along = flown.least
        axes.axvline(along, color="tab:red", lw=0.9, ls="--", label=f"least clearance, {clear:.0f} m")
        axes.set(ylabel="m above launch", title=name, xlim=(0.0, float(flown.along[-1])))
        axes.legend(frameon=False, fontsize=8, loc="best")
    figure.supxlabel("metres flown")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()
