"""What the kernels of PUCT pass around beside `roisearch.kernels.records`: its settings, and its tree.

Actions 0-3 are the moves and 4 + k the option to go to the goal of region k.
"""

from __future__ import annotations

from typing import NamedTuple

from roisearch.kernels.records import Aims, Floats, Ints, Land, Mass, Sight, Steps


class Problem(NamedTuple):
    """What is searched, apart from how: where the drone can go, what it sees, the target's places, the options."""

    land: Land
    mass: Mass
    sight: Sight
    aims: Aims


class SearchRules(NamedTuple):
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


class SearchTree(NamedTuple):
    """The search tree, a struct of arrays.

    `child` [nodes, actions] is a node or -1; `stats` [nodes, 5, actions] is P(a) (-1: illegal), the sum or
    the best of the returns, the visits n, the value, and P(a) / (1 + n); `visits` [nodes]; `trail` [depth,
    4] the way down: node, action, reward, discount; `span` [2] the least and the largest value so far;
    `decay` [n] the discount of n steps; `grown` [1] how many nodes there are, 0 for a tree not begun.
    """

    child: Steps
    stats: Floats
    visits: Floats
    trail: Floats
    span: Floats
    decay: Floats
    grown: Ints


# SearchRules.rollout_policy
RANDOM, REPEAT, STEEPEST = 0, 1, 2
# SearchRules.option_reward
DENSITY, TRIP = 0, 1
# SearchRules.backup
MEAN, MAX = 0, 1
# SearchRules.prior
UNIFORM, REWARDS, INDEX = 0, 1, 2
# which root action is chosen
VISITS, VALUE = 0, 1
# the goal of an option: its region's peak, or the cell most worth its distance
PEAK_GOAL, INDEX_GOAL = 0, 1
# rows of a node in SearchTree.stats
P_A, WORTH, N_A, VALUE_A, SHARE = 0, 1, 2, 3, 4
# SearchTree.span
LOW, HIGH = 0, 1
