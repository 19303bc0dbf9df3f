"""A preview in words: pairs of a heading and a sentence, the same for the terminal and the page."""

from __future__ import annotations

from service.places import written
from service.preview.batteries import MOST, Help
from service.preview.heights import cover_facts, height_facts
from service.preview.pace import climb_seconds
from service.preview.preview import DRAWS, ENOUGH, FIRST_S, GOALS, Goal, Preview, first_minutes
from service.preview.priors import added_up

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
        *(("prior", sentence) for sentence, _ in added_up(seen.area, grid)),
        *(("note", note) for note in (*seen.area.notes, *grid.notes)),
    ]
    if (number := len(settings.aircraft)) > 1:
        said.append(
            (
                "aircraft",
                f"what one of {number} aircraft does, by the settings of all, as if it searched alone",
            )
        )
    said += [*height_facts(seen), *cover_facts(seen)]
    for region in sorted(seen.regions, key=lambda each: -each.mass)[:_MOST_REGIONS]:
        place = written(region.peak, settings.run.coordinates)
        mass = f"{region.mass:.0%} of the probability on {region.hectares:.1f} ha, most at {place}"
        said.append((f"ROI {region.number}", mass))
    if len(seen.regions) > _MOST_REGIONS:
        said.append(("", f"and {len(seen.regions) - _MOST_REGIONS} smaller regions of interest"))
    if not seen.regions:
        said.append(("ROIs", "none: no place stands out"))
    up = f"{climb_seconds(settings.flight, seen.grid):.0f} s to {settings.flight.altitude_m:g} m"
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
    until = f"searches until {_clock(seen.battery_s)} where the way home is longest"
    said.append(("battery", f"{known} {until}: POS {_span(least, most)}"))
    said += _batteries(seen)
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
            f"{settings.sensor.p_tn:g} says; {_motion(seen)}; "
            "POS is until the first true detection, confirming it comes on top",
        )
    )
    return said


def text(seen: Preview) -> str:
    """The facts for a terminal."""
    return "\n".join(f"{name:11} {sentence}" for name, sentence in facts(seen))


def _batteries(seen: Preview) -> list[tuple[str, str]]:
    """How many batteries, POS after each and when, and what would make them fewer."""
    flown, each, known = 0.0, [], "" if seen.kept_percent is not None else ", flight.full_battery_s"
    for battery in seen.batteries:
        flown += battery.seconds
        each.append(f"{battery.pos:.0%} after {_clock(flown)}")
    if not each:
        return [("batteries", f"one of {_clock(seen.full_s)}{known} is too little to find anything")]
    short = seen.batteries[-1].pos < min(max(GOALS), ENOUGH * seen.reachable)
    more = "more than " if len(each) == MOST and short else ""
    said = f"{more}{len(each)} of {_clock(seen.full_s)}{known}: POS {', '.join(each)} in the air"
    return [("batteries", f"{said}, changing them not counted"), *(_help(one, seen) for one in seen.helps)]


def _help(one: Help, seen: Preview) -> tuple[str, str]:
    """What one battery finds from another height."""
    sensor = seen.settings.sensor
    return (
        "would help" if one.pos > seen.batteries[0].pos else "no help",
        f"at {one.altitude_m:g} m and cells of {one.cell_m:g} m: POS {one.pos:.0%} in one battery; p_tp is then "
        f"{one.p_tp:.2f} and not {sensor.p_tp:g}, by the pixels on a target of {sensor.target_size_m:g} m",
    )


def _goal(goal: Goal, seen: Preview) -> str:
    if goal.pos > seen.reachable:
        return f"cannot be reached: {seen.reachable:.1%} is all that can be found here from the air"
    if goal.median_s is None or goal.least_s is None or goal.most_s is None:
        longest = max(float(draw.seconds[-1]) for draw in seen.draws) + seen.before_s
        return f"not within {_clock(longest)}, which is as far as was simulated"
    more = ", more than one battery" if goal.median_s > seen.battery_s else ""
    return f"after about {_clock(goal.median_s)} ({_clock(goal.least_s)} to {_clock(goal.most_s)}){more}"


def _motion(seen: Preview) -> str:
    """What the times are reckoned with."""
    flight, corner = seen.settings.flight, seen.motion.corner_speed(90)
    return (
        f"{flight.speed_mps:g} m/s in no wind, corners at {corner:.1f} m/s, speeding up with "
        f"{flight.acceleration_mps2:g} and braking with {flight.deceleration_mps2:g} m/s² as set: learnt in flight"
    )


def _kept(seen: Preview) -> str:
    return "" if seen.kept_percent is None else f"; {seen.kept_percent:.0f} % of the battery are kept for it"


def _span(least: float, most: float) -> str:
    return f"{least:.0%}" if f"{least:.0%}" == f"{most:.0%}" else f"{least:.0%} to {most:.0%}"


def _clock(seconds: float) -> str:
    """Minutes and seconds of flight, such as 6:05."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
