"""The files of the project as a house: whose arrows run one way, between the three packages and inside each."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("roisearch", "service", "sim")
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in PACKAGES
    for path in (ROOT / package).rglob("*.py")
}
MAY_IMPORT = {
    "roisearch": {"roisearch"},
    "service": {"service", "roisearch", "sim"},
    "sim": {"sim", "roisearch", "service"},
}
ONE_DOOR = {"service.demo"}
"""Where the service knows the simulated world."""


def imports(name: str) -> set[str]:
    """The files of the project that one of them imports, also where only a type checker looks, or in a function."""
    found = set()
    for part in ast.walk(ast.parse(FILES[name].read_text(encoding="utf-8"))):
        if isinstance(part, ast.Import):
            found |= {alias.name for alias in part.names}
        elif isinstance(part, ast.ImportFrom):
            inner = {f"{part.module}.{alias.name}" for alias in part.names}
            found |= inner & set(FILES) or {str(part.module)}
    return found & set(FILES) - {name}


ARROWS = {name: imports(name) for name in FILES}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_file_imports_itself_by_a_way_round(package: str) -> None:
    inside = {name: ARROWS[name] for name in FILES if name.split(".")[0] == package}
    try:
        TopologicalSorter(inside).prepare()
    except CycleError as circle:
        pytest.fail(" imports ".join(reversed(circle.args[1])))


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_only_what_lies_below_them(package: str) -> None:
    for name in FILES:
        if name.split(".")[0] == package:
            others = {each.split(".")[0] for each in ARROWS[name]}
            assert others <= MAY_IMPORT[package], name


def test_the_service_knows_the_simulated_world_in_one_place() -> None:
    knows = {
        name
        for name in FILES
        if name.startswith("service") and any(e.startswith("sim") for e in ARROWS[name])
    }
    assert knows == ONE_DOOR


def test_a_detectors_adapter_speaks_to_the_public_door_alone() -> None:
    """It may run on another computer: of the service it knows nothing but how an error is worded."""
    adapters = {name for name in FILES if name.startswith("service.adapters")}
    known = {each for name in adapters for each in ARROWS[name]} - adapters
    assert known == {"service.errors"}


def test_the_mock_autopilot_shares_no_code_with_the_service() -> None:
    """A bug that both shared would hide itself."""
    mock = {name for name in FILES if name.startswith("sim.autopilot")}
    assert not {each for name in mock for each in ARROWS[name] if each.startswith("service")}
