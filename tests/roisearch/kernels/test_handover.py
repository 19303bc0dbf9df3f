"""What is packed for a kernel arrives in it as it was."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from roisearch import Belief, FieldOfView, SearchState, make_planner
from roisearch.kernels.compiled import kernel
from roisearch.kernels.handover import Layout, array

LAYOUT = Layout(
    flag=np.bool_,
    cube=(np.int32, 3),
    count=np.int64,
    rate=np.float64,
    bits=(np.uint8, 1),
    none=(np.float64, 2),
)
opened = LAYOUT.opener()


@kernel
def work(address: int) -> float:
    """Read a bit of everything, write into the cube."""
    given = opened(address)
    cube, none = array(given.cube), array(given.none)
    cube[1, 2, 3] += given.count
    sizes = cube.shape[0] * 100 + cube.shape[1] * 10 + cube.shape[2] + none.size
    return given.rate + cube[1, 2, 3] + array(given.bits)[1] + sizes + (0.25 if given.flag else 0.0)


def things() -> dict[str, Any]:
    """One for each name."""
    cube = np.arange(2 * 3 * 4, dtype=np.int32).reshape(2, 3, 4)
    bits = np.array([1, 2], dtype=np.uint8)
    return {"cube": cube, "bits": bits, "none": np.zeros((0, 5)), "flag": True, "count": 7, "rate": 0.5}


def test_arrays_and_numbers_arrive_and_arrays_are_not_copied() -> None:
    given = things()
    parcel = LAYOUT.pack(**given)
    assert work(parcel.address) == 0.5 + (23 + 7) + 2 + 234 + 0.25
    assert given["cube"][1, 2, 3] == 30


@pytest.mark.parametrize(
    ("name", "thing", "words"),
    [
        ("cube", np.zeros((2, 3, 4)), "cube must be int32, C-contiguous and of 3 dimensions, not float64"),
        ("cube", np.zeros((2, 3), dtype=np.int32), "of 3 dimensions"),
        ("none", np.zeros((4, 5)).T, "C-contiguous"),
        ("more", 1, "missing or unknown: \\['more'\\]"),
    ],
)
def test_what_a_kernel_would_misread_is_refused(name: str, thing: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        LAYOUT.pack(**{**things(), name: thing})


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))])
def test_a_copy_has_addresses_of_its_own(copied: Callable[[Any], Any]) -> None:
    """A researcher copies beliefs and planners, also into other processes."""
    planner = make_planner("puct-regions-lite", fov=FieldOfView.point(), preset="paper", commit="never")
    belief = Belief(np.random.default_rng(0).random((12, 15)) ** 4)
    rng, state = np.random.default_rng(1), SearchState((3, 3))
    planner.plan(belief, state, rng)
    # the very trees that each planner follows, by which the belief knows its sums: no decision shows them
    sums = belief.follow(planner._scene.forest)  # type: ignore[attr-defined]
    before = sums.sums.copy()
    pair = copied((planner, belief, rng))
    for _ in range(20):
        decision = pair[0].plan(pair[1], state, pair[2])
        pair[1].observe([decision.path[0]], False, 0.9, 0.9)
    assert (sums.sums == before).all()
    for _ in range(20):
        decision = planner.plan(belief, state, rng)
        belief.observe([decision.path[0]], False, 0.9, 0.9)
    again = pair[1].follow(pair[0]._scene.forest)  # as above: those of the copy
    assert (again.sums == sums.sums).all()
    assert pair[1].digest() == belief.digest()
