"""What lies under the page's map: tiles from an MBTiles file of this machine, from a server, or nothing."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from service.config import PageSettings
from service.errors import BadInput

KINDS = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
DEEPEST = 30


@dataclass(frozen=True)
class Underlay:
    """Where the page gets its tiles.

    Attributes:
        url: template with {z}, {x} and {y}; empty when there are none.
        source: the origin that the browser must be allowed to load from; empty for our own.
        file: the MBTiles file that `tile` reads, or None.
    """

    url: str = ""
    source: str = ""
    attribution: str = ""
    zooms: tuple[int, int] = (0, 19)
    kind: str = "image/png"
    file: Path | None = None

    def describe(self) -> dict[str, Any] | None:
        """What the page has to know, or None when there are no tiles."""
        if not self.url:
            return None
        least, most = self.zooms
        return {
            "url": self.url,
            "own": self.file is not None,
            "attribution": self.attribution,
            "min_zoom": least,
            "max_zoom": most,
        }

    def tile(self, z: int, x: int, y: int) -> bytes | None:
        """A tile of the file by its column and its row from the north, or None when it has none there."""
        if self.file is None or not (0 <= z <= DEEPEST and 0 <= x < 1 << z and 0 <= y < 1 << z):
            return None
        database = sqlite3.connect(f"{self.file.absolute().as_uri()}?mode=ro", uri=True)
        try:
            row = database.execute(
                "SELECT tile_data FROM tiles WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (z, x, (1 << z) - 1 - y),  # MBTiles counts rows from the south
            ).fetchone()
        finally:
            database.close()
        return None if row is None else bytes(row[0])


NO_UNDERLAY = Underlay()


def open_underlay(page: PageSettings) -> Underlay:
    """The underlay of these settings. Raises BadInput when the file is no MBTiles or the URL is no template."""
    if page.mbtiles_file:
        return _read_mbtiles(Path(page.mbtiles_file), page.tiles_attribution)
    if not page.tiles_url:
        return NO_UNDERLAY
    parts = urlsplit(page.tiles_url)
    host = parts.netloc.replace("{s}.", "*.")
    plain = all(letter.isascii() and (letter.isalnum() or letter in ".-:*[]") for letter in host)
    complete = all(mark in page.tiles_url for mark in ("{z}", "{x}", "{y}"))
    if parts.scheme not in ("http", "https") or not host or not plain or not complete:
        raise BadInput(
            f"page.tiles_url: '{page.tiles_url}' is no template such as https://tiles.example.org/{{z}}/{{x}}/{{y}}.png"
        )
    return Underlay(page.tiles_url, f"{parts.scheme}://{host}", page.tiles_attribution)


def _read_mbtiles(file: Path, attribution: str) -> Underlay:
    if not file.is_file():
        raise BadInput(f"page.mbtiles_file: there is no file {file}")
    database = sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)
    try:
        said = {str(name): str(value) for name, value in database.execute("SELECT name, value FROM metadata")}
        least, most = database.execute("SELECT min(zoom_level), max(zoom_level) FROM tiles").fetchone()
    except sqlite3.Error as error:
        raise BadInput(f"page.mbtiles_file: {file} is no MBTiles file ({error})") from error
    finally:
        database.close()
    kind = KINDS.get(said.get("format", "png"))
    if kind is None or least is None:
        what = "holds no tiles" if least is None else f"holds '{said['format']}' tiles"
        raise BadInput(f"page.mbtiles_file: {file} {what}; the page shows PNG, JPEG and WebP")
    shown = attribution or said.get("attribution", "")
    return Underlay("/tiles/{z}/{x}/{y}", "", shown, (int(least), int(most)), kind, file)
