"""How far from the initial planning point lost persons were found: published quantiles, by subject and terrain.

The figures are those of Robert J. Koester, Lost Person Behavior (dbS Productions, 2008), from the International Search
and Rescue Incident Database, as two open sources give them:

- all rows: IGT4SAR (github.com/dferguso/IGT4SAR, IPP_EuclideanDistance2.py), in miles, which names R. Koester as the
  one who provided them and leaves them out of its own copyright;
- `dementia` once more in the chapter that the publisher shows (dbs-sar.com/LPB/Dementia.pdf, p. 165), miles and
  kilometres; `hiker` once more in SAREnv (sarenv/utils/lost_person_behavior.py), kilometres. Both agree to rounding.

The other rows have one source: `CHECKED_TWICE` says which have two. Terrain that the source does not name for a subject
is not there, and not filled in. Who has the book or other figures gives `rings_m` instead.
"""

from __future__ import annotations

import difflib
import re

Rings = tuple[float, float, float, float]

TERRAINS = ("temperate mountainous", "temperate flat", "dry mountainous", "dry flat", "urban")
CHECKED_TWICE = frozenset({"dementia", "hiker"})
_METRES_PER_MILE = 1609.344
_BEGINS = 5
"""So many letters of a word say what is meant: 'mountains' is mountainous."""

_DRY = ("dry mountainous", "dry flat")
_TEMPERATE = ("temperate mountainous", "temperate flat")
_FLAT = ("temperate flat", "dry flat")
_WILD = (*_TEMPERATE, *_DRY)

_MILES: dict[str, tuple[tuple[tuple[str, ...], Rings], ...]] = {
    "aircraft": ((TERRAINS, (0.4, 0.9, 3.7, 10.4)),),
    "all terrain vehicle": ((TERRAINS, (1.0, 2.0, 3.5, 5.0)),),
    "angler": (
        (("temperate mountainous",), (0.2, 0.9, 3.4, 6.1)),
        (("temperate flat",), (0.5, 1.0, 3.4, 6.1)),
        (_DRY, (2.0, 6.0, 6.5, 8.0)),
    ),
    "autistic": ((("urban",), (0.2, 0.6, 2.4, 5.0)), (_WILD, (0.4, 1.0, 2.3, 9.5))),
    "camper": (
        (("dry mountainous",), (0.4, 1.0, 2.6, 20.3)),
        (("temperate mountainous",), (0.1, 1.4, 1.9, 24.7)),
        (_FLAT, (0.1, 0.7, 2.0, 8.0)),
    ),
    "child 1-3": (
        (_DRY, (0.4, 0.8, 2.4, 5.6)),
        (("urban",), (0.1, 0.3, 0.5, 0.7)),
        (_TEMPERATE, (0.1, 0.2, 0.6, 2.0)),
    ),
    "child 4-6": (
        (_DRY, (0.4, 1.2, 2.0, 5.1)),
        (("urban",), (0.06, 0.3, 0.6, 2.1)),
        (("temperate mountainous",), (0.1, 0.5, 0.9, 2.3)),
        (("temperate flat",), (0.1, 0.4, 0.9, 4.1)),
    ),
    "child 7-9": (
        (_DRY, (0.3, 0.8, 2.0, 4.5)),
        (("urban",), (0.1, 0.3, 0.9, 3.2)),
        (("temperate mountainous",), (0.5, 1.0, 2.0, 7.0)),
        (("temperate flat",), (0.1, 0.5, 1.3, 5.0)),
    ),
    "child 10-12": (
        (_DRY, (0.5, 1.3, 4.5, 10.0)),
        (("urban",), (0.2, 0.9, 1.8, 3.6)),
        (("temperate mountainous",), (0.5, 1.0, 2.0, 5.6)),
        (("temperate flat",), (0.3, 1.0, 3.0, 6.2)),
    ),
    "child 13-15": (
        (_DRY, (1.5, 2.0, 3.0, 7.4)),
        (("temperate mountainous",), (0.5, 1.3, 3.0, 13.3)),
        (("temperate flat",), (0.4, 0.8, 2.0, 6.2)),
    ),
    "climber": ((TERRAINS, (0.1, 1.0, 2.0, 9.2)),),
    "dementia": (
        (("temperate mountainous",), (0.2, 0.5, 1.2, 5.1)),
        (("temperate flat",), (0.2, 0.6, 1.5, 7.9)),
        (("dry mountainous",), (0.6, 1.2, 1.9, 3.8)),
        (("dry flat",), (0.3, 1.0, 2.2, 7.3)),
        (("urban",), (0.2, 0.7, 2.0, 7.8)),
    ),
    "despondent": (
        (("temperate mountainous",), (0.2, 0.7, 2.0, 13.3)),
        (("temperate flat",), (0.2, 0.5, 1.4, 10.7)),
        (("dry mountainous",), (0.5, 1.0, 2.1, 11.1)),
        (("dry flat",), (0.3, 1.2, 2.3, 12.8)),
        (("urban",), (0.06, 0.3, 0.9, 8.1)),
    ),
    "extreme sport": ((TERRAINS, (0.3, 1.6, 3.5, 8.3)),),
    "gatherer": ((_DRY, (1.0, 1.6, 3.6, 6.9)), (_TEMPERATE, (0.9, 2.0, 4.0, 8.0))),
    "hiker": (
        (("temperate mountainous",), (0.7, 1.9, 3.6, 11.3)),
        (("temperate flat",), (0.4, 1.1, 2.0, 6.1)),
        (("dry mountainous",), (1.0, 2.0, 4.0, 11.9)),
        (("dry flat",), (0.8, 1.3, 4.1, 8.1)),
    ),
    "horseback rider": ((TERRAINS, (0.2, 2.0, 5.0, 12.2)),),
    "hunter": (
        (("temperate mountainous",), (0.6, 1.3, 3.0, 10.7)),
        (("temperate flat",), (0.4, 1.0, 1.9, 8.5)),
        (("dry mountainous",), (1.3, 3.0, 5.0, 13.8)),
        (("dry flat",), (1.0, 1.9, 4.0, 7.0)),
    ),
    "intellectual disability": (
        (_DRY, (0.7, 2.5, 5.4, 38.9)),
        (("urban",), (0.2, 0.5, 2.3, 6.14)),
        (("temperate mountainous",), (0.4, 1.0, 2.0, 7.0)),
        (("temperate flat",), (0.2, 0.6, 1.3, 7.3)),
    ),
    "mental illness": (
        (("urban",), (0.2, 0.4, 0.9, 7.7)),
        (("temperate mountainous",), (0.4, 1.4, 5.1, 9.0)),
        (("temperate flat",), (0.5, 0.6, 1.4, 5.0)),
    ),
    "mountain biker": ((_DRY, (1.7, 4.0, 8.2, 18.1)), (_TEMPERATE, (1.9, 2.5, 7.0, 15.5))),
    "runner": ((TERRAINS, (0.9, 1.6, 2.1, 3.6)),),
    "skier alpine": ((TERRAINS, (0.7, 1.7, 3.0, 9.4)),),
    "skier nordic": ((_DRY, (1.2, 2.7, 4.0, 12.1)), (_TEMPERATE, (1.0, 2.2, 4.0, 12.2))),
    "snowboarder": ((TERRAINS, (1.0, 2.0, 3.8, 9.5)),),
    "snowmobiler": (
        (_DRY, (1.0, 3.0, 8.7, 18.9)),
        (("temperate flat",), (0.8, 2.9, 25.5, 59.7)),
        (("temperate mountainous",), (2.0, 4.0, 6.9, 10.0)),
    ),
    "substance abuse": ((TERRAINS, (0.3, 0.7, 2.6, 6.0)),),
}

