"""What things are by their names, for files of programs that know no roles: the table of `README.md` in this folder."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Sequence
from typing import Any, TypeGuard

from service.area.document import Document, Item, Json
from service.area.geojson import number, quote
from service.area.mending import goes_around, mend

ROLE_NAMES = ("search", "prior", "ipp", "exclude", "cover", "transit", "launch")
"""As `roles.ROLES`, which a test holds them to."""

_GROUNDS = ("Polygon", "MultiPolygon")

LKP_SIGMA_M, CLUE_SIGMA_M = 200.0, 100.0
"""How far from a last known position, and from a clue, the target is taken to be when nothing else is said."""

MOST_COLUMNS = 300
"""A feature with more properties is a computer's, and nobody misspelt one."""

CLOSED_M = 20.0
"""A track whose ends are nearer than this to each other goes around something."""

_POINTS: tuple[tuple[str, str], ...] = (
    (
        r"lkp|pls|ipp|last known\b.*|(point |place )?last seen|initial planning point"
        r"|letzter? (bekannter? )?(standort|aufenthalts?ort|punkt|position)|zuletzt gesehen"
        r"|derni[eè]re? (point|position|lieu)\b.*|vue? pour la derni[eè]re fois"
        r"|ultim[ao] (posizione|avvistamento)|[uú]ltim[ao] (posici[oó]n|avistamiento)",
        "last",
    ),
    (
        r"clues?|sightings?|footprints?|found items?|fund(ort|st[uü]cke?)?|spur(en)?|fu(ß|ss)spur(en)?"
        r"|indices?|traces?|indizi[oa]?|tracc[ei]a?|huellas?",
        "clue",
    ),
    (
        r"(?<!boat )launch|take ?off|uas base|drone base|lz|landing zone|^home( point| position| location)?$"
        r"|start(platz|punkt|ort)|d[eé]collage|decollo|despegue",
        "launch",
    ),
)
_NEVER: tuple[tuple[str, str], ...] = (
    (
        r"no ?(fly|flying|flight|drones?)( ?zones?)?|do not fly|nfz|tfr|exclusions?|excluded?|keep ?out"
        r"|flugverbot\w*|sperr(zone|gebiet|bereich|fl[aä]che)n?",
        "exclude",
    ),
)
"""What nobody says of anything but ground that is not to be flown over, however it is drawn."""
_POLYGONS: tuple[tuple[str, str], ...] = (
    *_NEVER,
    (
        r"hazards?|danger(ous)?|avoid|restrict(ed|ion|ions)|prohibited|forbidden|obstacles?"
        r"|gesperrt|gefahr\w*|hindernis(se)?|interdit\w*|vietat[oa]|divieto|pericol\w*|prohibid[oa]|peligro",
        "exclude",
    ),
    (r"prior|probable|likely|high probability|poa|wahrscheinlich\w*", "prior"),
    (
        r"search|searched area|area|segments?|sectors?|assignments?"
        r"|such(gebiet|bereich|fl[aä]che|abschnitt|sektor)\w*|abschnitt|sektor|zone de recherche|secteur"
        r"|zona di ricerca|settore|zona de b[uú]squeda",
        "search",
    ),
)
"""English, and the words of the Alps and of Spain; written with spaces, as `_plain` gives names."""

_RING = re.compile(
    r"range rings?\b.*|.*\d ?%|\d+([.,]\d+)? ?(m|km|mi|ft|miles?|met(er|re)s?|kilomet(er|re)s?)"
)
"""What a ring of distances around a point is called."""


def _plain(text: str) -> str:
    """A name in small letters, with spaces where others write NoFlyZone, no_fly_zone and no-fly zone."""
    text = re.sub(r"(?<=[a-zß-ÿ])(?=[A-ZÀ-Þ])", " ", unicodedata.normalize("NFC", text))
    return re.sub(r"[\s_/–-]+", " ", text).strip().lower()


def _matches(table: Sequence[tuple[str, str]], text: str) -> str | None:
    text = _plain(text)
    for pattern, what in table:
        if re.search(rf"(?<![^\W\d_])({pattern})(?![^\W\d_])", text):
            return what
    return None


