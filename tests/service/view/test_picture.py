"""The picture of a search is made in two parts: what is shown, at once, and the drawing, elsewhere."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from service.view.replay import ReplayView
from tests.service.export.recorded import record


def test_what_a_picture_takes_long_for_is_left_to_whoever_draws_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path)
    view = ReplayView(tmp_path)
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "service.view.picture", None)  # it brings matplotlib
        draw = view.picture()
    assert draw().startswith(b"\x89PNG")
