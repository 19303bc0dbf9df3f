"""What the kernels pass around, grouped by meaning. Built inside compiled code, where a named tuple is free.

Cells are flat indices, row * cols + col, unless a row and a column are given; moves and headings are 0 north,
1 east, 2 south, 3 west; actions 0-3 are the moves and 4 + k the option to go to the goal of region k.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Steps = NDArray[np.int32]
Bits = NDArray[np.uint8]

FAR = 1 << 30
"""The distance of what cannot be reached."""


class Land(NamedTuple):
    """Where the drone can go: `legal` [cells], bit h set when move h stays on flyable ground."""

    legal: Bits
    rows: int
    cols: int


class Sight(NamedTuple):
    """What it sees: `offsets` [4, k, 2] by heading; `gains` and `miss` [k], worth of a cell and 1 - p_tp."""

    offsets: Ints
    gains: Floats
    miss: Floats
    is_point: bool


class Mass(NamedTuple):
    """Where the target may be, in the tree.

    `weights` [cells] is the belief's own array, which others read meanwhile: it is never written. What fades
    in the tree is an overlay, `fade` [cells], one where nothing was seen; `log` [n] remembers what to
    restore.
    """

    weights: Floats
    fade: Floats
    fades: bool
    log: Ints


class Aims(NamedTuple):
    """Where the options go; rows of `goals` [regions, 3], `sources` [regions, 4 k, 3]: cell, row, column.

    `counts` [regions] tells how many sources there are, `means` [regions] the mean weight of a region's
    cells, `centroids` [regions, 2] its middle; `fields` [regions, cells] the steps to the goal around
    obstacles, [0, cells] on open ground.
    """

    goals: Ints
    sources: Ints
    counts: Ints
    means: Floats
    centroids: Floats
    fields: Steps


class Forest(NamedTuple):
    """The regions as trees; see `kernels.forest`."""

    cell_of: Ints
    first: Ints
    last: Ints
    box: Ints
    peaks: Floats


class Rules(NamedTuple):
    """The settings of the search; see `PuctSettings`. `scale` makes a weight a probability."""

    rollout: int
    rollout_policy: int
    option_reward: int
    backup: int
    normalise: bool
    prior: int
    explore: float
    discount: float
    penalty: float
    density: float
    alpha: float
    floor: float
    scale: float


class Tree(NamedTuple):
    """The search tree, a struct of arrays.

    `child` [nodes, actions] is a node or -1; `stats` [nodes, 5, actions] is P(a) (-1: illegal), the sum or
    the best of the returns, the visits n, the value, and P(a) / (1 + n); `visits` [nodes]; `trail` [depth,
    4] the way down: node, action, reward, discount; `span` [2] the least and the largest value so far;
    `decay` [n] the discount of n steps.
    """

    child: Steps
    stats: Floats
    visits: Floats
    trail: Floats
    span: Floats
    decay: Floats


# Rules.rollout_policy
RANDOM, REPEAT, STEEPEST = 0, 1, 2
# Rules.option_reward
DENSITY, TRIP = 0, 1
# Rules.backup
MEAN, MAX = 0, 1
# Rules.prior
UNIFORM, REWARDS, INDEX = 0, 1, 2
# which root action is chosen
VISITS, VALUE = 0, 1
# the goal of an option: its region's peak, or the cell most worth its distance
PEAK_GOAL, INDEX_GOAL = 0, 1
# rows of a node in Tree.stats
P_A, WORTH, N_A, VALUE_A, SHARE = 0, 1, 2, 3, 4
# Tree.span
LOW, HIGH = 0, 1
