"""Flights of a campaign that are kept are not flown again, and those that were interrupted are."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from sim.flight_campaign import add_flavors, add_options, kept, seeds_of
from sim.overground import OverGround


def test_what_was_flown_is_read_and_what_was_interrupted_is_flown_anew(tmp_path: Path) -> None:
    folder, count = tmp_path / "ridge-px4-1", 0

    def fly() -> OverGround:
        nonlocal count
        count += 1
        assert not folder.exists(), "nothing of the interrupted one is left"
        folder.mkdir()
        return OverGround("ridge", "px4", 1, 0, {"flight_time_s": 60.0}, math.inf, False, "said")

    folder.mkdir()
    (folder / "settings.toml").write_text("", encoding="utf-8")
    first = kept(folder, fly, lambda told: OverGround(**told))
    assert kept(folder, fly, lambda told: OverGround(**told)) == first
    assert count == 1


def test_every_campaign_has_seeds_from_the_first_and_a_speed() -> None:
    parser = argparse.ArgumentParser()
    add_flavors(parser, jobs=2)
    add_options(parser, "area", speedup=20.0, patience_s=600.0)
    options = parser.parse_args(["--seeds", "3", "--first-seed", "7"])
    assert list(seeds_of(options)) == [7, 8, 9]
    assert (options.speedup, options.patience, options.jobs, options.out) == (20.0, 600.0, 2, None)
