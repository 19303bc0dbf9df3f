"""Tables of several aircraft: what each has of its own, and what is said of one that cannot be."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from service.cli import aircraft_flags
from service.commands.config import main as config
from service.config import Settings, changed_settings, each_aircraft, read_settings
from service.errors import BadInput
from service.evidence.cover import sensors_over
from service.evidence.observe import FramePose
from service.evidence.sensors import cell_for_all, cell_size
from service.run import run
from service.survey import survey
from tests.service.mission.flown import GRID

AREA_FILE = Path(__file__).parents[2] / "config" / "area.geojson"

TWO = """
[flight]
altitude_m = 40
[[aircraft]]
name = "north"
connect = "udpin://0.0.0.0:14540"
sources = ["cam0"]
[[aircraft]]
connect = "udpin://0.0.0.0:14541"
speed_mps = 6
system_id = 3
"""


def written(folder: Path, text: str) -> Path:
    """A settings file."""
    file = folder / "settings.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_each_aircraft_has_settings_as_if_it_flew_alone(tmp_path: Path) -> None:
    settings = read_settings(written(tmp_path, TWO), environment={})
    north, second = each_aircraft(settings).items()
    assert (north[0], second[0]) == ("north", "2")
    assert (north[1].link.connect, second[1].link.connect) == (
        "udpin://0.0.0.0:14540",
        "udpin://0.0.0.0:14541",
    )
    assert (north[1].flight.altitude_m, second[1].flight.altitude_m) == (40.0, 50.0)
    assert second[1].flight.clearance_m == north[1].flight.clearance_m + 10.0
    assert (north[1].flight.speed_mps, second[1].flight.speed_mps, second[1].link.system_id) == (8.0, 6.0, 3)
    assert not settings.mock
    assert not second[1].mock


def test_each_without_an_offset_flies_a_layer_above_the_one_before(tmp_path: Path) -> None:
    third = '\naltitude_offset_m = 15\n[[aircraft]]\nconnect = "udpin://0.0.0.0:14542"\n'
    alone = each_aircraft(read_settings(written(tmp_path, TWO + third), environment={}))
    assert [each.flight.altitude_m for each in alone.values()] == [40.0, 55.0, 65.0]


def test_without_tables_one_flies_with_the_settings_as_they_are() -> None:
    settings = read_settings(environment={})
    assert each_aircraft(settings) == {"": settings}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("14541", "14540"), "aircraft 'north' and '2' both have the connect 'udpin://0.0.0.0:14540'"),
        (('connect = "udpin://0.0.0.0:14541"', ""), "aircraft '2' has no connect and others do"),
        (("speed_mps = 6", 'name = "north"'), "two aircraft have the same name"),
        (("speed_mps = 6", 'sources = ["cam0"]'), "both have the source 'cam0'"),
        (("speed_mps = 6\n", ""), "aircraft 'north' and '2' both have the system_id '3'"),
        (
            ("speed_mps = 6", "altitude_offset_m = 90"),
            "aircraft '2': 'flight.altitude_m' = 130 is not between",
        ),
        (
            ("speed_mps = 6", "altitude_offset_m = 6"),
            "aircraft 'north' and '2' fly 6 m apart in height, which is less than the 7 m that two layers need",
        ),
        (("altitude_m = 40", 'altitude_m = 40\n[link]\nconnect = "udpin://:1"'), "'link.connect' is for one"),
        (
            ("altitude_m = 40", "altitude_m = 40\n[link]\nsystem_id = 3"),
            "'link.system_id' is for one aircraft",
        ),
        (("speed_mps", "speed"), "there is no setting 'speed' of an aircraft; there is name, connect"),
    ],
)
def test_tables_that_do_not_go_together_are_refused_in_a_sentence(
    change: tuple[str, str], said: str, tmp_path: Path
) -> None:
    text = TWO.replace(*change)
    if "system_id" in said:
        text = text.replace('sources = ["cam0"]', 'sources = ["cam0"]\nsystem_id = 3')
    with pytest.raises(BadInput, match=said.replace("[", r"\[")):
        read_settings(written(tmp_path, text), environment={})


def test_one_link_in_two_spellings_is_refused_before_anything_starts() -> None:
    flags = aircraft_flags(["udpin://0.0.0.0:14540", "udpin:0.0.0.0:14540"], None, [])
    settings = read_settings(environment={}, flags={**flags, "ground.flat": True})
    with pytest.raises(BadInput, match=re.escape("'1' and '2' both have the link udpin://0.0.0.0:14540")):
        run(AREA_FILE, None, settings)


def test_flags_make_tables_where_there_are_none_and_are_laid_over_those_that_there_are(
    tmp_path: Path,
) -> None:
    links = ["udpin://0.0.0.0:1", "udpin://0.0.0.0:2"]
    flags = aircraft_flags(links, None, [])
    alone = each_aircraft(read_settings(environment={}, flags=flags))
    assert [each.link.connect for each in alone.values()] == links
    laid = each_aircraft(read_settings(written(tmp_path, TWO), environment={}, flags=flags))
    assert list(laid) == ["north", "2"]
    assert [each.link.connect for each in laid.values()] == links
    with pytest.raises(BadInput, match="the flags are for 3 aircraft and the settings have 2"):
        read_settings(
            written(tmp_path, TWO), environment={}, flags=aircraft_flags([*links, "udpin://:3"], None, [])
        )


def test_mocks_have_the_flavours_in_turn() -> None:
    flags = aircraft_flags([], 3, ["px4", "ardupilot"])
    alone = each_aircraft(read_settings(environment={}, flags=flags))
    assert [each.demo.flavor for each in alone.values()] == ["px4", "ardupilot", "px4"]
    assert all(each.mock for each in alone.values())


def test_flags_for_one_aircraft_are_what_they_were() -> None:
    flags = aircraft_flags(["udpin://0.0.0.0:1"], None, ["ardupilot"])
    assert flags == {"link.connect": "udpin://0.0.0.0:1", "demo.flavor": "ardupilot"}
    assert each_aircraft(read_settings(environment={}, flags=flags)).keys() == {""}


@pytest.mark.parametrize(
    ("connects", "count", "flavors", "said"),
    [
        ([], 9, [], "--aircraft is a number from 1 to 8, not 9"),
        (["a", "b"], 3, [], "--aircraft 3 with --connect given 2 times"),
        ([], None, ["px4", "px4"], "say with --aircraft N how many mocks fly"),
        ([], 2, ["px4", "px4", "px4"], "--flavor is given 3 times for 2 aircraft"),
    ],
)
def test_flags_that_contradict_each_other_are_refused(
    connects: list[str], count: int | None, flavors: list[str], said: str
) -> None:
    with pytest.raises(BadInput, match=said):
        aircraft_flags(connects, count, flavors)


OWN = (
    TWO
    + """
