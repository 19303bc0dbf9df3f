"""Every format of an export, opened by a reader that nobody here wrote."""

from __future__ import annotations

import asyncio
import base64
import csv
import dataclasses
import io
import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import fastkml.validator
import gpx
import gpxpy
import html5lib
import numpy as np
import pyogrio.raw
import pyproj
import pytest
import rasterio
import rasterio.warp
import shapely
from lxml import etree
from matplotlib.image import imread
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync

from service.area import leg_is_clear, read_geotiff_prior
from service.errors import BadInput
from service.export.formats import FORMATS
from service.export.gaps import gap_cells
from service.export.model import ExportedRun
from service.export.run import read_run
from service.export.wishes import Wishes
from service.places import written
from sim.autopilot.process import AutopilotProcess
from tests.service.export.recorded import EVIL, record

WISHES = Wishes()
GEOD = pyproj.Geod(ellps="WGS84")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> ExportedRun:
    """A run that is over and has found nothing."""
    return read_run(record(tmp_path_factory.mktemp("run") / "searched"))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> ExportedRun:
    """A run that has found its target."""
    return read_run(record(tmp_path_factory.mktemp("run") / "found", found=True))


def saved(run: ExportedRun, name: str, folder: Path) -> Path:
    """An export as a file."""
    path = folder / f"run{FORMATS[name].suffix}"
    path.write_bytes(FORMATS[name].write(run, WISHES))
    return path


def roles(path: Path) -> dict[str, list[dict[str, Any]]]:
    """The features of a GeoJSON file by role, as plain JSON."""
    found: dict[str, list[dict[str, Any]]] = {}
    for feature in json.loads(path.read_bytes())["features"]:
        found.setdefault(feature["properties"]["role"], []).append(feature)
    return found


def test_geojson_is_read_by_gdal_with_everything_in_its_place(found: ExportedRun, tmp_path: Path) -> None:
    path = saved(found, "geojson", tmp_path)
    meta, _, geometries, columns = pyogrio.raw.read(path)
    role = columns[list(meta["fields"]).index("role")]
    shapes = shapely.from_wkb(geometries)
    assert meta["crs"] == "EPSG:4326"
    assert shapely.is_valid(shapes).all()
    assert {*role} == {
        *("search", "exclude", "launch", "region", "gap", "track", "hit", "detection", "uncertainty", "found")
    }
    assert found.find is not None
    (place,) = shapes[role == "found"]
    assert (place.y, place.x) == pytest.approx((found.find.lat, found.find.lon), abs=1e-7)
    (ellipse,) = shapes[role == "uncertainty"]
    lon, lat = shapely.get_coordinates(ellipse).T
    azimuth, _, far = GEOD.inv(np.full_like(lon, place.x), np.full_like(lat, place.y), lon, lat)
    assert (far.max(), far.min()) == pytest.approx((40.0, 10.0), abs=0.1)
    assert azimuth[far.argmax()] % 180.0 == pytest.approx(70.0, abs=0.5)
    assert azimuth[far.argmin()] % 180.0 == pytest.approx(160.0, abs=0.5)
    (track,) = shapes[role == "track"]
    assert shapely.get_coordinates(track, include_z=True)[0] == pytest.approx(
        [found.track[0][0].lon, found.track[0][0].lat, 25.0], abs=1e-6
    )
    (area,) = shapes[role == "search"]
    assert area.symmetric_difference(found.area.polygon).area < 1e-3 * found.area.polygon.area


def test_gap_polygons_hold_exactly_the_gap_cells_and_turn_as_rfc_7946_says(
    run: ExportedRun, tmp_path: Path
) -> None:
    features = roles(saved(run, "geojson", tmp_path))["gap"]
    gaps = shapely.union_all([shapely.geometry.shape(feature["geometry"]) for feature in features])
    full = run.grid.covered > 0.999
    centres = run.frame.to_latlon(np.argwhere(full))
    assert (shapely.contains_xy(gaps, centres[:, 1], centres[:, 0]) == gap_cells(run, WISHES)[full]).all()
    for part in shapely.get_parts([shapely.geometry.shape(feature["geometry"]) for feature in features]):
        assert part.exterior.is_ccw
        assert not any(hole.is_ccw for hole in part.interiors)
    assert {"poa", "pod", "area_m2", "cells", "flyable"} <= set(features[0]["properties"])


def test_kml_is_valid_by_the_ogc_schema_and_read_by_gdal(found: ExportedRun, tmp_path: Path) -> None:
    path = saved(found, "kml", tmp_path)
    schema = etree.XMLSchema(etree.parse(Path(fastkml.validator.__file__).parent / "schema" / "ogckml22.xsd"))
    schema.assertValid(etree.parse(path))
    layers = {str(name): str(kind) for name, kind in pyogrio.list_layers(path)}
    assert {"Found here", "Flight", "Gaps to fly again", "Search area", "Launch"} <= set(layers)
    _, _, geometries, _ = pyogrio.raw.read(path, layer="Found here")
    (place,) = shapely.from_wkb(geometries)
    assert found.find is not None
    assert (place.y, place.x) == pytest.approx((found.find.lat, found.find.lon), abs=1e-7)
    _, _, geometries, _ = pyogrio.raw.read(path, layer="Flight")
    assert len(shapely.get_coordinates(shapely.from_wkb(geometries))) == len(found.track[0])


