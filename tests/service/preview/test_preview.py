"""The preview: what it foresees is exact for its path, its times add up, and it says so in words and pictures."""

from __future__ import annotations

import base64
import io
from dataclasses import replace
from pathlib import Path

import html5lib
import numpy as np
import pytest
from matplotlib.image import imread

from service.area import Grid, SearchArea, leg_is_clear
from service.commands.preview import main
from service.config import FlightSettings, Settings
from service.errors import BadInput
from service.motion import motion_of
from service.preview.foresight import Foresight, foresee
from service.preview.pace import farthest_from_launch, route_seconds
from service.preview.page import figure_of
from service.preview.preview import preview
from service.preview.text import facts
from service.search import Search
from service.survey import AREA, survey
from tests.service.export.recorded import SETTINGS, field_grid

FLIGHT = FlightSettings()


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> tuple[SearchArea, Grid]:
    folder = tmp_path_factory.mktemp("field")
    field_grid(folder)
    return survey(folder / AREA, None, SETTINGS)


def ahead(grid: Grid, *, seed: int = 1, alarms: bool = True, settings: Settings = SETTINGS) -> Foresight:
    """A search of the field that lasts until a POS of 60 %."""
    rng = np.random.default_rng(seed)
    search = Search(grid, settings)
    return foresee(search, grid.start, most_s=np.inf, until=0.6, most_steps=400, rng=rng, false_alarms=alarms)


def test_the_times_of_a_path_are_those_of_the_motion_that_the_planner_plans_by(
    field: tuple[SearchArea, Grid],
) -> None:
    seen, motion = ahead(field[1], alarms=False), Search(field[1], SETTINGS).motion
    assert seen.seconds[0] == 0.0
    np.testing.assert_allclose(seen.seconds[1:], motion.arrivals(seen.cells[1:], seen.cells[0]))


def test_the_way_home_goes_around_what_is_excluded(field: tuple[SearchArea, Grid]) -> None:
    grid, detours = field[1], 0
    for row, col in np.argwhere(grid.flyable):
        lat, lon = grid.frame.to_latlon([(row, col)])[0].tolist()
        straight = np.hypot(*np.diff(grid.frame.to_metres([(lat, lon), grid.launch]), axis=0)[0])
        seconds = route_seconds(grid, FLIGHT, (lat, lon), grid.launch)
        clear = leg_is_clear(grid, (lat, lon), grid.launch)
        assert clear == (seconds == pytest.approx(motion_of(FLIGHT, 20.0).leg_seconds(float(straight))))
        detours += not clear
    assert detours > 0
    lat, lon = farthest_from_launch(grid)
    assert grid.flyable[tuple(grid.frame.to_cells([(lat, lon)])[0])]


@pytest.mark.parametrize("alarms", [False, True])
def test_pos_along_the_path_is_exact_whatever_the_detector_reports(
    field: tuple[SearchArea, Grid], alarms: bool
) -> None:
    grid = field[1]
    seen = ahead(grid, alarms=alarms)
    assert (seen.alarms > 0) == alarms
    assert seen.pos[-1] >= 0.6 > seen.pos[-2]
    missed = np.ones(grid.frame.shape)
    for cell, pos in zip(seen.cells, seen.pos, strict=True):
        missed[cell] *= 1.0 - SETTINGS.sensor.p_tp
        assert pos == pytest.approx(0.9 * (grid.prior * (1.0 - missed)).sum())
    moves = np.abs(np.diff(np.array(seen.cells), axis=0)).max(axis=1)
    assert (moves == 1).all()
    assert all(grid.flyable[cell] for cell in seen.cells)
    assert seen.when(0.3) == seen.seconds[int(np.argmax(seen.pos >= 0.3))]
    assert seen.when(0.99) is None
    assert seen.pos_at(float(seen.seconds[5])) == seen.pos[5]


def test_a_wide_footprint_looks_at_a_cell_once_a_pass(field: tuple[SearchArea, Grid]) -> None:
    wide = Settings.model_validate(
        {"sensor": {"cell_m": 20.0, "profile": "wide-angle"}, "search": {"planner": "coverage"}}
    )
    seen = ahead(field[1], alarms=False, settings=wide)
    fov = Search(field[1], wide).fov
    missed, heading, before = np.ones(field[1].frame.shape), "north", set()
    names = {(-1, 0): "north", (0, 1): "east", (1, 0): "south", (0, -1): "west"}
    for number, cell in enumerate(seen.cells):
        if number:
            last = seen.cells[number - 1]
            heading = names[cell[0] - last[0], cell[1] - last[1]]
        view = {(int(r), int(c)) for r, c in fov.cells(cell, heading, missed.shape)}
        for fresh in view - before:
            missed[fresh] *= 0.1
        before = view
    assert seen.pos[-1] == pytest.approx(0.9 * (field[1].prior * (1.0 - missed)).sum())