[aircraft.sensor]
profile = "camera"
camera_pitch_deg = -60
p_tp = 0.7
"""
)


def test_each_aircraft_has_a_sensor_of_its_own_and_the_common_one_where_it_says_nothing(
    tmp_path: Path,
) -> None:
    file = written(tmp_path, OWN.replace("[flight]", "[sensor]\np_tn = 0.95\n[flight]"))
    settings = read_settings(file, environment={})
    north, second = (each.sensor for each in each_aircraft(settings).values())
    assert (north.profile, north.p_tp, north.p_tn) == ("point", 0.9, 0.95)
    assert (second.profile, second.p_tp, second.p_tn, second.camera_pitch_deg) == ("camera", 0.7, 0.95, -60.0)
    kept = json.loads(json.dumps(settings.model_dump()))  # as a journal does
    again = changed_settings(kept, {"search.planner": "survey"}, "journal")
    assert [each.sensor for each in each_aircraft(again).values()] == [north, second]
    kept["sensor"]["p_tn"] = 0.8  # what a table leaves out still follows the common one
    assert [each.sensor.p_tn for each in each_aircraft(changed_settings(kept, {}, "journal")).values()] == [
        0.8,
        0.8,
    ]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("cell_m = 5", "which all aircraft have in common: give it in [sensor]"),
        ("p_tq = 0.7", "there is no setting 'p_tq' of an aircraft's sensor; there is profile, "),
        ("p_tp = 1.7", "'aircraft.1.sensor.p_tp' = 1.7 is not possible"),
    ],
)
def test_a_sensor_of_its_own_that_cannot_be_is_refused_in_a_sentence(
    line: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=re.escape(said)):
        read_settings(written(tmp_path, OWN.replace("p_tp = 0.7", line)), environment={})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"profile": "camera", "target_size_m": 0.01}, "aircraft '2': from 40 m a target of"),
        ({"profile": "camera", "camera_pitch_deg": -5.0}, "aircraft '2': sensor.camera_pitch_deg = -5"),
        ({"horizontal_fov_deg": 20.0}, "aircraft '2': from 40 m its sensor sees 14 m of the ground, less"),
    ],
)
def test_what_no_planner_can_search_with_is_refused_with_the_name_of_the_aircraft(
    given: dict[str, Any], said: str
) -> None:
    settings = Settings.model_validate({"sensor": {"cell_m": 20.0}, "aircraft": [{}, {"sensor": given}]})
    with pytest.raises(BadInput, match=re.escape(said)):
        sensors_over(survey(AREA_FILE, None, settings)[1], settings)


def test_the_cells_are_as_small_as_the_smallest_that_one_of_them_would_have() -> None:
    narrow = {"horizontal_fov_deg": 30.0, "vertical_fov_deg": 25.0}
    both = Settings.model_validate({"aircraft": [{}, {"sensor": narrow}]})
    alike = Settings.model_validate({"aircraft": [{}, {}]})
    assert cell_for_all(alike) == cell_size(alike)
    assert cell_for_all(both) == cell_size(each_aircraft(both)["2"]) < cell_size(alike)


def test_looks_of_each_count_at_its_own_height() -> None:
    """The third flies so much higher than the first that no look of it would count as one of the first's."""
    settings = Settings.model_validate({"sensor": {"cell_m": 20.0}, "aircraft": [{}, {}, {}]})
    sensors, own = sensors_over(GRID, settings), each_aircraft(settings)
    lat, lon = GRID.frame.to_latlon([(3, 3)])[0]
    for name, alone in own.items():
        pose = FramePose(float(lat), float(lon), alone.flight.altitude_m, 0.0, 1000.0)
        assert sensors[name].footprint(pose).counts.any(), name
    high = FramePose(float(lat), float(lon), own["3"].flight.altitude_m, 0.0, 1000.0)
    assert not sensors["1"].footprint(high).counts.any()


def test_a_check_of_the_settings_names_each_aircraft(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert config(["check", str(written(tmp_path, TWO))]) == 0
    said = capsys.readouterr().out
    assert "aircraft 'north': udpin://0.0.0.0:14540, 40 m high, 8 m/s" in said
    assert "aircraft '2': udpin://0.0.0.0:14541, 50 m high, 6 m/s\n" in said
    assert config(["check", str(written(tmp_path, OWN))]) == 0
    said = capsys.readouterr().out
    assert "50 m high, 6 m/s, profile = 'camera', p_tp = 0.7, camera_pitch_deg = -60.0" in said
