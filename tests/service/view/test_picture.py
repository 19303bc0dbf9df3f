"""The picture of a search is made in two parts: what is shown, at once, and the drawing, elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from service.export.pictures import draw_maps
from service.export.run import read_run
from service.view import picture
from service.view.replay import ReplayView
from service.view.sheet import TRACK
from tests.service.export.recorded import record, record_two


def test_what_a_picture_takes_long_for_is_left_to_whoever_draws_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path)
    view = ReplayView(tmp_path)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "service.view.picture", None)  # it brings matplotlib
        draw = view.picture()
    assert draw().startswith(b"\x89PNG")


def test_pictures_have_the_tracks_of_all_aircraft_and_no_line_between_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, drawn = record_two(tmp_path), []

    def keep(figure: Figure) -> bytes:
        drawn.append(figure)
        return b""

    # what is drawn can be told from lines, and hardly from pixels
    monkeypatch.setattr(picture, "_png", keep)
    ReplayView(folder).picture()()
    draw_maps(read_run(folder))
    assert len(drawn) == 3
    for figure in drawn:
        axes = figure.axes[0]
        tracks = [each for each in axes.lines if each.get_color() == TRACK]
        assert [len(each.get_xdata()) for each in tracks] == [4, 3]
        assert axes.get_legend_handles_labels()[1].count("track") == 1
