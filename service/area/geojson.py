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

WGS84_NAMES = frozenset({"crs84", "urn:ogc:def:crs:ogc::crs84", "urn:ogc:def:crs:ogc:1.3:crs84"}) | frozenset(
    {"ogc:crs84", "epsg:4326", "urn:ogc:def:crs:epsg::4326", "http://www.opengis.net/def/crs/ogc/1.3/crs84"}
)
"""What a GeoJSON 2008 'crs' member may say; RFC 7946 removed it, QGIS and GDAL still write it."""

_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_UTF16_OR_32 = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")
_REPROJECT = "export it again in WGS84 (EPSG:4326)"


@dataclass(frozen=True)
class Where:
    """The place in the input that a message is about."""

    source: str
    part: str = ""

    def bad(self, problem: str) -> BadInput:
        """The error that says: file, feature, problem (which contains the fix)."""
        where = f"{self.source}: {self.part}" if self.part else self.source
        return BadInput(f"{where}: {problem}.")


def quote(value: object) -> str:
    """A JSON value for a message: on one line, and short."""
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        BadInput: the file is missing, is a folder, or may not be read.
    """
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        raise BadInput(f"{path}: there is no such file; check the path.") from None
    except IsADirectoryError:
        raise BadInput(f"{path}: this is a folder; give the GeoJSON file in it.") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInput(f"{path}: cannot be read ({reason}); check the file and its permissions.") from None


def load_json(data: bytes, where: Where) -> dict[str, Any]:
    """The JSON object in `data`: UTF-8, with or without a byte order mark (RFC 8259, section 8.1).

    Raises:
        BadInput: not UTF-8, not JSON, or not an object.
    """
    if data.startswith(_UTF16_OR_32):
        raise where.bad("the file is UTF-16 or UTF-32; save it as UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise where.bad(f"byte {error.start} is not UTF-8; save the file as UTF-8") from None
    if not text.strip():
        raise where.bad("the file is empty; draw an area and save it as GeoJSON")
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        at = f"line {error.lineno}, column {error.colno}"
        raise where.bad(
            f"not JSON at {at} ({error.msg}); correct it there or export the file again"
        ) from None
    except (ValueError, RecursionError):
        raise where.bad("not usable JSON (a number too long or too many levels); export it again") from None
    if _SURROGATE.search(text) and not _is_whole(value):
        raise where.bad("a text holds half of a character (\\ud800 to \\udfff); export the file again")
    if not isinstance(value, dict):
        raise where.bad(
            "not GeoJSON: the top level must be an object with a 'type', such as FeatureCollection"
        )
    return value


def _is_whole(value: object) -> bool:
    """False when a text in the value cannot be written as UTF-8: no report could ever name it."""
    try:
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except (UnicodeEncodeError, RecursionError):
        return False
    return True


def check_crs(item: dict[str, Any], where: Where) -> None:
    """Refuse a 'crs' member that names anything but WGS84 (RFC 7946, section 4).

    Raises:
        BadInput: another coordinate reference system.
    """
    crs = item.get("crs")
    if crs is None:
        return
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str) or name.strip().lower() not in WGS84_NAMES:
        shown = name if name is not None else crs
        raise where.bad(f"'crs' is {quote(shown)}, but an area file is in WGS84; {_REPROJECT}")


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
        polygon(rings, Where(where.source, f"{where.part}, part {i}")) for i, rings in enumerate(coordinates)
    ]
    return as_multipolygon(shapely.union_all(parts))


def as_multipolygon(shape: shapely.Geometry) -> shapely.MultiPolygon:
    """The polygons in a geometry; what has no surface (lines, points) is left out."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.MultiPolygon([part for part in parts if shapely.get_type_id(part) == 3 and part.area > 0])
