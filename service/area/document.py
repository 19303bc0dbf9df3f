"""A file that names places, as plain GeoJSON features: what readers of `formats` give and `reading` takes."""

from __future__ import annotations

import html
import json
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from service.area import lost_persons
from service.area.model import COVER_KINDS

Json = dict[str, Any]

NUMBERS = ("weight", "sigma_m", "width_m", "outside", "p_tp")
LISTS = ("rings_m",)
TRUTHS = ("searchable",)
TEXTS = ("role", "subject", "terrain", "kind")
"""The properties that formats without numbers carry as text, and that a description may set as `key=value`."""

OURS = (*NUMBERS, *LISTS, *TRUTHS, *TEXTS)
NAMES = ("name", "title", "description")

_PHRASES = frozenset({*lost_persons.SUBJECTS, *lost_persons.TERRAINS, *COVER_KINDS})
"""Values of more than one word, some of them."""

_NAMED = re.compile(r'\("(.*)"\)$', re.DOTALL)
_TAG = re.compile(r"<[^<>]{0,2000}>")  # one that begins another is none: each sign is looked at once
_KIND = re.compile(r": (?:left out, |taken as ).*$")
_SETTING = re.compile(
    r"\b([a-z_]{3,12})\s*=\s*(\"[^\"]{0,200}\"|[\d.]{1,20}(?:,[\d.]{1,20}){1,9}(?![\w.])|[^\s,;<]{1,200})([^=,;<\n\"]{0,60})"
)


@dataclass
class Item:
    """One thing in a file.

    Attributes:
        label: how messages call it, such as 'features[2] ("hut")'.
        geometry: a GeoJSON geometry (RFC 7946, section 3.1), coordinates as in the file.
        properties: what it says about itself; `role` only where it was given.
        words: what a person called it: name, title.
        kind: what its program takes it for ("Assignment", "waypoint"), empty in plain GeoJSON.
        guessed: the role came from the table of `words`, so that a fault is no reason to refuse the file.
        dropped: it was such a fault, and is no part of the area.
        hints: what else was written about it, such as the folder it is in; counts where `words` say nothing.
    """

    label: str
    geometry: Json
    properties: Json = field(default_factory=dict)
    words: str = ""
    kind: str = ""
    guessed: bool = False
    dropped: bool = False
    hints: tuple[str, ...] = ()


@dataclass
class Document:
    """A file as it was read. `notes` and `faults` are sentences about its parts, without the file's name.

    `plain` says that it is GeoJSON with nothing to translate.
    """

    format: str
    items: list[Item] = field(default_factory=list)
    name: str = ""
    description: str = ""
    outside: Any = None
    notes: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    plain: bool = False


def label(kind: str, number: int, name: str = "") -> str:
    """How messages call the part of a file with a number from 0."""
    return f'{kind} {number + 1} ("{one_line(name)}")' if name else f"{kind} {number + 1}"


def name_in(label: str) -> str:
    """What a person called a part of a file, from what messages call it (`document.label`); empty: nothing."""
    found = _NAMED.search(label)
    return found.group(1) if found else ""


def one_line(value: object, most: int = 80) -> str:
    """A text on one line: what a terminal would take for an order (RFC 8259 allows any) becomes a space."""
    text = "".join(sign if sign.isprintable() else " " for sign in str(value)).strip()
    return text if len(text) <= most else f"{text[: most - 1]}…"


def plain_text(text: str) -> str:
    """A description without its HTML, as Google Earth and CalTopo write it."""
    return html.unescape(_TAG.sub(" ", text[:20_000]))


def settings_in(text: str) -> Json:
    """The properties of ours that a description sets, such as `role=prior sigma_m=120`."""
    found: Json = {}
    rest = plain_text(text)
    while setting := _SETTING.search(rest):
        key, value, more = setting.groups()
        if key in OURS:
            found[key] = value.strip('"') if value.startswith('"') else _phrase(value, more)
        rest = rest[setting.end(2) :]
    return typed(found)


def _phrase(word: str, more: str) -> str:
    """A value that nobody put in quotes: with the words after it where they are one of ours ("child 4-6")."""
    whole = f"{word} {more}".lower().split()
    lengths = [len(phrase.split()) for phrase in _PHRASES if whole[: len(phrase.split())] == phrase.split()]
    return " ".join(whole[: max(lengths)]) if lengths else word


def typed(properties: Json) -> Json:
    """Properties of ours that a format holds as text, as what they are; what is no number stays as it is."""
    said: Json = {}
    for key, value in properties.items():
        if isinstance(value, str) and key in NUMBERS:
            said[key] = _number(value)
        elif isinstance(value, str) and key in LISTS:
            said[key] = [_number(part) for part in re.split(r"[\s,/]+", value.strip("[] "))]
        elif isinstance(value, str | int) and key in TRUTHS:
            said[key] = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}.get(
                str(value).strip().lower(), value
            )
        elif isinstance(value, str) and key in TEXTS:
            said[key] = value.strip()
        else:
            said[key] = value
    return said


def spelt(properties: Json) -> Json:
    """Properties with the names of ours as we write them: a Shapefile has them in capitals (`ROLE`, `Name`)."""
    lower = {key.lower() for key in properties if key.lower() in (*OURS, *NAMES)}
    return {
        key.lower() if key.lower() in lower and key.lower() not in properties else key: value
        for key, value in properties.items()
    }


def short_text(text: object, most: int = 40) -> str:
    """A description of a few words, which may say what a thing is ("LKP"); empty where it is a story."""
    said = one_line(plain_text(text), 1000) if isinstance(text, str) else ""
    return said if len(said) <= most else ""


def few_notes(notes: Sequence[str], most: int = 10) -> list[str]:
    """Notes of which many say the same of one thing each: the first ones of these, and how many more there are."""
    kinds = [_KIND.search(note) for note in notes]
    counts = Counter(kind.group(0) for kind in kinds if kind)
    seen: Counter[str] = Counter()
    kept = []
    for note, kind in zip(notes, kinds, strict=True):
        same = kind.group(0) if kind else ""
        seen[same] += 1
        if not kind or counts[same] <= most or seen[same] < most:
            kept.append(note)
        elif seen[same] == most:
            kept.append(f"{counts[same] - most + 1} more{same}")
    return kept


def _number(text: str) -> float | str:
    try:
        return float(re.sub(r"^(\d+),(\d+)$", r"\1.\2", text.strip()))
    except ValueError:
        return text


def as_geojson(document: Document, name: str) -> str:
    """The document in the words of an area file (RFC 7946), ready to be edited and read again.

    `name` is for one that has none. What it was read as must have been checked before, which drops what cannot be.
    """
    features = []
    for item in document.items:
        if item.dropped:
            continue
        properties = {"name": one_line(item.words), **item.properties} if item.words else item.properties
        features.append(json.dumps({"type": "Feature", "properties": properties, "geometry": item.geometry}))
    members: Json = {"type": "FeatureCollection", "name": document.name or name}
    for key in ("description", "outside"):
        if value := getattr(document, key):
            members[key] = value
    if document.notes:
        members["notes"] = document.notes
    head = json.dumps(members, ensure_ascii=False)[:-1]
    return head + ', "features": [\n' + ",\n".join(features) + "\n]}\n"
