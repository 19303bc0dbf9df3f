"""Where the drone can go, and what it can see from there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from roisearch.decision import Cell
from roisearch.fov import MOVES, FieldOfView


@dataclass(frozen=True, eq=False)
class Part:
    """One connected part of the flyable ground.

    Attributes:
        label: its number, from 1.
        legal: uint8 [cells], bit h set when move h stays on this part; 0 off it.
        viewable: bool [rows, cols], what can be looked at from it.
    """

    label: int
    legal: NDArray[np.uint8]
    viewable: NDArray[np.bool_]


class Ground:
    """The flyable cells of a map for one field of view.

    Args:
        shape: rows and columns.
        flyable: bool [rows, cols], None for everything.
        fov: what is seen from a cell; its size decides what counts as viewable.
    """

    def __init__(self, shape: tuple[int, int], flyable: ArrayLike | None, fov: FieldOfView) -> None:
        mask = np.ones(shape, dtype=bool) if flyable is None else np.asarray(flyable, dtype=bool)
        if mask.shape != shape:
            raise ValueError(f"flyable has the shape {mask.shape}, the belief {shape}")
        self.shape = shape
        self.flyable: NDArray[np.bool_] = mask
        self.is_open = bool(mask.all())
        self.fov = fov
        self._parts: dict[int, Part] = {}
        self._labels: NDArray[np.int32] | None = None

    def holds(self, cell: Cell) -> bool:
        """Whether `cell` is on the map."""
        return 0 <= cell[0] < self.shape[0] and 0 <= cell[1] < self.shape[1]

    def part_of(self, cell: Cell) -> Part:
        """The connected part that `cell` lies on.

        Raises:
            ValueError: when the drone cannot be in that cell, or cannot leave it.
        """
        rows, cols = self.shape
        if not self.holds(cell):
            raise ValueError(f"the drone's cell {cell} is outside the map of {rows} x {cols} cells")
        if not self.flyable[cell]:
            raise ValueError(f"the drone's cell {cell} is not flyable")
        label = 1 if self.is_open else int(self._components()[cell])
        if label not in self._parts:
            part = self._survey(label)
            if part.legal[cell[0] * cols + cell[1]] == 0:
                raise ValueError(f"no neighbour of the drone's cell {cell} is flyable")
            self._parts[label] = part
        return self._parts[label]

    def _components(self) -> NDArray[np.int32]:
        if self._labels is None:
            from scipy import ndimage

            self._labels = ndimage.label(self.flyable)[0].astype(np.int32)
        return self._labels

    def _survey(self, label: int) -> Part:
        inside = self.flyable if self.is_open else self._components() == label
        legal = np.zeros(self.shape, dtype=np.uint8)
        viewable = np.zeros(self.shape, dtype=bool)
        for heading, (dr, dc) in enumerate(MOVES):
            leaving = inside & shifted(inside, -dr, -dc)
            legal |= leaving.astype(np.uint8) << heading
            arriving = inside & shifted(inside, dr, dc)
            for i, (row, col) in enumerate(self.fov.offsets[heading]):
                if self.fov.p_tp[i] > 0.0:
                    viewable |= shifted(arriving, int(row), int(col))
        return Part(label, np.ascontiguousarray(legal.ravel()), viewable)


def shifted(mask: NDArray[np.bool_], rows: int, cols: int) -> NDArray[np.bool_]:
    """`mask` moved by so many rows down and columns right; what comes in over the border is False."""
    out = np.zeros_like(mask)
    height, width = mask.shape
    if abs(rows) >= height or abs(cols) >= width:
        return out
    out[max(rows, 0) : height + min(rows, 0), max(cols, 0) : width + min(cols, 0)] = mask[
        max(-rows, 0) : height + min(-rows, 0), max(-cols, 0) : width + min(-cols, 0)
    ]
    return out
