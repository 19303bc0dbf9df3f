"""News as it comes through the door: a GeoJSON feature (RFC 7946), checked, and what it says about the ground."""

from __future__ import annotations

import difflib
import math
from typing import Annotated, Any, Literal, Self

import numpy as np
import shapely
from pydantic import ConfigDict, Field, model_validator

from service.area import Grid
from service.area.geojson import Where, multipolygon, position
from service.area.geojson import line as read_line
from service.errors import BadInput, shown
from service.evidence.reports import DoorModel
from service.news.bearing import FieldNews, clue_factors, searched_pod, told_cells

SCHEMA_ID = "urn:roisearch:news:1"
MOST_CELLS = 200_000
"""So many cells can one piece of news speak of; the journal keeps each of them."""
FARTHEST_M = 1000.0
"""So far from the area and its launch point nothing is flown over that could be excluded."""
_SIGMAS = 8.0
"""A clue says nothing any more at so many times its sigma."""
_METRES_PER_DEGREE = 111_195.0
_NEAR_MISS = 0.8


class Told(DoorModel):
    """What maps add of their own, such as a name and a colour, is nothing to us."""

    model_config = ConfigDict(extra="ignore")


class Clue(Told):
    """Something that bears on where the target is."""

    role: Literal["clue"]
    bayes_factor: float = Field(
        ge=1e-3,
        le=1e3,
        description="how many times likelier this is to be met with if the target is there than if it is far "
        "from there; below 1 it speaks against the place",
    )
    sigma_m: float | None = Field(
        default=None, gt=0, le=1e5, description="how far from a point or a line it still counts, metres"
    )
    words: str = Field(default="", max_length=200, description="what it is, for people")


class Searched(Told):
    """Ground that others have searched in vain."""

    role: Literal["searched"]
    pod: float = Field(
        gt=0, lt=1, description="probability that they would have found a target that was there"
    )
    words: str = Field(default="", max_length=200, description="who searched it, for people")


class Excluded(Told):
    """Ground that must not be flown over from now on."""

    role: Literal["exclude"]
    words: str = Field(default="", max_length=200, description="why, for people")


class Refuted(Told):
    """A part of the area file's prior that proved wrong, such as a phone fix; it has no geometry."""

    role: Literal["refute"]
    prior: str = Field(min_length=1, max_length=200, description="its name in the area file")
    words: str = Field(default="", max_length=200, description="why, for people")


class Shape(Told):
    """A geometry as RFC 7946 has it, longitude first."""

    type: Literal["Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon"]
    coordinates: list[Any] = Field(max_length=10_000)


class NewsRequest(DoorModel):
    """A piece of news: a GeoJSON feature. Its `id`, if it has one, keeps it from being counted twice."""

    model_config = ConfigDict(extra="ignore", frozen=True, title="News")

    type: Literal["Feature"]
    id: str | None = Field(default=None, min_length=1, max_length=64)
    geometry: Shape | None = None
    properties: Annotated[Clue | Searched | Excluded | Refuted, Field(discriminator="role")]

    @model_validator(mode="before")
    @classmethod
    def _one_feature(cls, told: Any) -> Any:
        """What maps export: a collection around one feature, numbers for ids, and properties of their own."""
        if isinstance(told, dict) and told.get("type") == "FeatureCollection":
            features = told.get("features")
            if not isinstance(features, list) or len(features) != 1:
                raise ValueError("news come one by one: send each feature of the collection by itself")
            told = features[0]
        if isinstance(told, dict) and type(told.get("id")) is int:
            told = {**told, "id": str(told["id"])}
        if isinstance(told, dict):
            _refuse_near_misses(told.get("properties"))
        return told

    @model_validator(mode="after")
    def _it_can_be(self) -> Self:
        if self.id in (".", ".."):
            raise ValueError(f"the id {self.id!r} cannot stand in an address; give it another one")
        said = self.properties
        if isinstance(said, Refuted):
            return self
        if self.geometry is None:
            raise ValueError(f"news of the role {said.role!r} needs a geometry")
        kind = self.geometry.type
        flat = kind in ("Polygon", "MultiPolygon")
        if not isinstance(said, Clue) and not flat:
            what = "an exclusion" if isinstance(said, Excluded) else "ground that was searched"
            raise ValueError(f"{what} is a Polygon or a MultiPolygon, not a {kind}")
        if isinstance(said, Clue) and flat == (said.sigma_m is not None):
            raise ValueError(
                "a clue in a polygon has no sigma_m"
                if flat
                else f"a clue at a {kind} needs a sigma_m in metres"
            )
        try:
            self.shape()
        except BadInput as error:
            raise ValueError(str(error)) from None
        return self

    def shape(self) -> shapely.Geometry:
        """The geometry in degrees, x = longitude. Raises BadInput."""
        assert self.geometry is not None
        where, kind = Where("the news", "its geometry"), self.geometry.type
        whole = self.geometry.model_dump()
        if kind == "Point":
            return shapely.Point(position(self.geometry.coordinates, where))
        if kind == "MultiPoint":
            if not self.geometry.coordinates:
                raise where.bad("a MultiPoint has no position; give one or more")
            return shapely.MultiPoint([position(each, where) for each in self.geometry.coordinates])
        return read_line(whole, where) if "Line" in kind else multipolygon(whole, where)

    def news(self, grid: Grid, name: str) -> FieldNews:
        """What it says about a grid, under a name. Raises BadInput when that is nothing, or too much.

        An exclusion says nothing of cells; it may lie beside the area, on the way home.
        """
        said = self.properties
        if isinstance(said, Refuted):
            return _refuted(grid, said, name)
        shape = self.shape()
        cells, told = np.empty((0, 2), dtype=np.int64), np.empty(0)
        off = apart_m(grid, shape)  # what lies on the other side of the earth is projected into the area
        if isinstance(said, Excluded):
            if off > FARTHEST_M:
                raise BadInput(
                    f"the exclusion lies {off / 1000.0:,.0f} km from the area and its launch point, at most "
                    f"{FARTHEST_M / 1000.0:g} km is flown over; are longitude and latitude swapped?"
                )
        elif isinstance(said, Clue) and off <= FARTHEST_M + _SIGMAS * (said.sigma_m or 0.0):
            values = clue_factors(grid.frame, shape, said.bayes_factor, said.sigma_m)
            cells, told = told_cells(values, grid.searchable, 1.0)
        elif isinstance(said, Searched) and off <= FARTHEST_M:
            cells, told = told_cells(searched_pod(grid.frame, shape, said.pod), grid.searchable, 0.0)
        if not len(cells) and not isinstance(said, Excluded):
            raise BadInput(
                "the news is about no ground that is searched; are longitude and latitude swapped?"
            )
        if len(cells) > MOST_CELLS:
            raise BadInput(
                f"the news is about {len(cells)} cells, at most {MOST_CELLS} are taken; make it smaller"
            )
        middle = shape.centroid
        return FieldNews(name, said.role, said.words, (middle.y, middle.x), cells, told, shape)


