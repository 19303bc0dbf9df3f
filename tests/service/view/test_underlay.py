"""Tiles under the page's map: what is served, and what is no tiles at all."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from service.config import PageSettings
from service.errors import BadInput
from service.view.underlay import NO_UNDERLAY, open_underlay


def mbtiles(path: Path, kind: str = "png", tiles: int = 1) -> Path:
    """A file with one tile in the north-west quarter of the world."""
    database = sqlite3.connect(path)
    with database:
        database.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        database.execute(
            "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)"
        )
        database.execute("INSERT INTO metadata VALUES ('format', ?), ('attribution', 'somebody')", (kind,))
        database.executemany("INSERT INTO tiles VALUES (1, 0, 1, ?)", [(b"north-west",)] * tiles)
    database.close()
    return path


def test_tiles_of_a_file_are_counted_from_the_north(tmp_path: Path) -> None:
    underlay = open_underlay(PageSettings(mbtiles_file=str(mbtiles(tmp_path / "a.mbtiles"))))
    assert underlay.tile(1, 0, 0) == b"north-west"
    assert [underlay.tile(*at) for at in ((1, 0, 1), (1, 2, 0), (-1, 0, 0), (31, 0, 0), (2, 0, 0))] == [
        None
    ] * 5
    assert underlay.describe() == {
        "url": "/tiles/{z}/{x}/{y}",
        "own": True,
        "attribution": "somebody",
        "min_zoom": 1,
        "max_zoom": 1,
    }


@pytest.mark.parametrize(
    ("kind", "tiles", "words"), [("pbf", 1, "holds 'pbf' tiles"), ("png", 0, "holds no tiles")]
)
def test_a_file_that_cannot_be_shown_is_told(tmp_path: Path, kind: str, tiles: int, words: str) -> None:
    with pytest.raises(BadInput, match=words):
        open_underlay(PageSettings(mbtiles_file=str(mbtiles(tmp_path / "b.mbtiles", kind, tiles))))


def test_a_missing_file_and_one_that_is_no_database_are_told(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="there is no file"):
        open_underlay(PageSettings(mbtiles_file=str(tmp_path / "none")))
    (tmp_path / "text").write_text("no database, " * 100)
    with pytest.raises(BadInput, match="is no MBTiles file"):
        open_underlay(PageSettings(mbtiles_file=str(tmp_path / "text")))


@pytest.mark.parametrize(
    ("url", "source"),
    [
        ("https://tiles.example.org/{z}/{x}/{y}.png", "https://tiles.example.org"),
        ("https://{s}.tiles.example.org:8443/{z}/{x}/{y}.png?k=1", "https://*.tiles.example.org:8443"),
    ],
)
def test_the_browser_is_allowed_the_tiles_server_and_nothing_more(url: str, source: str) -> None:
    assert open_underlay(PageSettings(tiles_url=url)).source == source


@pytest.mark.parametrize(
    "url",
    [
        "https://tiles.example.org/{z}/{x}.png",
        "ftp://tiles.example.org/{z}/{x}/{y}",
        "/{z}/{x}/{y}",
        "https://a; script-src */{z}/{x}/{y}",
        "https://a'self'/{z}/{x}/{y}",
    ],
)
def test_what_is_no_template_is_refused(url: str) -> None:
    with pytest.raises(BadInput, match="is no template"):
        open_underlay(PageSettings(tiles_url=url))


def test_without_settings_there_is_nothing() -> None:
    assert open_underlay(PageSettings()) is NO_UNDERLAY
    assert NO_UNDERLAY.describe() is None
