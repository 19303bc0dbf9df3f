"""A shape that several threads ask at once."""

import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import shapely

from service.area.zone import Zone

REPOSITORY = Path(__file__).parents[3]

ASKED_AT_ONCE = """
import sys, threading
import numpy as np, shapely
from service.area.zone import Zone

random = np.random.default_rng(0)
points = random.random((400, 2)) * 200.0
legs = shapely.linestrings(np.stack([points[:200], points[200:]], axis=1))

def ask(zone, barrier, by_legs):
    barrier.wait()
    for _ in range(3):
        if by_legs:
            shapely.intersects(zone.prepared, legs)
        else:
            shapely.intersects_xy(zone.prepared, points[:, 0], points[:, 1])

for _ in range(int(sys.argv[1])):
    zone, barrier = Zone(shapely.buffer(shapely.MultiPoint(random.random((40, 2)) * 200.0), 12.0)), threading.Barrier(4)
    threads = [threading.Thread(target=ask, args=(zone, barrier, by_legs)) for by_legs in (True, False) * 2]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
print("asked")
"""


def test_threads_may_ask_at_once() -> None:
    """A search in flight asks while the ways home are looked for; one prepared shape for both ends the process."""
    done = subprocess.run(
        [sys.executable, "-c", ASKED_AT_ONCE, "500"], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, "asked\n"), done.stderr


def test_it_answers_as_the_shape_does_and_leaves_that_unprepared() -> None:
    shape = shapely.buffer(shapely.MultiPoint([(0.0, 0.0), (3.0, 1.0)]), 1.1)
    zone = Zone(shape)
    x, y = np.meshgrid(np.linspace(-2.0, 5.0, 50), np.linspace(-2.0, 3.0, 40))
    inside = shapely.contains(shape, shapely.points(x, y))
    assert 0 < inside.sum() < inside.size
    assert np.array_equal(shapely.contains_xy(zone.prepared, x, y), inside)
    assert shapely.is_prepared(zone.prepared)
    assert not shapely.is_prepared(shape)
    assert zone.prepared is zone.prepared
    assert pickle.loads(pickle.dumps(zone)).shape.equals(shape)


PREPARES = re.compile(r"shapely\.prepare|_xy\((?!\s*\S*\.prepared)")
"""Shapely's functions for points as x and y prepare the shape that they are given."""


def test_nothing_else_prepares_a_shape() -> None:
    found = [
        path.relative_to(REPOSITORY).as_posix()
        for room in ("service", "sim", "roisearch")
        for path in sorted((REPOSITORY / room).rglob("*.py"))
        if "import shapely" in (text := path.read_text("utf-8")) and PREPARES.search(text)
    ]
    assert found == ["service/area/zone.py"]