SUBJECTS: tuple[str, ...] = tuple(_MILES)


def terrains_of(subject: str) -> tuple[str, ...]:
    """The terrains for which there are figures of a subject, one of SUBJECTS."""
    return tuple(terrain for terrains, _ in _MILES[subject] for terrain in terrains)


def rings(subject: str, terrain: str | None) -> tuple[Rings, str]:
    """The quantiles 25, 50, 75 and 95 % of the distance in metres, and what they are called.

    Args:
        subject: one of SUBJECTS, however it is spelt ("Child (4-6)", "skier-alpine").
        terrain: one of TERRAINS; None where the figures do not depend on it.

    Raises:
        ValueError: one clause that says what would be right.
    """
    name = _known(subject, SUBJECTS, "subject")
    rows = _MILES[name]
    if terrain is None:
        if len(rows) > 1:
            raise ValueError(f"'{name}' differs by terrain; give terrain: {', '.join(terrains_of(name))}")
        chosen, called = rows[0][1], name
    else:
        ground = _known(terrain, TERRAINS, "terrain")
        found = [miles for terrains, miles in rows if ground in terrains]
        if not found:
            raise ValueError(
                f"there are no figures for '{name}' on '{ground}' ground; take {', '.join(terrains_of(name))}, "
                "or give rings_m"
            )
        chosen, called = found[0], f"{name}, {ground}"
    near, half, most, nearly_all = (round(miles * _METRES_PER_MILE, 1) for miles in chosen)
    return (near, half, most, nearly_all), called


def _spelt(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", " ", text.lower()).strip()


def _known(text: str, names: tuple[str, ...], what: str) -> str:
    by_spelling = {_spelt(name): name for name in names}
    if found := by_spelling.get(_spelt(text)):
        return found
    begun = [each[:_BEGINS] for each in _spelt(text).split()]
    kinds = [name for spelt, name in by_spelling.items() if begun and all(each in spelt for each in begun)]
    near = difflib.get_close_matches(_spelt(text), by_spelling, n=1)
    if len(kinds) > 1:
        hint = f"take {', '.join(kinds)}"
    else:
        hint = f"did you mean '{by_spelling[near[0]]}'?" if near else f"there is {', '.join(kinds or names)}"
    raise ValueError(f"there is no {what} '{text[:40]}'; {hint}")