_OF_ROLES: dict[str, type[DoorModel]] = {
    "clue": Clue,
    "searched": Searched,
    "exclude": Excluded,
    "refute": Refuted,
}


def _refuse_near_misses(properties: Any) -> None:
    """Raises ValueError for a property that is nearly one of ours, or one of another role: it would be lost."""
    if not isinstance(properties, dict) or (model := _OF_ROLES.get(str(properties.get("role")))) is None:
        return  # which is complained of anyway
    ours = {name for each in _OF_ROLES.values() for name in each.model_fields}
    for name in properties.keys() - model.model_fields.keys():
        if name in ours:
            raise ValueError(f"a piece of news of the role {properties['role']!r} has no {name!r}")
        if near := difflib.get_close_matches(str(name).lower(), sorted(ours), n=1, cutoff=_NEAR_MISS):
            raise ValueError(f"there is no property {shown(str(name))}; did you mean {near[0]!r}?")


def _refuted(grid: Grid, said: Refuted, name: str) -> FieldNews:
    """What is not assumed any more. Raises BadInput when nothing of that name was."""
    known = grid.prior_places
    if said.prior not in known:
        there = f"there is {', '.join(map(shown, known))}" if known else "its prior has no parts"
        raise BadInput(f"there is no prior {shown(said.prior)} in the area file; {there}")
    nothing = np.empty((0, 2), dtype=np.int64), np.empty(0)
    return FieldNews(name, "refute", said.words, known[said.prior], *nothing, prior=said.prior)


def apart_m(grid: Grid, shape: shapely.Geometry) -> float:
    """About how far a place (degrees, x = longitude) is from all that lies between a grid's ground and its launch
    point, in metres; measured in degrees, where no place is another one's image."""
    frame, (lat, lon) = grid.frame, grid.launch
    ground = frame.from_metres(shapely.get_coordinates(shapely.convex_hull(grid.outline)))[:, ::-1]
    hull = shapely.MultiPoint([*ground.tolist(), (lon, lat)]).convex_hull
    around = 360.0 * round((lon - shape.centroid.x) / 360.0)
    scale = np.array([math.cos(math.radians(lat)), 1.0])
    near, there = (
        shapely.transform(each, lambda points, by=by: (points + np.array([by, 0.0])) * scale)
        for each, by in ((hull, 0.0), (shape, around))
    )
    return float(shapely.distance(near, there)) * _METRES_PER_DEGREE


def refuse_other(news: FieldNews, before: FieldNews, *, stands: bool) -> None:
    """Raises BadInput when an id comes again with other news, or after its news were taken back: none may be lost."""
    told = f"news {shown(news.id)}"
    if not news.says_as(before):
        raise BadInput(f"{told} says something else than it did before; tell it under an id of its own")
    if not stands:
        raise BadInput(f"{told} was taken back; to tell it once more, give it another id")


EXAMPLES: dict[str, dict[str, Any]] = {
    "a clue at a point": {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [-4.7402, 56.6093]},
        "properties": {"role": "clue", "bayes_factor": 20, "sigma_m": 80, "words": "glove, the right size"},
    },
    "ground that a team has searched": {
        "type": "Feature",
        "id": "team-3-1",
        "geometry": {
            "type": "Polygon",
            "coordinates": [
                [[-4.742, 56.608], [-4.739, 56.608], [-4.739, 56.6095], [-4.742, 56.6095], [-4.742, 56.608]]
            ],
        },
        "properties": {"role": "searched", "pod": 0.7, "words": "team 3, along the burn"},
    },
    "ground not to fly over": {
        "type": "Feature",
        "geometry": {
            "type": "Polygon",
            "coordinates": [
                [[-4.743, 56.609], [-4.742, 56.609], [-4.742, 56.61], [-4.743, 56.61], [-4.743, 56.609]]
            ],
        },
        "properties": {"role": "exclude", "words": "helicopter landing site"},
    },
    "a prior that proved wrong": {
        "type": "Feature",
        "geometry": None,
        "properties": {"role": "refute", "prior": "phone fix", "words": "it was of another phone"},
    },
}
"""News that the schema shows, by what they say."""


def news_schema() -> dict[str, Any]:
    """The schema of a piece of news as JSON Schema (draft 2020-12), with examples."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": SCHEMA_ID}
    return {**head, **NewsRequest.model_json_schema(), "examples": list(EXAMPLES.values())}
