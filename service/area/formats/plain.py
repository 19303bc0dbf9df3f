"""GeoJSON as it is drawn or exported: geojson.io, QGIS, GDAL, our own files (RFC 7946)."""

from __future__ import annotations

from typing import Any

from service.area.document import Document, Item, Json, one_line, spelt, typed
from service.area.geojson import Where, check_crs, quote
from service.errors import BadInput

GEOMETRY_TYPES = (
    "Polygon",
    "MultiPolygon",
    "Point",
    "MultiPoint",
    "LineString",
    "MultiLineString",
    "GeometryCollection",
)
MOST_ITEMS = 20_000
_DEEPEST = 20


def read_plain(root: Json, where: Where) -> Document:
    """The features of a FeatureCollection, a Feature, or a bare geometry.

    What is wrong with one feature is a fault of the document; it is refused as a whole only where it is no GeoJSON.

    Raises:
        BadInput: it is not GeoJSON, or not in WGS84.
    """
    document = Document(
        "GeoJSON",
        name=_text(root, "name"),
        description=_text(root, "description"),
        outside=root.get("outside"),
        plain=True,
    )
    if near := check_crs(root, where):
        document.notes.append(near)
    kind = root.get("type")
    if kind == "FeatureCollection":
        features = root.get("features")
        if not isinstance(features, list):
            raise where.bad("a FeatureCollection needs a list of 'features'; export the file again")
        for index, feature in enumerate(features):
            take_feature(document, feature, label_of(index, feature))
    elif kind == "Feature":
        take_feature(document, root, "the feature")
    elif isinstance(kind, str) and kind in GEOMETRY_TYPES:
        take_feature(document, {"type": "Feature", "geometry": root}, "the geometry")
    elif "groundStation" in root or "geometryType" in root:
        old = "this is an old plan of QGroundControl; save it again as a .plan"
        raise where.bad(old if "groundStation" in root else "this is Esri's own JSON; export it as GeoJSON")
    else:
        raise where.bad(f"not GeoJSON: 'type' is {quote(kind)}; give a FeatureCollection, Feature or Polygon")
    return document


def label_of(index: int, feature: object) -> str:
    """How messages call a feature: by its number, and its name or id."""
    name: object = None
    if isinstance(feature, dict):
        properties = feature.get("properties")
        if isinstance(properties, dict):
            said = spelt(properties)
            name = next((said[key] for key in ("name", "title") if said.get(key) not in (None, "")), None)
        name = feature.get("id") if name is None else name
    return f"features[{index}]" + ("" if name is None else f" ({quote(name)})")


def take_feature(document: Document, feature: object, label: str) -> None:
    """Add the items of one feature; what is wrong with it becomes a fault."""
    here = Where("", label)
    if feature is None:
        document.notes.append(f"{label}: left out, it is empty")
        return
    try:
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise here.bad('not a GeoJSON Feature; each item of \'features\' needs "type": "Feature"')
        check_crs(feature, here)
        properties = feature.get("properties")
        if properties is None:
            properties = {}
        if not isinstance(properties, dict):
            raise here.bad("its 'properties' must be an object or null; export the file again")
        said = {  # QGIS: all columns, all rows; geojson.io: numbers as text
            key: value for key, value in typed(spelt(properties)).items() if value is not None and value != ""
        }
        geometry = feature.get("geometry")
        if geometry is None and "role" not in said:
            document.notes.append(f"{label}: left out, it has no geometry")
            return
        words = " ".join(
            one_line(said[key]) for key in ("name", "title") if isinstance(said.get(key), str | int)
        )
        parts = simple_parts(geometry, here)
        for number, part in enumerate(parts, 1):
            check_crs(part, here)
            name = label if len(parts) == 1 else f"{label}, part {number}"
            document.items.append(Item(name, part, share_of(said, len(parts)), words))
    except BadInput as error:
        document.faults.append(str(error).removeprefix(": "))
    if len(document.items) > MOST_ITEMS:
        raise here.bad(
            f"more than {MOST_ITEMS} things are drawn; export only the area and what belongs to it"
        )


def share_of(properties: Json, parts: int) -> Json:
    """A weight is that of the whole feature: of several parts each has its share."""
    weight = properties.get("weight", 1)
    if parts == 1 or properties.get("role") not in ("prior", "ipp") or not isinstance(weight, int | float):
        return dict(properties)
    return {**properties, "weight": weight / parts}


def simple_parts(geometry: Any, where: Where, depth: int = 0) -> list[Json]:
    """The simple geometries that a geometry is made of; polygons of one MultiPolygon stay together."""
    if not isinstance(geometry, dict) or geometry.get("type") not in GEOMETRY_TYPES:
        kind = geometry.get("type") if isinstance(geometry, dict) else geometry
        raise where.bad(f"its geometry is {quote(kind)}; draw a Polygon, LineString or Point")
    if geometry["type"] == "GeometryCollection":
        inner = geometry.get("geometries")
        if not isinstance(inner, list) or depth > _DEEPEST:
            raise where.bad("a GeometryCollection needs a list of 'geometries'; export the file again")
        return [part for each in inner for part in simple_parts(each, where, depth + 1)]
    if (
        geometry["type"] == "MultiPoint"
        and isinstance(points := geometry.get("coordinates"), list)
        and points
    ):
        return [{"type": "Point", "coordinates": point} for point in points]
    return [geometry]


def _text(holder: Json, key: str) -> str:
    value = holder.get(key)
    return one_line(value, 10_000) if isinstance(value, str) else ""
