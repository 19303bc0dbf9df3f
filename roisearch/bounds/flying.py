"""A bound on the expected seconds that counts travel: what no flight of a motion can beat, wherever its looks are.

As `roisearch.bounds.travelling`, over time: a flight enters cells at the seconds that a `Motion` says, and what it
finds is worth the seconds that are left until the cap S. What is relaxed: a look may be bought as often as wanted, and
moves and turns take a time of their own, in whole slots, whatever comes before and after them.

**Moves and turns apart.** Let T(i, d, j) be the least time of a move in direction d from the middle of one cell to
that of the next, with a turn of i eighths of a circle at its beginning and of j at its end: half an arc, a straight
part that begins and ends no faster than the turns, the acceleration and the braking allow, and half an arc. A higher
speed at either end only shortens a move, and in a flight both are at most what they are here; so no flight makes this
move faster. Let b(d) = T(0, d, 0) be the straight move, and choose h(0) = 0 and h(1) to h(4) with

    h(i) + h(j)  <=  T(i, d, j) - b(d)        for all i, j and d                                             (1)

(`halves` begins with what one turn alone costs, and takes as much off as (1) asks for). Add up the moves of a flight:
the cell that is entered n-th is reached no sooner than the sum of its b, plus 2 h and the standing of each turn on the
way, plus h of the turn at the beginning and of that at its end. A rounded corner may be shorter than the way through
the middle, so h may be negative: the last two are at least -e, where e = 2 max(0, -min h).

**Slots.** Let a slot be a part of the shortest b, and round b, and 2 h with the standing, down to slots. So no cell is
reached before its slot t begins, less e, and a look there is worth at most w (S + e - t slot). The best flight that
pays for its looks is then a dynamic program over (slot, cell, direction), and (1) of `roisearch.bounds.travelling`, its
proof, its prices and its classes hold word for word, with seconds for steps: at any slot a flight has one cell that it
entered last, and that lies in one hill.

The result is never below the release bound in seconds, of which the larger is taken. It holds for a point field of
view, for any speed and heading at the beginning, and for every p_tn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roisearch.bounds.prices import look_prices, nearest_labels
from roisearch.bounds.seconds import expected_seconds, release_seconds
from roisearch.bounds.travelling import BLOCKS, TravelBound, Tree, worth_of_looks
from roisearch.bounds.walks import best_flight
from roisearch.directions import moves_allowed
from roisearch.kernels.motion import Pace, straight_seconds
from roisearch.kernels.records import Floats, Ints
from roisearch.motion import Motion
from roisearch.regions import segment_regions

SLOTS = 10
"""Slots of the shortest move: more are tighter, and take longer."""
_BLOCK = 40  # steps of a block, at most


def travel_seconds(
    prior: Floats,
    start: tuple[int, int],
    p_tp: float,
    motion: Motion,
    seconds: float,
    *,
    divisions: int = 8,
    known: float = math.inf,
    flyable: NDArray[np.bool_] | None = None,
) -> TravelBound:
    """The expected seconds min(T, `seconds`) that no flight can beat, counting travel between hills, and turns.

    Args:
        prior: float [rows, cols], the mass of each cell; it may sum to less than 1.
        start: (row, col) of the cell where the aircraft is. p_tp: of a look at the target's cell.
        motion: how fast it is. seconds: the cap, above 0.
        divisions, known, flyable: as of `roisearch.bounds.travel`, in seconds.

    Raises:
        ValueError: as `release_seconds`, and when `seconds` is not above 0.
    """
    times, found = release_seconds(prior, start, p_tp, motion, seconds)
    if not seconds > 0.0:
        raise ValueError(f"seconds must be above 0, not {seconds}")
    bound = expected_seconds(times, found, seconds)
    tree = Tree(_Flight.of(prior, start, p_tp, motion, seconds, flyable))
    history = [max(bound, tree.least)]
    while tree.least < known and len(history) <= divisions and tree.divide():
        history.append(max(history[-1], tree.least))
    return TravelBound(history[-1], bound, tree.classes, tuple(history))


@dataclass(frozen=True, eq=False)
class Costs:
    """What moves and turns take at least, in slots of `slot_s` seconds: int [8] and [5]; `early_s` is e of the text."""

    slot_s: float
    moves: Ints
    turns: Ints
    early_s: float


def costs_of(motion: Motion) -> Costs:
    """The costs of a motion."""
    pace = motion.pace
    straight = np.array([_least(0, d, 0, pace) for d in range(8)])
    half = halves(pace)
    flown = straight if motion.diagonal else straight[::2]
    slot_s = float(flown.min()) / SLOTS
    turns = np.floor((2.0 * half + _stood(pace)) / slot_s + 1e-9)
    moves = np.maximum(1, np.floor(straight / slot_s + 1e-9))
    short = int(moves.min() + turns.min())
    if short < 1:  # a corner that is cut by more than a move is long: no motion of sense does
        raise ValueError(f"corners of {motion.corner_m} m are too wide for cells of {motion.cell_m} m")
    return Costs(slot_s, moves.astype(np.int64), turns.astype(np.int64), 2.0 * max(0.0, -float(half.min())))


def halves(pace: Pace) -> Floats:
    """h of the text, in seconds, float [5]."""
    extra = np.array(
        [
            [min(_least(i, d, j, pace) - _least(0, d, 0, pace) for d in range(8)) for j in range(5)]
            for i in range(5)
        ]
    )
    half: Floats = np.minimum(extra[:, 0], extra[0])
    half[0] = 0.0
    over = float((half[:, None] + half - extra)[1:, 1:].max())
    half[1:] -= 0.5 * max(0.0, over)
    return half


def _stood(pace: Pace) -> Floats:
    """Seconds stood in each turn: where it stops there."""
    stood: Floats = np.where(pace.speed <= 0.0, pace.wait, 0.0)
    return stood


def _least(begin: int, direction: int, end: int, pace: Pace) -> float:
    """T of the text."""
    most = float(pace.cruise[direction])
    length = pace.diagonal_m if direction % 2 else pace.straight_m
    free = float(length - pace.zone[begin] - pace.zone[end])
    slow = [min(float(pace.speed[turn]), most) for turn in (begin, end)]  # no turn is faster than its legs
    if math.isinf(pace.accelerate):
        first, last = slow
    else:
        first = min(slow[0], math.sqrt(slow[1] ** 2 + 2.0 * pace.brake * free))
        last = min(slow[1], math.sqrt(slow[0] ** 2 + 2.0 * pace.accelerate * free))
    arcs = _half_arc(begin, slow[0], pace) + _half_arc(end, slow[1], pace)
    return arcs + float(straight_seconds(free, first, last, most, pace.accelerate, pace.brake))


def _half_arc(turn: int, speed: float, pace: Pace) -> float:
    length = 0.5 * float(pace.arc[turn])
    if length <= 0.0:
        return 0.0
    stood = math.sqrt(2.0 * length / pace.accelerate)
    return min(stood, length / speed) if speed > 0.0 else stood


@dataclass(frozen=True, eq=False)
class _Flight:
    """A map and a cap, as arrays, for `Tree`: a step is the shortest move, and has `SLOTS` slots."""

    worth: Floats
    labels: Ints
    released: Ints
    allowed: NDArray[np.uint8]
    start: tuple[int, int]
    costs: Costs
    seconds: float
    steps: int
    block: int
    beyond: float

    @classmethod
    def of(
        cls,
        prior: Floats,
        start: tuple[int, int],
        p_tp: float,
        motion: Motion,
        seconds: float,
        flyable: NDArray[np.bool_] | None,
    ) -> _Flight:
        mass = np.ascontiguousarray(prior, dtype=np.float64)
        worth, beyond = worth_of_looks(mass, p_tp)
        costs = costs_of(motion)
        steps = math.ceil((seconds + costs.early_s) / (SLOTS * costs.slot_s))
        row, col = np.indices(mass.shape)
        down, right = np.abs(row - start[0]), np.abs(col - start[1])
        away = np.maximum(down, right) if motion.diagonal else down + right
        open_ = np.ones(mass.shape, dtype=np.bool_) if flyable is None else np.ascontiguousarray(flyable)
        return cls(
            worth, nearest_labels(segment_regions(mass).labels), np.maximum(away, 1).astype(np.int64),
            np.ascontiguousarray(moves_allowed(open_, diagonal=motion.diagonal)), start, costs, seconds, steps,
            max(1, min(_BLOCK, steps // BLOCKS)), beyond * seconds,
        )  # fmt: skip

    def bound(self, step_worth: Floats, fixed: Ints) -> float:
        """(1) of `roisearch.bounds.travelling`, in seconds."""
        costs = self.costs
        step_s = SLOTS * costs.slot_s
        price = step_s * look_prices(
            self.worth, self.labels, self.released, step_worth, self.block, self.steps
        )
        slots = np.full(SLOTS * self.steps + 1, -1, dtype=np.int64)
        slots[::SLOTS] = fixed
        earned = best_flight(
            (self.worth, price),
            (costs.slot_s, self.seconds + costs.early_s),
            self.allowed,
            self.labels,
            self.start,
            (costs.moves, costs.turns),
            slots,
        )
        return self.seconds - float(price.sum()) - float(earned) - self.beyond
