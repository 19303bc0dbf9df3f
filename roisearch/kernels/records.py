"""What the kernels pass around, grouped by meaning. Built inside compiled code, where a named tuple is free.

Cells are flat indices, row * cols + col, unless a row and a column are given; moves and headings are 0 north,
1 east, 2 south, 3 west.
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


class Pose(NamedTuple):
    """Where the drone is, and the direction of its last move."""

    row: int
    col: int
    heading: int


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
    obstacles, [0, cells] on open ground, and `made_for` [regions] the goals that they were made for.
    """

    goals: Ints
    sources: Ints
    counts: Ints
    means: Floats
    centroids: Floats
    fields: Steps
    made_for: Ints


class Forest(NamedTuple):
    """The regions as trees; see `kernels.forest`. `root` [regions], -1 for a region that is left out."""

    cell_of: Ints
    first: Ints
    last: Ints
    box: Ints
    root: Ints
    peaks: Floats


class Ranging(NamedTuple):
    """What a distance leaves of a weight, and the distances from where the drone is.

    `worth` [steps] falls with the steps; `reach` is the most moves between the drone and a cell that it sees.
    `forward` [cells] has the steps around obstacles, [0] on open ground; `queue` [cells], `stack` [n] are room.
    """

    worth: Floats
    reach: int
    forward: Steps
    queue: Ints
    stack: Ints