def test_gpx_keeps_to_its_schema_and_is_read_by_gpxpy(found: ExportedRun, tmp_path: Path) -> None:
    path = saved(found, "gpx", tmp_path)
    checked = gpx.validate(path)
    assert [str(issue) for issue in checked.issues] == []
    read = gpxpy.parse(path.read_text(encoding="utf-8"))
    points = [point for track in read.tracks for part in track.segments for point in part.points]
    assert len(points) == len(found.track[0])
    for point, fix in zip(points, found.track[0], strict=True):
        assert (point.latitude, point.longitude) == pytest.approx((fix.lat, fix.lon), abs=1e-7)
        assert point.time is not None
        assert point.time.timestamp() == pytest.approx(fix.time, abs=1e-3)
    kinds = [mark.type for mark in read.waypoints]
    assert (kinds.count("launch"), kinds.count("hit"), kinds.count("found")) == (1, 1, 1)


def test_descriptions_write_places_as_the_team_does(found: ExportedRun) -> None:
    in_mgrs = found.settings.run.model_copy(update={"coordinates": "mgrs"})
    run = dataclasses.replace(found, settings=found.settings.model_copy(update={"run": in_mgrs}))
    assert run.find is not None
    place = written((run.find.lat, run.find.lon), "mgrs")
    features = json.loads(FORMATS["geojson"].write(run, WISHES))["features"]
    told = {each["properties"]["role"]: each["properties"].get("place") for each in features}
    assert told["found"] == place
    assert re.fullmatch(r"\d\d[A-Z] [A-Z]{2} \d{5} \d{5}", told["gap"])
    for name in ("kml", "gpx"):
        assert place in FORMATS[name].write(run, WISHES).decode()


def test_geotiff_is_placed_by_gdal_where_the_grid_is(run: ExportedRun, tmp_path: Path) -> None:
    path = saved(run, "geotiff", tmp_path)
    frame = run.frame
    assert abs(frame.bearing_deg) > 10.0  # a grid that is not turned would prove little
    with rasterio.open(path) as raster:
        assert raster.descriptions == ("POA", "POD", "prior")
        poa, pod, prior = raster.read(masked=True)
        cells = np.argwhere(np.ones(frame.shape, dtype=bool))
        x, y = raster.transform @ (cells[:, 1] + 0.5, cells[:, 0] + 0.5)
        lon, lat = rasterio.warp.transform(raster.crs, "EPSG:4326", x, y)
    assert (poa.mask == ~run.grid.searchable).all()
    assert float(poa.sum()) + run.belief.outside == pytest.approx(1.0, abs=1e-12)
    assert (np.where(run.grid.searchable, run.poa, -1.0) == poa.filled(-1.0)).all()
    assert (np.where(run.grid.searchable, run.pod, -1.0) == pod.filled(-1.0)).all()
    assert float(prior.sum()) == pytest.approx(1.0 - run.grid.outside)
    off = frame.to_metres(np.stack([lat, lon], axis=1)) - frame.to_metres(frame.to_latlon(cells))
    assert np.abs(off).max() < 0.01


def test_the_geotiff_of_a_run_is_the_prior_of_the_next(run: ExportedRun, tmp_path: Path) -> None:
    prior = read_geotiff_prior(saved(run, "geotiff", tmp_path), run.frame, run.grid.searchable)
    assert prior == pytest.approx(run.poa / run.poa.sum(), abs=1e-6)


def test_csv_is_a_table_that_no_spreadsheet_takes_for_formulas(run: ExportedRun, tmp_path: Path) -> None:
    text = saved(run, "csv", tmp_path).read_text(encoding="utf-8-sig")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["time_utc"] for row in rows] == sorted(row["time_utc"] for row in rows)
    what = [row["what"] for row in rows]
    assert what.count("track") == len(run.track[0])
    assert what.count("detection") == 2
    first = next(row for row in rows if row["what"] == "track")
    assert (float(first["lat"]), float(first["lon"])) == pytest.approx(
        (run.track[0][0].lat, run.track[0][0].lon), abs=1e-7
    )
    assert not any(str(value).startswith(("=", "+", "@")) for row in rows for value in row.values())
    assert FORMATS["csv"].write(run, WISHES).count(b"cmd|") == 2  # what the detector calls itself