def give_roles(document: Document) -> None:
    """Give a role to each thing that has none, or leave it out with a note; what was taken for what is noted."""
    if not any(item.geometry["type"] in _GROUNDS for item in document.items):
        _take_lines_around(document)
    by_hint = not any(_has_search(item, ()) for item in document.items)
    searched = any(_has_search(item, item.hints if by_hint else ()) for item in document.items)
    kept: list[Item] = []
    nameless: list[str] = []
    for item in document.items:
        if meant := _misspelt_role(item):
            document.faults.append(
                f"{item.label}: it has no property {quote(meant)} that is known; did you mean 'role'?"
            )
            continue
        given = "role" in item.properties
        if not given and _is_empty(item.geometry):
            _left_out(document, item, "it is empty")
            continue
        if not given and not _take(document, item, searched, by_hint, nameless):
            continue
        if item.geometry["type"] in _GROUNDS and (note := mend(item.geometry)):
            document.notes.append(f"{item.label}: {note}")
        kept.append(item)
    document.items = kept
    if len(nameless) > 1:
        few = ", ".join(nameless[:5]) + (f" and {len(nameless) - 5} more" if len(nameless) > 5 else "")
        document.notes.append(f"searched, since no name says what else it is: {few}")


def _take_lines_around(document: Document) -> None:
    """Where nothing is drawn as a polygon, lines that come back to their start are: some programs have only lines."""
    for item in document.items:
        positions = item.geometry.get("coordinates")
        if item.geometry["type"] != "LineString" or "role" in item.properties or not are_positions(positions):
            continue
        if ring := outline(positions, item.words, always=True):
            item.geometry.update(type="Polygon", coordinates=[ring])
            document.notes.append(
                f"{item.label}: the line comes back to its start, what it goes around is taken"
            )


def are_positions(value: object) -> TypeGuard[list[list[Any]]]:
    """Whether these are positions that can be reckoned with; what is wrong with others is told where they are read."""
    return isinstance(value, list) and all(
        isinstance(each, list)
        and len(each) >= 2
        and all(isinstance(part, int | float) and abs(part) <= 180 for part in each[:2])
        for each in value
    )


def _is_empty(geometry: Json) -> bool:
    """Whether there is no number in a geometry's coordinates."""
    open_lists = [geometry.get("coordinates")]
    while open_lists:
        each = open_lists.pop()
        if not isinstance(each, list):
            return False
        open_lists += each
    return True


def _misspelt_role(item: Item) -> str | None:
    """A property that was meant to be `role`: of a similar name, with a role in it."""
    if "role" in item.properties or len(item.properties) > MOST_COLUMNS:
        return None
    near = difflib.get_close_matches("role", item.properties, n=1, cutoff=0.7)
    if not near:
        return None
    value = item.properties[near[0]]
    return near[0] if isinstance(value, str) and value.strip().lower() in ROLE_NAMES else None


def _has_search(item: Item, hints: tuple[str, ...]) -> bool:
    """Whether this is said to be ground to search, so that polygons of no name are something else."""
    if item.geometry["type"] not in _GROUNDS:
        return False
    if "role" in item.properties:
        return bool(item.properties["role"] == "search")
    return item.kind in ("Assignment", "survey") or _meaning(_POLYGONS, item, hints) == "search"


def _meaning(table: Sequence[tuple[str, str]], item: Item, hints: tuple[str, ...]) -> str | None:
    """What a thing is by its words, or else by the first hint that says something."""
    return next((what for text in (item.words, *hints) if (what := _matches(table, text))), None)


def _take(document: Document, item: Item, searched: bool, by_hint: bool, nameless: list[str]) -> bool:
    kind = item.geometry["type"]
    if kind in _GROUNDS:
        return _take_polygon(document, item, searched, by_hint, nameless)
    if kind == "Point":
        return _take_point(document, item)
    if _forbids(document, item):
        return False
    if "Line" in kind:
        _left_out(document, item, 'a line says nothing by itself; give it "role": "prior" and a width_m')
    else:
        _left_out(document, item, f"nothing is made of a {kind}; draw a Polygon, LineString or Point")
    return False


