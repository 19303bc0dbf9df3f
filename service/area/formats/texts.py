"""The text in a file's bytes, whatever wrote it: encodings, and the slips in XML that map programs live with."""

from __future__ import annotations

import re

from service.area.geojson import Where

_MARKS = (
    (b"\xff\xfe\x00\x00", "utf-32"),
    (b"\x00\x00\xfe\xff", "utf-32"),
    (b"\xff\xfe", "utf-16"),
    (b"\xfe\xff", "utf-16"),
)
_WINDOWS = "cp1252"
"""What text is that is no UTF-8 and says nothing of itself: older programs on Windows, here and in the Americas."""

_ENCODING = re.compile(
    r"(utf-?8|us-ascii|iso-?8859-\d{1,2}|latin-?1|windows-12\d\d|cp12\d\d|koi8-[ru]|macintosh"
    r"|gbk|gb2312|gb18030|big5|shift_jis|euc-(jp|kr))",
    re.IGNORECASE,
)
"""Those that an XML declaration may name: python knows others, which are no encodings of text."""
_DECLARATION = re.compile(r"^\s*<\?xml\b[^>]{0,300}\?>")
_DECLARED = re.compile(rb"^\s*<\?xml\b[^>]{0,200}\bencoding\s*=\s*[\"']([\w.-]{1,40})[\"']")

_BARE = re.compile(r"&(?!(?:#\d{1,7}|#x[0-9a-fA-F]{1,6}|amp|lt|gt|quot|apos);)")
_PREFIX = re.compile(r"[</\s]([A-Za-z_][\w.-]{0,30}):[A-Za-z_]")
_ROOT = re.compile(r"<([A-Za-z_][\w.:-]{0,60})")
_GOOGLE = "http://www.google.com/kml/ext/2.2"

_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"SQLite format 3\x00", "a database, such as a GeoPackage; export the layer as GeoJSON in WGS84"),
    (b"\x00\x00\x27\x0a", "a Shapefile; export the layer as GeoJSON in WGS84"),
    (b"\x1f\x8b", "packed with gzip; unpack it and give the file in it"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive; unpack it and give the file in it"),
    (b"Rar!", "a RAR archive; unpack it and give the file in it"),
    (b"%PDF", "a PDF, a picture of a map; export the map itself as KML, GPX or GeoJSON"),
    (b"\x89PNG", "a picture; export the map itself as KML, GPX or GeoJSON"),
    (b"\xff\xd8\xff", "a picture; export the map itself as KML, GPX or GeoJSON"),
    (b"II*\x00", "a raster; give the area as GeoJSON, and a raster of probabilities with --prior"),
    (b"MM\x00*", "a raster; give the area as GeoJSON, and a raster of probabilities with --prior"),
    (b"QGC WPL", "a list of waypoints, which draws no area; save a .plan, or export KML"),
    (b"#saved by", "a polygon or fence of Mission Planner; draw the area as KML, GPX or GeoJSON"),
    (b"POLYGON", "well-known text; export it as GeoJSON"),
    (b"MULTIPOLYGON", "well-known text; export it as GeoJSON"),
)
_FIT = b".FIT"


def refuse_others(data: bytes, where: Where) -> None:
    """Refuse, by its first bytes, what a team has and no reader here reads.

    Raises:
        BadInput: it is such a file.
    """
    start = data[:64].lstrip(b" \t\r\n")
    for mark, what in _OTHERS:
        if data.startswith(mark) or start.startswith(mark):
            raise where.bad(f"this is {what}")
    if data[8:12] == _FIT:
        raise where.bad("this is a FIT file of a watch; export it as GPX")
    if start.lower().startswith((b"<!doctype html", b"<html")):
        raise where.bad(
            "this is a web page and no map; download the file again, signed in where that is needed"
        )


def json_text(data: bytes) -> tuple[str, list[str]]:
    """The text of a JSON file, and notes on how it was read: UTF-8 (RFC 8259, section 8.1), or what it seems to be."""
    return _decoded(data, None)


def xml_text(data: bytes) -> tuple[str, list[str]]:
    """The text of an XML file in its declared encoding, without its declaration, and notes on how it was read."""
    declared = _DECLARED.match(data[:300])
    name = declared.group(1).decode("ascii") if declared else None
    text, notes = _decoded(data, name if name and _ENCODING.fullmatch(name) else None)
    return _DECLARATION.sub("", text, count=1).lstrip("\ufeff"), notes


def _decoded(data: bytes, declared: str | None) -> tuple[str, list[str]]:
    for mark, name in _MARKS:
        if data.startswith(mark):
            return data.decode(name, errors="replace"), []
    try:
        return data.decode("utf-8-sig" if declared is None else declared).lstrip("\ufeff"), []
    except (UnicodeDecodeError, LookupError):
        note = "its text is no UTF-8: names are read as Windows-1252, look whether they are right"
        return data.decode(_WINDOWS, errors="replace"), [note]


def mended_xml(text: str) -> str:
    """XML that lacks what a strict reader asks for, as Google Earth takes it: prefixes that nobody declared, and an
    ampersand that stands for itself. Call it only for what is not well-formed as it is."""
    text = _BARE.sub("&amp;", text)
    used = set(_PREFIX.findall(text)) - set(re.findall(r"xmlns:([\w.-]{1,31})\s*=", text)) - {"xml", "xmlns"}
    spaces = "".join(
        f' xmlns:{prefix}="{_GOOGLE if prefix == "gx" else f"urn:undeclared:{prefix}"}"'
        for prefix in sorted(used)[:50]
    )
    return _ROOT.sub(lambda root: root.group(0) + spaces, text, count=1)
