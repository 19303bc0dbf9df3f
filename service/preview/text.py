"""A preview in words: pairs of a heading and a sentence, the same for the terminal and the page."""

from __future__ import annotations

from service.preview.pace import ALLOWANCE, climb_seconds
from service.preview.preview import DRAWS, FIRST_S, Goal, Preview, first_minutes

_MOST_REGIONS = 8


def facts(seen: Preview) -> list[tuple[str, str]]:
    """Everything that is worth saying before a flight."""
    grid, settings = seen.grid, seen.settings
    rows, cols = grid.frame.shape
    hectares = float(grid.covered.sum()) * grid.frame.cell_m**2 / 1e4
    said = [
        ("area", f"{seen.area.name}: {hectares:.1f} ha to search; outside it with {grid.outside:.0%}"),
        (
            "grid",
            f"{rows} x {cols} cells of {grid.frame.cell_m:g} m, {int(grid.searchable.sum())} to search, turned to "
            f"{grid.frame.bearing_deg:.0f}° true",
        ),
        *(("note", note) for note in grid.notes),
    ]
    for region in sorted(seen.regions, key=lambda each: -each.mass)[:_MOST_REGIONS]:
        place = f"{region.peak[0]:.6f}, {region.peak[1]:.6f}"
        mass = f"{region.mass:.0%} of the probability on {region.hectares:.1f} ha, most at {place}"
        said.append((f"ROI {region.number}", mass))
    if len(seen.regions) > _MOST_REGIONS:
        said.append(("", f"and {len(seen.regions) - _MOST_REGIONS} smaller regions of interest"))
    if not seen.regions:
        said.append(("ROIs", "none: no place stands out"))
    up = f"{climb_seconds(settings.flight):.0f} s to {settings.flight.altitude_m:g} m"
    said.append(("take-off", f"{up}, first look at {_clock(seen.before_s)} (minutes:seconds from here on)"))
    steps = ", ".join(f"{_clock(seconds)} {where}" for seconds, where in first_minutes(seen))
    said.append((f"first {FIRST_S / 60:.0f} min", f"{steps} (if nothing is reported)"))
    said += [("POS " + format(goal.pos, ".0%"), _goal(goal, seen)) for goal in seen.goals]
    least, most = min(seen.pos_battery), max(seen.pos_battery)
    known = (
        "one battery"
        if seen.kept_percent is not None
        else "one flight (flight.max_flight_s; no --battery given)"
    )
    said.append(("battery", f"{known} searches until {_clock(seen.battery_s)}: POS {_span(least, most)}"))
    said.append(
        (
            "way home",
            f"at most {seen.home.length_m:.0f} m, {_clock(seen.home.seconds)} with landing{_kept(seen)}",
        )
    )
    said.append(
        (
            "basis",
            f"{settings.search.planner} over {DRAWS} simulated searches without a target, false alarms as p_tn = "
            f"{settings.sensor.p_tn:g} says; {settings.flight.speed_mps:g} m/s in no wind, {ALLOWANCE}; "
            "POS is until the first true detection, confirming it comes on top",
        )
    )
    return said


def text(seen: Preview) -> str:
    """The facts for a terminal."""
    return "\n".join(f"{name:11} {sentence}" for name, sentence in facts(seen))


def _goal(goal: Goal, seen: Preview) -> str:
    if goal.pos > seen.reachable:
        return f"cannot be reached: {seen.reachable:.1%} is all that can be found here from the air"
    if goal.median_s is None or goal.least_s is None or goal.most_s is None:
        longest = max(float(draw.seconds[-1]) for draw in seen.draws) + seen.before_s
        return f"not within {_clock(longest)}, which is as far as was simulated"
    more = ", more than one battery" if goal.median_s > seen.battery_s else ""
    return f"after about {_clock(goal.median_s)} ({_clock(goal.least_s)} to {_clock(goal.most_s)}){more}"


def _kept(seen: Preview) -> str:
    return "" if seen.kept_percent is None else f"; {seen.kept_percent:.0f} % of the battery are kept for it"


def _span(least: float, most: float) -> str:
    return f"{least:.0%}" if f"{least:.0%}" == f"{most:.0%}" else f"{least:.0%} to {most:.0%}"


def _clock(seconds: float) -> str:
    """Minutes and seconds of flight, such as 6:05."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
