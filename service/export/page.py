"""A run as one HTML page for the team: what was searched, how well, where not, what was found, and when.

Everything is in the one file, pictures too, and nothing of it is a script: it opens anywhere, with no network.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence

import numpy as np

from service.export.features import iso
from service.export.gaps import Gap, find_gaps
from service.export.pictures import WELL, draw_curve, draw_gaps, draw_map
from service.export.run import Detection, Run
from service.export.wishes import Wishes

MOST_ROWS = 100
SAME_S, LATELY = 30.0, 50

STYLE = """
body { font: 16px/1.45 system-ui, sans-serif; color: #111; background: #fff; max-width: 60rem; margin: 1rem auto;
  padding: 0 1rem; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.2rem; margin: 1.6rem 0 .4rem; }
.lead { font-size: 1.15rem; padding: .6rem .8rem; border-left: .4rem solid #2b8cbe; background: #eef5fa; }
.found { border-color: #2a7a2a; background: #ecf7ec; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th, td { text-align: left; padding: .25rem .6rem .25rem 0; border-bottom: 1px solid #ddd; vertical-align: top; }
img { max-width: 100%; height: auto; } .small { color: #444; font-size: .88rem; }
@media print { body { max-width: none; margin: 0; } h2 { break-after: avoid; } img, table { break-inside: avoid; } }
"""


def write(run: Run, wishes: Wishes) -> bytes:
    """The page, UTF-8."""
    gaps = find_gaps(run, wishes)
    title = f"Search report: {run.area.name}"
    parts = [
        f"<h1>{_safe(title)}</h1>",
        f'<p class="small">Run {_safe(run.name)}, {_day(run.began)} to {_day(run.last)}. {_status(run)}</p>',
        _lead(run),
        _numbers(run),
        "<h2>What was searched, and how well</h2>",
        _picture(
            draw_map(run), "Two maps: the probability that is left, and how well each cell was searched"
        ),
        "<p>Left: where the target may be now, after everything that was seen and not seen. Right: how probable "
        "it is that the looks so far would have found it there. Both are turned with the grid.</p>",
        _regions(run),
        "<h2>Where not</h2>",
        *_where_not(run, gaps, wishes),
        "<h2>What was found</h2>",
        *_what_was_found(run),
        "<h2>How it went</h2>",
        _picture(draw_curve(run), "The probability of success over time"),
        _table(("time (UTC)", "what happened"), ((_clock(m.time), m.text) for m in run.timeline[:MOST_ROWS])),
        _more(len(run.timeline)),
        "<h2>How to read this</h2>",
        _words(run),
    ]
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{_safe(title)}</title>'
    page = f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head>\n<body><main>\n'
    return (page + "\n".join(parts) + "\n</main></body></html>\n").encode()


def _status(run: Run) -> str:
    return (
        "The run is over."
        if run.over
        else f"The run was not over when this was written: {run.state.lower()}."
    )


def _lead(run: Run) -> str:
    """The one paragraph that everybody reads."""
    if run.find is not None:
        find = run.find
        text = (
            f"<strong>Found</strong> at {find.lat:.6f}, {find.lon:.6f} at {_clock(find.time)} UTC, with a probability "
            f"of {_sure(find.probability)}. If it is there, it is within {find.ellipse[0]:.0f} m of that with 95 %."
        )
        return f'<p class="lead found">{text}</p>'
    place = int(run.poa.argmax())
    row, col = divmod(place, run.frame.cols)
    lat, lon = run.frame.to_latlon([(row, col)])[0]
    text = (
        f"<strong>Not found.</strong> If the target is where the search assumed it to be, it would have been "
        f"detected by now with a probability of <strong>{run.pos:.0%}</strong>. It is outside the area with "
        f"{run.belief.outside:.0%}. The most likely cell is at {lat:.6f}, {lon:.6f}, with {run.poa.max():.1%}."
    )
    return f'<p class="lead">{text}</p>'


def _numbers(run: Run) -> str:
    hectare = run.frame.cell_m**2 / 1e4
    covered = run.grid.covered
    ground = float(covered.sum()) * hectare
    looked = float(covered[run.pod > 0].sum()) * hectare
    well = float(covered[run.pod >= WELL].sum()) * hectare
    flown = sum(piece[-1].time - piece[0].time for piece in run.track)
    rows = [
        ("probability of success so far (POS)", f"{run.pos:.1%}"),
        (
            "ground to search",
            f"{ground:.1f} ha in {int(run.grid.searchable.sum())} cells of {run.frame.cell_m:g} m",
        ),
        ("looked at least once", f"{looked:.1f} ha ({looked / ground:.0%})"),
        (f"searched well (POD {WELL:.0%} or more)", f"{well:.1f} ha ({well / ground:.0%})"),
        ("flown", f"{run.flown_m / 1000:.1f} km in {flown / 60:.0f} min, as far as reports came"),
        (
            "frames looked at",
            f"{run.reports}, which made {run.looks} looks at cells and {len(run.hits)} hits",
        ),
    ]
    return _table(("", ""), rows, head=False)


def _regions(run: Run) -> str:
    """The places that stood out before the search: what they hold now and how well they were searched."""
    rows = []
    for number in range(1, int(run.labels.max(initial=0)) + 1):
        inside = run.labels == number
        first, now = float(run.grid.prior[inside].sum()), float(run.poa[inside].sum())
        before = first * (1.0 - run.grid.outside)
        pod = float((run.grid.prior[inside] * run.pod[inside]).sum() / first) if first > 0.0 else 0.0
        rows.append((f"ROI {number}", f"{before:.1%}", f"{now:.1%}", f"{pod:.0%}"))
    if not rows:
        return "<p>No place stood out before the search: the probability was spread evenly.</p>"
    heads = (
        "region of interest",
        "probability before",
        "probability now",
        "POD, weighted by the probability before",
    )
    return _table(heads, rows[:MOST_ROWS]) + _more(len(rows))


def _where_not(run: Run, gaps: Sequence[Gap], wishes: Wishes) -> Iterable[str]:
    level = f"a POD below {wishes.pod_below:.0%} and {wishes.poa_above:g} times an average cell's probability or more"
    if not gaps:
        yield f"<p>There is no gap left: no ground has {level}.</p>"
    else:
        total = sum(gap.poa for gap in gaps)
        yield (
            f"<p>A gap is ground with {level}. There are {len(gaps)}; together they hold {total:.1%} of "
            "the probability. Exported as GeoJSON or KML they are polygons, as a plan a mission.</p>"
        )
    yield _picture(draw_gaps(run, gaps, wishes), "A map of the gaps, numbered as in the table")
    if gaps:
        rows = (
            (
                str(number),
                f"{gap.poa:.1%}",
                f"{gap.area_m2 / 1e4:.2f} ha",
                f"{gap.pod:.0%}",
                f"{gap.middle[0]:.6f}, {gap.middle[1]:.6f}",
                "" if gap.flyable else "may not be flown over",
            )
            for number, gap in enumerate(gaps[:MOST_ROWS], 1)
        )
        yield _table(("gap", "probability", "size", "POD so far", "middle (lat, lon)", ""), rows)
        yield _more(len(gaps))


def _what_was_found(run: Run) -> Iterable[str]:
    if not run.detections:
        hits = f"; {len(run.hits)} cells had a hit" if run.hits else ""
        yield f"<p>The detector reported nothing at a place{hits}.</p>"
        return
    yield "<p>What the detector reported. A report alone is no find: detectors raise false alarms.</p>"
    seen = sightings(run)
    rows = (
        (
            _clock(each[0].time),
            each[0].kind,
            f"{max(one.score for one in each):.2f}",
            f"{each[0].lat:.6f}, {each[0].lon:.6f}",
            each[0].source,
            f"{len(each)} frame" + ("s" if len(each) > 1 else ""),
            "a hit on the map"
            if any(one.counted for one in each)
            else "not over ground that was being looked at",
        )
        for each in seen[:MOST_ROWS]
    )
    yield _table(("time (UTC)", "class", "score", "place (lat, lon)", "detector", "seen in", ""), rows)
    yield _more(len(seen))


def sightings(run: Run) -> list[list[Detection]]:
    """Detections that are most likely the same thing, together: one class, within a cell, not long after each other."""
    seen: list[list[Detection]] = []
    for each in run.detections:
        lately = seen[-LATELY:]
        metres = run.frame.to_metres([(each.lat, each.lon), *((old[-1].lat, old[-1].lon) for old in lately)])
        away = np.hypot(*(metres[1:] - metres[0]).T)
        for old, distance in zip(reversed(lately), reversed(away), strict=True):
            same = (old[-1].kind, old[-1].source) == (each.kind, each.source)
            if same and distance <= run.frame.cell_m and each.time - old[-1].time <= SAME_S:
                old.append(each)
                break
        else:
            seen.append([each])
    return seen


def _words(run: Run) -> str:
    sensor, flight = run.settings.sensor, run.settings.flight
    facts = [
        "POA, probability of area: how probable it is that the target is in a piece of ground.",
        "POD, probability of detection: how probable it is that the looks so far would have found it there.",
        "POS, probability of success: how probable it is that the search so far would have found it. "
        "It counts what the search assumed before it began; a wrong assumption makes it wrong.",
        f"A look finds a target that is there with {sensor.p_tp:.0%} and raises a false alarm with "
        f"{1 - sensor.p_tn:.0%}, as the settings say of the detector.",
        f"Flown {flight.altitude_m:g} m above the launch point at {flight.speed_mps:g} m/s; decided by "
        f"{run.settings.search.planner}.",
        *run.grid.notes,
    ]
    return "<ul>" + "".join(f"<li>{_safe(fact)}</li>" for fact in facts) + "</ul>"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, head: bool = True) -> str:
    top = "<thead><tr>" + "".join(f'<th scope="col">{_safe(h)}</th>' for h in heads) + "</tr></thead>"
    body = "".join("<tr>" + "".join(f"<td>{_safe(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table>{top if head else ''}<tbody>{body}</tbody></table>"


def _more(count: int) -> str:
    return f'<p class="small">and {count - MOST_ROWS} more</p>' if count > MOST_ROWS else ""


def _picture(png: bytes, words: str) -> str:
    data = base64.b64encode(png).decode("ascii")
    return f'<p><img alt="{_safe(words)}" src="data:image/png;base64,{data}"></p>'


def _safe(text: str) -> str:
    return html.escape(text, quote=True)


def _sure(probability: float) -> str:
    return f"{probability:.2%}" if probability < 0.9999 else "over 99.99 %"


def _day(time: float) -> str:
    return iso(time)[:16].replace("T", " ") + " UTC"


def _clock(time: float) -> str:
    return iso(time)[11:19]