def _take_polygon(document: Document, item: Item, searched: bool, by_hint: bool, nameless: list[str]) -> bool:
    role = _meaning(_POLYGONS, item, item.hints)
    if role == "search" and not by_hint:
        role = _matches(_POLYGONS, item.words)
    if item.kind in ("Assignment", "survey"):
        role = "search"
    if role is None and _RING.fullmatch(_plain(item.words)):
        _left_out(document, item, "a ring of distances; a subject, such as hiker, for its point gives them")
        return False
    if document.format != "GeoJSON":
        if role is None and searched:
            _left_out(document, item, 'a polygon of no known name beside the search area; give it a "role"')
            return False
        item.guessed = role in ("exclude", "prior")
        if item.guessed:
            document.notes.append(f"{item.label}: taken as {_said(role or '')}, by its name")
    elif role == "exclude":  # plain GeoJSON: every polygon is the area, unless a name says never to fly there
        item.guessed = True
        document.notes.append(f"{item.label}: taken as ground that is never flown over, by its name")
    elif role == "prior":
        role = None
    if role is None:
        nameless.append(item.label)
    item.properties["role"] = role or "search"
    return True


def _take_point(document: Document, item: Item) -> bool:
    what = "clue" if item.kind == "Clue" else _meaning(_POINTS, item, item.hints)
    known = item.properties
    item.guessed = True
    if what == "last" and ("subject" in known or "rings_m" in known):
        known["role"] = "ipp"
        item.guessed = False  # whoever gave a subject meant it, and hears what is wrong with it
    elif what in ("last", "clue"):
        known["role"] = "prior"
        if "sigma_m" not in known:
            known["sigma_m"] = LKP_SIGMA_M if what == "last" else CLUE_SIGMA_M
            rings = "; a subject, such as hiker, gives the published distances" if what == "last" else ""
            document.notes.append(
                f"{item.label}: taken as a prior with sigma_m = {known['sigma_m']:g}, by its name{rings}"
            )
    elif what == "launch" or "sigma_m" in known:
        known["role"] = "launch" if what == "launch" else "prior"
        document.notes.append(f"{item.label}: taken as {_said(known['role'])}")
    elif _forbids(document, item):
        return False
    elif number(known.get("radius")):
        _left_out(
            document, item, "a circle that GeoJSON keeps as a point with a radius; draw it as a polygon"
        )
        return False
    else:
        _left_out(document, item, 'a point of no known name; give it "role": "prior", "ipp" or "launch"')
        return False
    return True


def _forbids(document: Document, item: Item) -> bool:
    """Whether a thing that is no polygon is called ground that is not to be flown over: nobody must believe that it
    is kept to."""
    if _meaning(_NEVER, item, item.hints) is None:
        return False
    document.faults.append(
        f"{item.label}: its name says that it is not to be flown over, and a {item.geometry['type']} does not say "
        'where; draw it as a Polygon, or give it another name, or a "role"'
    )
    return True


def _said(role: str) -> str:
    return {
        "exclude": "ground that is never flown over",
        "prior": "a prior",
        "launch": "the launch point",
    }.get(role, role)


def _left_out(document: Document, item: Item, why: str) -> None:
    document.notes.append(f"{item.label}: left out, {why}")


def outline(positions: list[Any], name: str, always: bool) -> list[Any] | None:
    """The ring that a line draws which comes back to its start, or None: GPX and others have no polygons.

    `always`: whatever it is called, if it goes around ground and not out and back on one way; otherwise only when its
    name says that it is an area.
    """
    from service.geometry import distance_m

    named = _matches(_POLYGONS, name) is not None
    if len(positions) < 4 or not (always or named):
        return None
    first, last = positions[0], positions[-1]
    if distance_m((first[1], first[0]), (last[1], last[0])) > CLOSED_M:
        return None
    ring = positions if list(first[:2]) == list(last[:2]) else [*positions, first]
    return ring if len(ring) >= 4 and (named or goes_around(ring)) else None
