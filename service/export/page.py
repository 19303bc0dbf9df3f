"""A run as one HTML page for the team: what was searched, how well, where not, what was found, and when.

Everything is in the one file, pictures too, and nothing of it is a script: it opens anywhere, with no network.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence

import numpy as np

from service.chances import share, sure
from service.export.features import iso
from service.export.gaps import Gap, find_gaps
from service.export.model import ExportedRun, PlacedDetection
from service.export.pictures import WELL, draw_curve, draw_gaps, draw_maps
from service.export.wishes import Wishes
from service.mission.states import State
from service.view.next import STATE_WORDS

MOST_ROWS = 100
SAME_S, LATELY = 30.0, 50
_CHANGE = re.compile(rf"\b({'|'.join(State)}) → ({'|'.join(State)})\b")

STYLE = """
@page { size: A4; margin: 12mm; }
body { font: 16px/1.45 system-ui, sans-serif; color: #0d1620; background: #fff; max-width: 60rem; margin: 1rem auto;
  padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.2rem; margin: 1.4rem 0 .4rem; }
.lead { font-size: 1.15rem; padding: .6rem .8rem; border-left: .4rem solid #0b4aa2; background: #e9f0fa; }
.found { border-color: #0a6b2f; background: #ecf7ec; }
.wide { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th, td { text-align: left; padding: .25rem .6rem .25rem 0; border-bottom: 1px solid #c3cad2; vertical-align: top;
  min-width: 3.5rem; overflow-wrap: break-word; }
img { max-width: 100%; height: auto; } .small { color: #46525f; font-size: .88rem; }
.pair { display: flex; flex-wrap: wrap; gap: .5rem; } .pair p { flex: 1 1 20rem; margin: 0; }
@media screen and (max-width: 40rem) { .cards thead { position: absolute; clip-path: inset(50%); }
  .cards :is(table, tbody, tr, td) { display: block; }
  .cards tr { border-bottom: 2px solid #c3cad2; padding: .35rem 0; }
  .cards td { border: 0; padding: 0; } .cards td:empty { display: none; }
  .cards td::before { content: attr(data-head) ": "; color: #46525f; } .cards td:first-child { font-weight: 600; } }
@media print { body { max-width: none; margin: 0; padding: 0; font-size: 10.5pt; } h2 { break-after: avoid; }
  .pair { flex-wrap: nowrap; } .pair p { flex: 1 1 0; min-width: 0; } img, tr { break-inside: avoid; }
  .wide { overflow: visible; } .appendix { break-before: page; } .appendix img { max-width: 60%; } }
"""


def write(run: ExportedRun, wishes: Wishes) -> bytes:
    """The page, UTF-8: in print the first sheet is what everybody reads, and the rest an appendix."""
    gaps = find_gaps(run, wishes)
    title = f"Search report: {run.area.name}"
    belief, searched = draw_maps(run)
    parts = [
        f"<h1>{_safe(title)}</h1>",
        f'<p class="small">Run {_safe(run.name)}, {_day(run.began)} to {_day(run.last)}. {_status(run)}</p>',
        _lead(run),
        "<h2>What was searched, and how well</h2>",
        '<div class="pair">',
        _picture(belief, "A map of the probability that is left, north up"),
        _picture(searched, "A map of how well each cell was searched, north up"),
        "</div>",
        "<p>First: where the target may be now, after everything that was seen and not seen. Second: how probable "
        "it is that the looks so far would have found it there. North is up.</p>",
        _numbers(run),
        '<section class="appendix">',
        "<h2>Likely places</h2>",
        _regions(run),
        "<h2>Where not</h2>",
        *_where_not(run, gaps, wishes),
        "<h2>What was found</h2>",
        *_what_was_found(run),
        "<h2>How it went</h2>",
        _picture(draw_curve(run), "The probability of success over time"),
        _table("What happened", ("time (UTC)", "what happened"), _happened(run)),
        _more(len(run.timeline)),
        "<h2>How to read this</h2>",
        _words(run),
        "</section>",
    ]
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{_safe(title)}</title>"
    )
    page = f'<!DOCTYPE html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head>\n<body><main>\n'
    return (page + "\n".join(parts) + "\n</main></body></html>\n").encode()


def _status(run: ExportedRun) -> str:
    return (
        "The run is over."
        if run.over
        else f"The run was not over when this was written: {run.state.lower()}."
    )


def _lead(run: ExportedRun) -> str:
    """The one paragraph that everybody reads."""
    if run.find is not None:
        find = run.find
        how = (
            f"confirmed by an operator; the map gives it {sure(find.probability)}"
            if find.confirmed
            else f"with a probability of {sure(find.probability)}"
        )
        text = (
            f"<strong>Found</strong> at {run.written(find.lat, find.lon)} at {_clock(find.time)} UTC, {how}. If it is "
            f"there, it is within {find.ellipse[0]:.0f} m of that with 95 %."
        )
        return f'<p class="lead found">{text}</p>'
    place = int(run.poa.argmax())
    row, col = divmod(place, run.frame.cols)
    lat, lon = run.frame.to_latlon([(row, col)])[0]
    text = (
        f"<strong>Not found.</strong> If the target is where the search assumed it to be, it would have been "
        f"detected by now with a probability of <strong>{share(run.pos)}</strong>. It is outside the area with "
        f"{share(run.belief.outside)}. The most likely cell is at {run.written(lat, lon)}, with {sure(run.poa.max())}."
    )
    return f'<p class="lead">{text}</p>'


def _numbers(run: ExportedRun) -> str:
    hectare = run.frame.cell_m**2 / 1e4
    covered = run.grid.covered
    ground = float(covered.sum()) * hectare
    looked = float(covered[run.pod > 0].sum()) * hectare
    well = float(covered[run.pod >= WELL].sum()) * hectare
    flown = sum(piece[-1].time - piece[0].time for piece in run.track)
    rows = [
        ("probability of success so far (POS)", sure(run.pos)),
        (
            "ground to search",
            f"{ground:.1f} ha in {int(run.grid.searchable.sum())} cells of {run.frame.cell_m:g} m",
        ),
        ("looked at least once", f"{looked:.1f} ha ({share(looked / ground)})"),
        (f"searched well (POD {share(WELL)} or more)", f"{well:.1f} ha ({share(well / ground)})"),
        ("flown", f"{run.flown_m / 1000:.1f} km in {flown / 60:.0f} min, as far as reports came"),
        (
            "frames looked at",
            f"{run.reports}, which made {_count(run.looks, 'look')} at cells and "
            f"{_count(len(run.hits), 'hit')}",
        ),
    ]
    return _table("The search in numbers", ("", ""), rows, head=False)


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def _together(gaps: int) -> str:
    return "There is one; it holds" if gaps == 1 else f"There are {gaps}; together they hold"


def _regions(run: ExportedRun) -> str:
    """The places that stood out before the search: what they hold now and how well they were searched."""
    rows = []
    for number in range(1, int(run.labels.max(initial=0)) + 1):
        inside = run.labels == number
        first, now = float(run.grid.prior[inside].sum()), float(run.poa[inside].sum())
        before = first * (1.0 - run.grid.outside)
        pod = float((run.grid.prior[inside] * run.pod[inside]).sum() / first) if first > 0.0 else 0.0
        rows.append((run.region_names[number - 1], sure(before), sure(now), share(pod)))
    if not rows:
        return "<p>No place stood out before the search: the probability was spread evenly.</p>"
    heads = (
        "likely place",
        "probability before",
        "probability now",
        "POD, weighted by the probability before",
    )
    return _table("Likely places", heads, rows[:MOST_ROWS]) + _more(len(rows))


def _where_not(run: ExportedRun, gaps: Sequence[Gap], wishes: Wishes) -> Iterable[str]:
    average = f"{wishes.poa_above:g} times an average cell's probability"
    level = f"a POD below {share(wishes.pod_below)} and {average} or more"
    if not gaps:
        yield f"<p>{_no_gap(run, level)}</p>"
    else:
        total = sum(gap.poa for gap in gaps)
        yield (
            f"<p>A gap is ground with {level}. {_together(len(gaps))} {sure(total)} of the "
            "probability. Exported as GeoJSON or KML they are polygons, as a plan a mission.</p>"
        )
    yield _picture(draw_gaps(run, gaps, wishes), "A map of the gaps, numbered as in the table")
    if gaps:
        rows = (
            (
                str(number),
                sure(gap.poa),
                f"{gap.area_m2 / 1e4:.2f} ha",
                share(gap.pod),
                run.written(*gap.middle),
                "" if gap.flyable else "may not be flown over",
            )
            for number, gap in enumerate(gaps[:MOST_ROWS], 1)
        )
        heads = ("gap", "probability", "size", "POD so far", "middle", "remark")
        yield _table("Gaps", heads, rows)
        yield _more(len(gaps))


def _no_gap(run: ExportedRun, level: str) -> str:
    """That nothing is worth another flight, without saying more than was searched."""
    ground = run.grid.searchable
    never = float((ground & (run.pod <= 0.0)).sum()) / max(int(ground.sum()), 1)
    if never == 0.0:
        return f"There is no gap left: no ground has {level}."
    left = float(run.poa[ground & (run.pod <= 0.0)].sum())
    return (
        f"{share(never)} of the ground was not searched at all; {sure(left)} of the probability lies there. None "
        f"of it counts as a gap to fly again, which has {level}."
    )


def _what_was_found(run: ExportedRun) -> Iterable[str]:
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
            run.written(each[0].lat, each[0].lon),
            each[0].source,
            _count(len(each), "frame"),
            "a hit on the map"
            if any(one.counted for one in each)
            else "not over ground that was being looked at",
        )
        for each in seen[:MOST_ROWS]
    )
    heads = ("time (UTC)", "class", "score", "place", "detector", "seen in", "counted as")
    yield _table("What the detector reported", heads, rows)
    yield _more(len(seen))


def sightings(run: ExportedRun) -> list[list[PlacedDetection]]:
    """Detections that are most likely the same thing, together: one class, within a cell, not long after each other."""
    seen: list[list[PlacedDetection]] = []
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


def _happened(run: ExportedRun) -> Iterable[tuple[str, str]]:
    """The timeline, with the states as the page says them."""
    for moment in run.timeline[:MOST_ROWS]:
        text = _CHANGE.sub(_in_words, moment.text) if moment.kind == "state" else moment.text
        yield _clock(moment.time), text


def _in_words(change: re.Match[str]) -> str:
    before, after = (STATE_WORDS[State(name)].lower() for name in change.groups())
    return f"{before} → {after}"


def _words(run: ExportedRun) -> str:
    sensor, flight = run.settings.sensor, run.settings.flight
    facts = [
        "POA, probability of area: how probable it is that the target is in a piece of ground.",
        "POD, probability of detection: how probable it is that the looks so far would have found it there.",
        "POS, probability of success: how probable it is that the search so far would have found it. "
        "It counts what the search assumed before it began; a wrong assumption makes it wrong.",
        f"A look finds a target that is there with {sure(sensor.p_tp)} and raises a false alarm with "
        f"{sure(1 - sensor.p_tn)}, as the settings say of the detector.",
        f"Flown {flight.altitude_m:g} m above the launch point at {flight.speed_mps:g} m/s; decided by "
        f"{run.settings.search.planner}.",
        *run.grid.notes,
    ]
    return "<ul>" + "".join(f"<li>{_safe(fact)}</li>" for fact in facts) + "</ul>"


def _table(about: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, head: bool = True) -> str:
    """A table. With more than two columns it is a list of cards on a phone, and its roles say that it is a table
    still; what is wider than the screen all the same is moved by a finger or by arrow keys."""
    top = "".join(f'<th role="columnheader" scope="col">{_safe(each)}</th>' for each in heads)
    body = "".join(f'<tr role="row">{_cells(heads, row)}</tr>' for row in rows)
    thead = f'<thead role="rowgroup"><tr role="row">{top}</tr></thead>' if head else ""
    table = f'<table role="table">{thead}<tbody role="rowgroup">{body}</tbody></table>'
    kind = "wide cards" if len(heads) > 2 else "wide"
    return f'<div class="{kind}" role="region" aria-label="{_safe(about)}" tabindex="0">{table}</div>'


def _cells(heads: Sequence[str], row: Sequence[str]) -> str:
    return "".join(
        f'<td role="cell" data-head="{_safe(head)}">{_safe(cell)}</td>'
        for head, cell in zip(heads, row, strict=True)
    )


def _more(count: int) -> str:
    return f'<p class="small">and {count - MOST_ROWS} more</p>' if count > MOST_ROWS else ""


def _picture(png: bytes, words: str) -> str:
    data = base64.b64encode(png).decode("ascii")
    return f'<p><img alt="{_safe(words)}" src="data:image/png;base64,{data}"></p>'


def _safe(text: str) -> str:
    return html.escape(text, quote=True)


def _day(time: float) -> str:
    return iso(time)[:16].replace("T", " ") + " UTC"


def _clock(time: float) -> str:
    return iso(time)[11:19]
