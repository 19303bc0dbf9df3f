"""`roisearch-service area check FILE`: what is understood of an area file, of whatever program."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from service.errors import BadInput, Parser

if TYPE_CHECKING:
    from service.area import SearchArea
    from service.area.document import Document
    from service.places import Coordinates

EXAMPLES = """\
examples:
  roisearch-service area check map.kmz
  roisearch-service area check caltopo.json --out area.geojson     to look at it, correct it, and fly it
kinds: GeoJSON (ours, geojson.io, QGIS), CalTopo and SARTopo exports, KML, KMZ, GPX, QGroundControl .plan
"""


def main(arguments: list[str]) -> int:
    """Print what a file says, and write it as our GeoJSON if asked to; returns 0, or raises BadInput."""
    parser = Parser(
        prog="roisearch-service area",
        description="What is understood of an area file: roles, priors and their weights, what was left out and why.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog=EXAMPLES,
    )
    parser.add_argument("what", choices=("check",))
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--out", metavar="FILE", type=Path, help="write it as GeoJSON with all roles")
    parser.add_argument(
        "--config", metavar="FILE", type=Path, help="settings, for search.max_area_km2 and run.coordinates"
    )
    options = parser.parse_args(arguments)
    from service.config import read_settings
    from service.survey import read_survey

    if options.out is not None and options.out.resolve() == options.file.resolve():
        raise BadInput(f"{options.out}: --out is the file itself, which is left as it is; give another one")
    settings = read_settings(options.config)
    area, document = read_survey(options.file, settings)
    said = understood(area, document, settings.run.coordinates)
    print("\n".join(f"{name:10} {sentence}".rstrip() for name, sentence in said))
    if options.out is not None:
        from service.area.document import as_geojson

        try:
            options.out.write_text(as_geojson(document, area.name), encoding="utf-8")
        except OSError as error:
            raise BadInput(
                f"{options.out}: cannot be written ({error.strerror}); give a writable --out"
            ) from error
        print(f"written: {options.out}")
    return 0


def understood(area: SearchArea, document: Document, coordinates: Coordinates) -> list[tuple[str, str]]:
    """Pairs of a word and a sentence: format, area, priors with their share, exclusions, launch point, notes."""
    from service.area.describing import described_priors
    from service.area.projection import surface_m2
    from service.places import written

    parts = len(area.polygon.geoms)
    pieces = "" if parts == 1 else f" in {parts} parts"
    said = [
        ("file", f"{area.source}: {document.format}"),
        ("area", f"{area.name}: {surface_m2(area.ground) / 1e4:.1f} ha to search{pieces}"),
        ("outside", f"{area.outside:g}: how probable it is that the target is not in the area at all"),
    ]
    said += [("prior", sentence) for sentence in described_priors(area)]
    if not area.priors:
        said.append(("prior", "none: every place is equally likely"))
    for each in area.exclusions:
        kind = "the target may be there" if each.searchable else "not searched"
        said.append(("exclude", f"{surface_m2(each.polygon) / 1e4:.1f} ha, {kind}: {each.label}"))
    launch = area.launch
    said.append(
        ("launch", "none: the search starts at an edge" if launch is None else written(launch, coordinates))
    )
    said += [("note", note) for note in area.notes]
    return said