def test_a_preview_says_what_is_to_be_expected(field: tuple[SearchArea, Grid]) -> None:
    said: list[str] = []
    seen = preview(*field, SETTINGS, 12.0, lambda name, part: said.append(name))
    assert any("compiling" in name for name in said)
    assert any("false alarms" in name for name in said)
    assert [goal.pos for goal in seen.goals] == [0.5, 0.75, 0.95]
    assert seen.kept_percent is not None
    assert seen.kept_percent == pytest.approx(15.0 + 100.0 * seen.home.seconds / 720.0)
    assert seen.battery_s == pytest.approx(720.0 * (1.0 - seen.kept_percent / 100.0))
    assert sum(region.mass for region in seen.regions) <= 0.9 + 1e-9
    first = seen.goals[0]
    assert first.median_s is not None
    assert first.least_s is not None
    assert first.most_s is not None
    assert 0 < seen.before_s < first.least_s <= first.median_s <= first.most_s
    words = dict(facts(seen))
    assert "cannot be reached" in words["POS 95%"]  # a tenth of the probability is outside
    assert f"{seen.grid.frame.rows} x {seen.grid.frame.cols} cells of 20 m" in words["grid"]
    assert "ROI 1" in words
    assert f"{seen.kept_percent:.0f} % of the battery are kept" in words["way home"]
    assert words["batteries"].startswith(
        f"{len(seen.batteries)} of 12:00: POS {seen.batteries[0].pos:.0%} after "
    )


def test_whatever_the_legend_names_is_in_the_picture(field: tuple[SearchArea, Grid]) -> None:
    for minutes in (None, 12.0):  # a flight of two hours, beyond the picture, and a battery within it
        _, times = figure_of(preview(*field, SETTINGS, minutes, lambda name, part: None)).axes[:2]
        right = times.get_xlim()[1]
        lines = {str(line.get_label()): line for line in times.get_lines()}
        assert all(len(line.get_xdata()) for line in lines.values())
        if minutes is None:
            assert times.get_xlabel() == "minutes since take-off (one battery lasts 120)"
        else:
            assert max(lines["one battery"].get_xdata()) <= right
        assert max(lines["all that can be found"].get_ydata()) < 99.0


def test_of_several_aircraft_it_says_that_it_is_of_one(field: tuple[SearchArea, Grid]) -> None:
    seen = preview(*field, SETTINGS, None, lambda name, part: None)
    three = Settings.model_validate({"aircraft": [{"name": name} for name in ("a", "b", "c")]}).aircraft
    words = dict(facts(replace(seen, settings=SETTINGS.model_copy(update={"aircraft": three}))))
    assert words["aircraft"].startswith("what one of 3 aircraft does")


def test_a_battery_that_is_too_small_is_refused(field: tuple[SearchArea, Grid]) -> None:
    with pytest.raises(BadInput, match="2 minutes is too small"):
        preview(*field, SETTINGS, 2.0, lambda name, part: None)


def test_the_command_prints_it_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    field_grid(tmp_path)
    words = ["--area", str(tmp_path / AREA), "--cell", "30"]
    out = tmp_path / "preview.html"
    assert main([*words, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "POS 50%" in said.out
    assert "flight.max_flight_s; no --battery given" in said.out
    assert "aircraft, by the settings of all" not in said.out
    assert "compiling" in said.err
    text = out.read_text(encoding="utf-8")
    page = html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(text)
    image = next(page.iter("img"))
    assert any(meta.get("name") == "viewport" for meta in page.iter("meta"))
    picture = imread(io.BytesIO(base64.b64decode(image.get("src").removeprefix("data:image/png;base64,"))))
    assert picture[..., :3].std() > 0.05
    assert "Höhe <2>" in "".join(page.find("head/title").itertext())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--out", "preview.pdf"], "as .png or .html"),
        (["--battery", "-3"], "minutes that a full battery flies"),
        (["--area", "none.geojson"], "none.geojson"),
    ],
)
def test_bad_input_is_one_clear_sentence(tmp_path: Path, words: list[str], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        main(["--area", str(tmp_path / "a.geojson"), *words])
