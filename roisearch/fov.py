"""What the sensor sees from a cell: any mask, turned with the heading, clipped at the border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.directions import direction_index

HEADINGS = ("north", "east", "south", "west")
MOVES = ((-1, 0), (0, 1), (1, 0), (0, -1))
"""Row and column step of each heading, in the order of HEADINGS."""

DEFAULT_P = 0.9
"""p_tp and p_tn of the paper's experiments."""


def heading_index(heading: str) -> int:
    """The place of `heading` in HEADINGS, of a diagonal direction that of the next one clockwise.

    ValueError when it is none of `roisearch.directions.DIRECTIONS`.
    """
    return (direction_index(heading) + 1) // 2 % 4


@dataclass(frozen=True, eq=False)
class FieldOfView:
    """The cells that one look covers, relative to the drone.

    Attributes:
        name: for people.
        offsets: int [4, k, 2], row and column relative to the drone, for north, east, south and west.
        p_tp, p_tn: float [k], what the sensor is worth in each of the k cells.
    """

    name: str
    offsets: NDArray[np.int64]
    p_tp: NDArray[np.float64]
    p_tn: NDArray[np.float64]

    @classmethod
    def point(cls, p_tp: float = DEFAULT_P, p_tn: float = DEFAULT_P) -> FieldOfView:
        """The drone's own cell only (the paper's point observation)."""
        return cls._from_north("point", np.array([[0, 0]]), p_tp, p_tn)

    @classmethod
    def donut(cls, p_tp: float = DEFAULT_P, p_tn: float = DEFAULT_P) -> FieldOfView:
        """The eight cells around the drone, which hides its own."""
        ring = [[r, c] for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]
        return cls._from_north("donut", np.array(ring), p_tp, p_tn)

    @classmethod
    def wide_angle(cls, p_tp: float = DEFAULT_P, p_tn: float = DEFAULT_P) -> FieldOfView:
        """A camera that looks ahead: three cells in the next row, five in the row after."""
        ahead = [[-1, c] for c in (-1, 0, 1)] + [[-2, c] for c in (-2, -1, 0, 1, 2)]
        return cls._from_north("wide-angle", np.array(ahead), p_tp, p_tn)

    @classmethod
    def from_mask(
        cls, mask: ArrayLike, p_tp: ArrayLike | None = None, p_tn: ArrayLike | None = None
    ) -> FieldOfView:
        """Any field of view, drawn facing north with the drone in the middle.

        Args:
            mask: bool [h, w], h and w odd.
            p_tp, p_tn: a number, or float [h, w], for the cells of the mask; 0.9 unless given.

        Raises:
            ValueError: when the mask has no middle or no cell, or a probability is out of range.
        """
        drawn = np.asarray(mask, dtype=bool)
        if drawn.ndim != 2 or drawn.shape[0] % 2 == 0 or drawn.shape[1] % 2 == 0:
            raise ValueError(f"a mask has an odd number of rows and of columns, not the shape {drawn.shape}")
        if not drawn.any():
            raise ValueError("the mask sees no cell at all")
        seen = np.argwhere(drawn)
        middle = np.array([drawn.shape[0] // 2, drawn.shape[1] // 2])

        def per_cell(value: ArrayLike | None, name: str) -> NDArray[np.float64]:
            array = np.asarray(DEFAULT_P if value is None else value, dtype=np.float64)
            if array.shape not in ((), drawn.shape):
                raise ValueError(f"{name} is one number or one for each cell of the mask {drawn.shape}")
            cells: NDArray[np.float64] = np.broadcast_to(array, drawn.shape)[drawn]
            return cells

        return cls._from_north("mask", seen - middle, per_cell(p_tp, "p_tp"), per_cell(p_tn, "p_tn"))

    @classmethod
    def _from_north(
        cls, name: str, north: NDArray[np.int64], p_tp: ArrayLike, p_tn: ArrayLike
    ) -> FieldOfView:
        turned = [north]
        for _ in range(3):
            turned.append(np.stack([turned[-1][:, 1], -turned[-1][:, 0]], axis=1))
        k = len(north)
        tp = np.ascontiguousarray(np.broadcast_to(np.asarray(p_tp, dtype=np.float64), (k,)))
        tn = np.ascontiguousarray(np.broadcast_to(np.asarray(p_tn, dtype=np.float64), (k,)))
        if not ((tp >= 0.0) & (tp <= 1.0)).all() or not ((tn > 0.0) & (tn <= 1.0)).all():
            raise ValueError("p_tp must be from 0 to 1, and p_tn above 0 up to 1")
        return cls(name, np.ascontiguousarray(np.stack(turned), dtype=np.int64), tp, tn)

    @property
    def is_point(self) -> bool:
        """Whether the drone sees its own cell and no other."""
        return self.offsets.shape[1] == 1 and not self.offsets.any()

    @property
    def reach(self) -> int:
        """The largest number of moves between the drone and a cell that it sees."""
        return int(np.abs(self.offsets).sum(axis=2).max())

    def cells(self, cell: tuple[int, int], heading: str, shape: tuple[int, int]) -> NDArray[np.int64]:
        """The cells seen from `cell`, clipped to a map of `shape`: int [k, 2]."""
        return self.looks(cell, heading, shape)[0]

    def looks(
        self, cell: tuple[int, int], heading: str, shape: tuple[int, int]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """The cells seen from `cell` with p_tp and p_tn of each: int [k, 2], float [k], float [k]."""
        at = self.offsets[heading_index(heading)] + np.array(cell, dtype=np.int64)
        inside = ((at >= 0) & (at < np.array(shape))).all(axis=1)
        return at[inside], self.p_tp[inside], self.p_tn[inside]
