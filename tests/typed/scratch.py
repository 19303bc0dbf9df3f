"""A folder with the files that the commands name."""

from __future__ import annotations

import re
import shutil
import sys
import zipfile
from pathlib import Path

from tests.service.adapters.stage import write_model
from tests.service.export.recorded import Recorder

from .pages import TOP

RUN = "20260501-140312-north-slope"
RING = "8.30,47.05 8.31,47.05 8.31,47.06 8.30,47.06 8.30,47.05"
KML = (
    '<kml xmlns="http://www.opengis.net/kml/2.2"><Placemark><name>field</name><Polygon><outerBoundaryIs><LinearRing>'
    f"<coordinates>{RING}</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark></kml>"
)


MINE = """
from roisearch import BasePlanner


class Nearest(BasePlanner):
    def choose(self, belief, state, rng):
        return [self.moves(belief, state)[0][1]]
"""
"""A planner from outside."""


def example() -> str:
    """The area file that the service's page shows."""
    page = (TOP / "service" / "README.md").read_text(encoding="utf-8")
    return re.findall(r"```json\n(.*?)```", page, re.S)[0]


def interrupted(folder: Path) -> None:
    """A run that was killed while it searched."""
    folder.mkdir(parents=True)
    recorder = Recorder(folder)
    recorder.start()
    recorder.journal.close()


def lay_out(folder: Path) -> Path:
    """All that is there before the first command of a page."""
    shutil.copytree(TOP / "config", folder / "config")
    (folder / "area.geojson").write_text(example(), encoding="utf-8")
    shutil.copy(TOP / "tests" / "service" / "area" / "exports" / "caltopo.json", folder / "caltopo.json")
    (folder / "service.toml").write_text("[flight]\naltitude_m = 30.0\n", encoding="utf-8")
    (folder / "scored.csv").write_text("score,there\n0.9,1\n0.8,1\n,1\n0.3,0\n,0\n,0\n", encoding="utf-8")
    with zipfile.ZipFile(folder / "map.kmz", "w") as packed:
        packed.writestr("doc.kml", KML)
    (folder / "mine.py").write_text(MINE, encoding="utf-8")
    write_model(folder / "best.onnx")
    interrupted(folder / "runs" / RUN)
    (folder / ".venv").symlink_to(sys.prefix)
    for name in ("tests", "roisearch", "service", "sim", "pyproject.toml", "README.md"):
        (folder / name).symlink_to(TOP / name)
    return folder
