"""What is refused before any reader sees it: XML that grows, archives that grow, files beyond all use."""

from __future__ import annotations

import io
import zipfile
import zlib
from typing import Any
from xml.parsers import expat

from service.area.geojson import MOST_BYTES, Where
from service.errors import BadInput

MOST_ELEMENTS = 600_000
"""A day of tracks of several teams; what becomes of them is bounded apart."""
MOST_DEPTH = 100
_MOST_NAMES = 10_000
_MAPS = (".geojson", ".json", ".gpx", ".plan")


class _Enough(Exception):
    """Says why reading stops."""


def check_xml(data: bytes, where: Where) -> str:
    """The name of the root element of an XML document that defines no entities and stays within bounds.

    KML and GPX need no document type, and only one can define entities (XML 1.0, section 4.2), the small texts
    that become gigabytes. So one with a document type is refused, before libraries are asked what they make of it.

    Raises:
        BadInput: it has a document type, is too large or too deep, or is not well-formed.
    """
    reader = expat.ParserCreate(namespace_separator=" ")
    state: dict[str, Any] = {"root": "", "depth": 0, "count": 0}

    def starts(name: str, attributes: object) -> None:
        state["root"] = state["root"] or name.rpartition(" ")[2]
        state["depth"] += 1
        state["count"] += 1
        if state["depth"] > MOST_DEPTH:
            raise _Enough(f"its elements are nested more than {MOST_DEPTH} deep; export it again")
        if state["count"] > MOST_ELEMENTS:
            raise _Enough(
                f"it has more than {MOST_ELEMENTS} elements; export only the area and what belongs to it"
            )

    def ends(name: str) -> None:
        state["depth"] -= 1

    def has_type(*_: object) -> None:
        raise _Enough("it has a document type (<!DOCTYPE), which no map needs and which may hide a trap")

    reader.StartElementHandler = starts
    reader.EndElementHandler = ends
    reader.StartDoctypeDeclHandler = has_type
    try:
        reader.Parse(data, True)
    except _Enough as reason:
        raise where.bad(str(reason)) from None
    except (expat.ExpatError, ValueError) as error:
        at = f" at line {error.lineno}" if isinstance(error, expat.ExpatError) else ""
        what = str(error).partition(":")[0]
        raise where.bad(f"not XML{at} ({what}); export the file again") from None
    return str(state["root"])


def unzip(data: bytes, where: Where) -> list[bytes]:
    """The map in an archive: of a KMZ doc.kml, or the first of the KML files at its top (OGC KML 2.3, annex C), then
    the other KML files where that one links to them; of another archive its only file of a kind that is read.

    Raises:
        BadInput: it is damaged, has no map, or one that is larger than an area file may be.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
            if len(names) > _MOST_NAMES:
                raise where.bad(f"the archive holds {len(names)} files; export only the area")
            chosen, others = _maps(names, where)
            documents = [_unpacked(archive, chosen, MOST_BYTES, where)]
            if b"NetworkLink" in documents[0]:
                for name in others:
                    left = MOST_BYTES - sum(len(each) for each in documents)
                    documents.append(_unpacked(archive, name, left, where))
            return documents
    except BadInput:
        raise
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, OSError, ValueError, EOFError):
        raise where.bad("the archive is damaged or locked; export the file again") from None


def _maps(names: list[str], where: Where) -> tuple[str, list[str]]:
    """Which file of an archive is the map, and which others belong to it if it links to them."""
    documents = [name for name in names if name.lower().endswith(".kml")]
    if documents:
        chosen = "doc.kml" if "doc.kml" in documents else min(documents, key=lambda name: name.count("/"))
        return chosen, [name for name in documents if name != chosen]
    maps = [name for name in names if name.lower().endswith(_MAPS)]
    if len(maps) == 1:
        return maps[0], []
    if any(name.lower().endswith(".shp") for name in names):
        raise where.bad("the archive holds a Shapefile; export the layer as GeoJSON in WGS84")
    if maps:
        raise where.bad(f"the archive holds {len(maps)} maps; unpack it and give one of them")
    raise where.bad("the archive holds no .kml file; export it again as KML or KMZ")


def _unpacked(archive: zipfile.ZipFile, name: str, most: int, where: Where) -> bytes:
    with archive.open(name) as stream:
        document = stream.read(most + 1)  # what it says of its size need not be true
    if len(document) > most:
        raise where.bad(
            f"the archive unpacks to more than {MOST_BYTES >> 20} MB; export only the area and what belongs to it"
        )
    return document
