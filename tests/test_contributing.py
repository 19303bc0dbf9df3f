"""The ways through the code that CONTRIBUTING.md names exist, and none is longer than a person can follow."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
TEXT = (TOP / ".github" / "CONTRIBUTING.md").read_text(encoding="utf-8")
WAYS = dict(re.findall(r"^### (From .+)\n\n((?:\d+\. .+\n)+)", TEXT, flags=re.M))


def test_there_are_five_ways() -> None:
    assert len(WAYS) == 5


@pytest.mark.parametrize("way", WAYS)
def test_a_way_names_files_that_exist_and_at_most_twelve(way: str) -> None:
    steps = WAYS[way].splitlines()
    assert 1 < len(steps) <= 12
    for number, step in enumerate(steps, start=1):
        found = re.match(rf"{number}\. `([^`]+)`: ", step)
        assert found is not None, step
        assert (TOP / found[1]).is_file(), f"{found[1]} does not exist any more"


def test_every_file_that_is_named_elsewhere_exists() -> None:
    for name in set(re.findall(r"`((?:service|roisearch|sim|tests|config)/[\w./-]*)`", TEXT)):
        assert (TOP / name).exists(), f"{name} does not exist any more"
