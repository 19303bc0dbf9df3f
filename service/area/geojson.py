"""RFC 7946 GeoJSON to shapely, with errors that say which feature and what to do.

Hand-written rather than a pydantic model: a union of geometry types makes pydantic report
one failure for every type that did not match, and the operator needs one sentence.
"""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from service.errors import BadInput

WGS84_CODES = frozenset({"crs84", "crs84h", "4326", "4979"})
"""What a GeoJSON 2008 'crs' member may say; RFC 7946 removed it, QGIS and GDAL still write it."""
NEAR_CODES = {
    "4258": "ETRS89",
    "4269": "NAD83",
    "4617": "NAD83(CSRS)",
    "6318": "NAD83(2011)",
    "4283": "GDA94",
    "7844": "GDA2020",
    "6668": "JGD2011",
    "4619": "SWEREF99",
    "4171": "RGF93",
    "4674": "SIRGAS 2000",
}
"""Degrees that differ from WGS84 by less than two metres, which is less than a position is known by."""
_CRS = re.compile(r"(?:.*[:/])?(?:ogc|epsg)[:/]+(?:[\d.]*[:/]+)?(\w+)|(crs84)", re.IGNORECASE)

MOST_BYTES = 32 << 20
"""Of an area file, unpacked: a hundred times what outlines need."""
MOST_POSITIONS = 200_000
"""In one file: what a computer drew is simplified by whoever drew it, and not while an aircraft waits."""

_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_REPROJECT = "export it again in WGS84 (EPSG:4326)"


@dataclass(frozen=True)
class Where:
    """The place in the input that a message is about."""

    source: str
    part: str = ""

    def bad(self, problem: str) -> BadInput:
        """The error that says: file, feature, problem (which contains the fix)."""
        where = f"{self.source}: {self.part}" if self.part else self.source
        return BadInput(f"{where}: {problem}" + ("" if problem.endswith("?") else "."))


def quote(value: object) -> str:
    """A JSON value for a message: on one line, and short."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        BadInput: the file is missing, is a folder, may not be read, or is larger than any area.
    """
    try:
        with Path(path).open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            raise BadInput(
                f"{path}: it has more than {MOST_BYTES >> 20} MB; export only the area and what belongs to it."
            )
        return data
    except BadInput:
        raise
    except FileNotFoundError:
        raise BadInput(f"{path}: there is no such file; check the path.") from None
    except IsADirectoryError:
        raise BadInput(f"{path}: this is a folder; give the area file in it.") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{path}: cannot be read ({reason}); check the file and its permissions.") from None


def load_json(text: str, where: Where) -> Any:
    """The JSON value in a text.

    Raises:
        BadInput: not JSON, or with a text that cannot be written again.
    """
    if not text.strip():
        raise where.bad("the file is empty; draw an area and save it as GeoJSON")
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        if (error.lineno, error.colno) == (1, 1) and text[:1] not in "{[":
            start = quote(text[:20].split("\n")[0])
            raise where.bad(
                f"it begins with {start} and is neither GeoJSON nor KML nor GPX; export it as one of these"
            ) from None
        at = f"line {error.lineno}, column {error.colno}"
        raise where.bad(
            f"not JSON at {at} ({error.msg}); correct it there or export the file again"
        ) from None
    except (ValueError, RecursionError):
        raise where.bad("not usable JSON (a number too long or too many levels); export it again") from None
    if _SURROGATE.search(text) and not _is_whole(value):
        raise where.bad("a text holds half of a character (\\ud800 to \\udfff); export the file again")
    return value


def _is_whole(value: object) -> bool:
    """False when a text in the value cannot be written as UTF-8: no report could ever name it."""
    try:
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except (UnicodeEncodeError, RecursionError):
        return False
    return True


def check_crs(item: dict[str, Any], where: Where) -> str | None:
    """Refuse a 'crs' member that names anything but WGS84 (RFC 7946, section 4); a note where it is not quite that.

    Raises:
        BadInput: another coordinate reference system.
    """
    crs = item.get("crs")
    if crs is None:
        return None
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    found = _CRS.fullmatch(name.strip()[:200]) if isinstance(name, str) else None
    code = (found.group(1) or found.group(2)).lower() if found else ""
    if code in NEAR_CODES:
        return f"its degrees are {NEAR_CODES[code]}, taken as WGS84, from which they differ by less than two metres"
    if code not in WGS84_CODES:
        shown = name if name is not None else crs
        raise where.bad(f"'crs' is {quote(shown)}, but an area file is in WGS84; {_REPROJECT}")
    return None


