"""Integration tests measure flights, not the compiler: the kernels are compiled once before the first one."""

import pytest

from roisearch import FieldOfView, make_planner


@pytest.fixture(scope="session", autouse=True)
def _compiled_kernels() -> None:
    make_planner("puct-regions-lite", fov=FieldOfView.point()).warm_up()
