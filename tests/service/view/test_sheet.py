"""Map sheets: true north is up whatever way the grid is turned, and what makes a map is on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from service.survey import AREA, survey
from service.view.sheet import Sheet, heat_norm
from tests.service.export.recorded import SETTINGS, field_grid


def test_north_is_up_and_cells_lie_where_the_frame_has_them(tmp_path: Path) -> None:
    sheet = Sheet(Figure().subplots(), field_grid(tmp_path))
    frame = sheet.grid.frame
    assert abs(frame.bearing_deg) > 20.0, "a grid that is not turned shows nothing"
    here, north = sheet.at([(frame.lat, frame.lon), (frame.lat + 0.001, frame.lon)])
    assert north[1] - here[1] == pytest.approx(111.0, abs=1.0)
    assert abs(north[0] - here[0]) < 0.01
    cells = [(0.0, 0.0), (3.0, 5.0)]
    np.testing.assert_allclose(
        sheet.of_cells(np.array(cells) + 0.5), sheet.at(frame.to_latlon(cells).tolist()), atol=1e-6
    )


def test_a_sheet_has_names_coordinates_a_scale_a_north_mark_and_the_launch_point(tmp_path: Path) -> None:
    grid = field_grid(tmp_path)
    area = survey(tmp_path / AREA, None, SETTINGS)[0]
    axes = Figure().subplots()
    sheet = Sheet(axes, grid, area)
    sheet.finish()
    words = {text.get_text() for text in axes.texts}
    assert {"N", "100 m", "mast"} <= words
    ticks = [float(label.get_text().rstrip("°")) for label in axes.get_yticklabels()]
    assert len(ticks) >= 2
    assert all(abs(tick - 47.0) < 0.01 for tick in ticks)
    (launch,) = sheet.at([grid.launch])
    assert (sheet.low < launch).all()
    assert (launch < sheet.high).all()


def test_a_likely_place_is_named_once(tmp_path: Path) -> None:
    """A name of the file that a region bears is not written beside it again."""
    grid = field_grid(tmp_path)
    labels = np.zeros(grid.frame.shape, dtype=int)
    labels[1:3, 1:3], labels[4, 4] = 1, 2
    for names, expected in (
        ((), {"ROI 1", "ROI 2", "mast"}),
        (("mast, north", "gully"), {"mast, north", "gully"}),
    ):
        axes = Figure().subplots()
        sheet = Sheet(axes, grid, survey(tmp_path / AREA, None, SETTINGS)[0])
        sheet.regions(labels, names)
        sheet.finish()
        words = [text.get_text() for text in axes.texts]
        assert expected <= set(words)
        assert ("mast" in words) == ("mast" in expected)


def test_the_belief_after_a_find_can_still_be_told_apart() -> None:
    """One cell holds nearly all; three decades below it there would be nothing."""
    shown = np.full((10, 10), 1e-6)
    shown[3:5] = 1e-5
    shown[0, 0] = 0.9999
    norm = heat_norm(shown)
    assert norm(shown[9, 9]) >= 0.0
    assert norm(shown[3, 3]) - norm(shown[9, 9]) > 0.1
    even = heat_norm(np.full((4, 4), 1.0 / 16.0))
    assert even.vmax is not None
    assert even.vmin is not None
    assert even.vmax / even.vmin == pytest.approx(1000.0)