def test_html_is_whole_offline_and_harmless(run: ExportedRun, found: ExportedRun) -> None:
    for each, words in ((run, "Not found."), (found, "Found")):
        data = FORMATS["html"].write(each, WISHES)
        page = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(data.decode("utf-8"))
        assert words in "".join(page.find(".//*[@class]/strong").itertext())
        pictures = [image.get("src") for image in page.iter("img")]
        assert len(pictures) == 4
        for source in pictures:
            picture = imread(io.BytesIO(base64.b64decode(source.removeprefix("data:image/png;base64,"))))
            assert min(picture.shape[:2]) > 100
            assert picture[..., :3].std() > 0.05
        assert list(page.iter("script")) == list(page.iter("link")) == []
        text = " ".join(page.itertext())
        assert re.search(r"https?:|//", text) is None
        assert all(image.get("alt") for image in page.iter("img"))
        assert EVIL[:10] in text  # shown, as what it is: text
        assert "POD" in text
        assert re.search(r"\bROI \d|SEARCHING", text) is None, (
            "places and states are called what people call them"
        )
        assert "→ searching" in text


def test_no_gap_is_never_said_beside_ground_that_was_not_searched(run: ExportedRun) -> None:
    """No cell has so much of the probability that it counts as a gap, and half of them have not been looked at."""
    text = FORMATS["html"].write(run, Wishes(poa_above=1000.0)).decode("utf-8")
    assert "There is no gap left" not in text
    assert re.search(
        r"\d+ % of the ground was not searched at all; \d+\.\d % of the probability lies there", text
    )
    whole = replace(run, pod=np.full_like(run.pod, 0.9))
    assert "There is no gap left" in FORMATS["html"].write(whole, Wishes(poa_above=1000.0)).decode("utf-8")


def test_a_plan_is_loaded_and_uploaded_by_mavsdk_and_keeps_out_of_what_is_excluded(
    run: ExportedRun, tmp_path: Path
) -> None:
    text = FORMATS["plan"].write(run, Wishes(minutes=12.0)).decode("utf-8")

    async def load() -> tuple[Any, list[Any]]:
        with AutopilotProcess("px4", speedup=4.0) as mock:
            station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
            async with Mavsdk(station) as sdk:
                await sdk.add_any_connection(f"udpout://127.0.0.1:{mock.port}")
                system = await sdk.first_autopilot(timeout_s=60.0)
                mission = MissionRawAsync(system)
                plan = await mission.import_qgroundcontrol_mission_from_string(text)
                await mission.upload_mission(plan.mission_items)
                return plan, await mission.download_mission()

    plan, back = asyncio.run(load())
    items = plan.mission_items
    assert [item.command for item in items[:2]] == [178, 22]
    assert items[-1].command == 20
    assert {item.command for item in items[2:-1]} == {16}
    assert [(item.x, item.y, item.command) for item in back] == [(i.x, i.y, i.command) for i in items]
    legs = [run.grid.launch, *((item.x * 1e-7, item.y * 1e-7) for item in items[2:-1]), run.grid.launch]
    assert all(leg_is_clear(run.grid, here, there) for here, there in itertools.pairwise(legs))
    assert {(item.frame, item.z) for item in items[2:-1]} == {(3, 25.0)}

    fence = json.loads(text)["geoFence"]["polygons"]
    assert [polygon["inclusion"] for polygon in fence] == [True, False]
    inside, mast = (shapely.Polygon([(lon, lat) for lat, lon in polygon["polygon"]]) for polygon in fence)
    assert all(inside.contains(shapely.Point(lon, lat)) for lat, lon in legs)
    assert mast.equals_exact(run.area.exclusions[0].polygon.geoms[0], 1e-7)


def test_a_plan_goes_where_something_is_left_and_is_as_long_as_is_asked(run: ExportedRun) -> None:
    lengths = []
    for minutes in (6.0, 12.0):
        plan = json.loads(FORMATS["plan"].write(run, Wishes(minutes=minutes)))
        points = [
            (item["params"][4], item["params"][5])
            for item in plan["mission"]["items"]
            if item["command"] == 16
        ]
        metres = run.frame.to_metres([run.grid.launch, *points, run.grid.launch])
        lengths.append(float(np.hypot(*np.diff(metres, axis=0).T).sum()))
        assert lengths[-1] <= minutes * 60.0 * run.settings.flight.speed_mps
    assert lengths[0] < lengths[1]
    cells, inside = run.frame.locate(points)
    left = run.poa[tuple(cells[inside].T)]
    assert left.mean() > run.poa[run.pod > 0.0].mean()
    assert math.isclose(plan["mission"]["plannedHomePosition"][2], 500.0)


def test_there_is_no_plan_after_a_find_or_for_no_time(run: ExportedRun, found: ExportedRun) -> None:
    with pytest.raises(BadInput, match="was found"):
        FORMATS["plan"].write(found, WISHES)
    with pytest.raises(BadInput, match="more --minutes"):
        FORMATS["plan"].write(run, Wishes(minutes=0.5))