def number(value: object) -> float | None:
    """A JSON number as float; None when it is not a number (true and false are not)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def position(value: object, where: Where) -> tuple[float, float]:
    """A GeoJSON position as (longitude, latitude); an altitude is ignored (RFC 7946, section 3.1.1).

    Raises:
        BadInput: not numbers, not finite, or out of range.
    """
    if not isinstance(value, list) or len(value) < 2:
        raise where.bad(f"{quote(value)} is not a position; write [longitude, latitude]")
    lon, lat = number(value[0]), number(value[1])
    if lon is None or lat is None:
        raise where.bad(f"{quote(value)} is not a position; write two numbers, [longitude, latitude]")
    if not (math.isfinite(lon) and math.isfinite(lat)):
        raise where.bad(f"{quote(value)} holds NaN or Infinity; give finite degrees")
    if abs(lon) > 360 or abs(lat) > 360:
        raise where.bad(
            f"{quote(value)} looks like projected coordinates in metres, not degrees; {_REPROJECT}"
        )
    if abs(lat) > 90:
        swapped = "longitude and latitude look swapped, " if abs(lon) <= 90 and abs(lat) <= 180 else ""
        raise where.bad(f"latitude {lat:g} is out of range -90..90; {swapped}write [longitude, latitude]")
    if abs(lon) > 180:
        raise where.bad(
            f"longitude {lon:g} is out of range -180..180; keep the area on one side of the antimeridian"
        )
    return lon, lat


def polygon(rings: object, where: Where) -> shapely.Polygon:
    """A GeoJSON polygon (outer ring, then holes) as a shapely one (RFC 7946, section 3.1.6).

    Raises:
        BadInput: empty, not closed, crosses itself or the antimeridian, or holes misplaced.
    """
    if not isinstance(rings, list):
        raise where.bad("its 'coordinates' must be a list of rings; export the file again")
    if not rings:
        raise where.bad("the polygon is empty; draw it again")
    shell, *holes = [_ring(ring, index, where) for index, ring in enumerate(rings)]
    shape = shapely.Polygon(shell, holes)
    if shapely.area(shapely.convex_hull(shape)) == 0:
        raise where.bad("the polygon is empty: it encloses no ground; draw it again")
    if not shapely.is_valid(shape):
        reason, _, place = shapely.is_valid_reason(shape).rstrip("]").partition("[")
        at = quote([round(float(part), 7) for part in place.split("]")[0].split()])
        if "Self-intersection" in reason:
            raise where.bad(
                f"the ring crosses or touches itself at {at}; move the corners so that it does not"
            )
        raise where.bad(f"the polygon is not valid ({reason.lower()}) at {at}; draw it again")
    return shape


def _ring(value: object, index: int, where: Where) -> NDArray[np.float64]:
    name = "the outer ring" if index == 0 else f"hole {index}"
    if not isinstance(value, list):
        raise where.bad(f"{name} must be a list of positions; export the file again")
    if not value:
        raise where.bad(f"the polygon is empty: {name} has no positions; draw it again")
    points = np.array([position(item, where) for item in value])
    if (points[0] != points[-1]).any():
        first, last = quote(points[0].round(7).tolist()), quote(points[-1].round(7).tolist())
        raise where.bad(
            f"{name} is not closed: it starts at {first} and ends at {last}; "
            "repeat the first position at the end"
        )
    if len(points) < 4:
        raise where.bad(f"{name} has {len(points)} positions; give at least 4, the last equal to the first")
    jumps = np.flatnonzero(np.abs(np.diff(points[:, 0])) > 180)
    if jumps.size:
        near = quote(points[jumps[0]].tolist())
        raise where.bad(f"{name} crosses the antimeridian after {near}; search one side of it at a time")
    return points


def line(geometry: dict[str, Any], where: Where) -> shapely.MultiLineString:
    """A GeoJSON LineString or MultiLineString as one shapely MultiLineString (RFC 7946, sections 3.1.4 and 3.1.5).

    Raises:
        BadInput: no positions, no length, or across the antimeridian.
    """
    coordinates = geometry.get("coordinates")
    lines = coordinates if geometry["type"] == "MultiLineString" else [coordinates]
    if not isinstance(lines, list) or not lines:
        raise where.bad("the line is empty; draw it again")
    parts = []
    for each in lines:
        if not isinstance(each, list) or len(each) < 2:
            raise where.bad("a line needs a list of at least two positions; draw it again")
        points = np.array([position(item, where) for item in each])
        if (np.abs(np.diff(points[:, 0])) > 180).any():
            raise where.bad("the line crosses the antimeridian; draw it on one side")
        parts.append(points)
    shape = shapely.MultiLineString(parts)
    if shape.length == 0:
        raise where.bad("the line has no length; draw it again")
    return shape


def multipolygon(geometry: dict[str, Any], where: Where) -> shapely.MultiPolygon:
    """A GeoJSON Polygon or MultiPolygon as one shapely MultiPolygon (parts may overlap: they are joined).

    Raises:
        BadInput: as `polygon`, or no part at all.
    """
    coordinates = geometry.get("coordinates")
    if geometry["type"] == "Polygon":
        return shapely.MultiPolygon([polygon(coordinates, where)])
    if not isinstance(coordinates, list):
        raise where.bad("its 'coordinates' must be a list of polygons; export the file again")
    if not coordinates:
        raise where.bad("the polygon is empty; draw it again")
    parts = [
        polygon(rings, Where(where.source, f"{where.part}, part {i}"))
        for i, rings in enumerate(coordinates, 1)
    ]
    return as_multipolygon(shapely.union_all(parts))


def as_multipolygon(shape: shapely.Geometry) -> shapely.MultiPolygon:
    """The polygons in a geometry; what has no surface (lines, points) is left out."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.MultiPolygon([part for part in parts if shapely.get_type_id(part) == 3 and part.area > 0])
