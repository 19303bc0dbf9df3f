"""What a look is worth in the tree, and how what was seen fades."""

from __future__ import annotations

from roisearch.kernels.compiled import inlined
from roisearch.kernels.records import Mass, Sight


@inlined
def gain_at(row: int, col: int, heading: int, rows: int, cols: int, mass: Mass, sight: Sight) -> float:
    """The weight in the field of view, each cell times its gain."""
    if sight.is_point:
        cell = row * cols + col
        if mass.fades:
            return float(sight.gains[0] * (mass.weights[cell] * mass.fade[cell]))
        return float(sight.gains[0] * mass.weights[cell])
    total = 0.0
    for i in range(sight.offsets.shape[1]):
        r = row + sight.offsets[heading, i, 0]
        c = col + sight.offsets[heading, i, 1]
        if 0 <= r < rows and 0 <= c < cols:
            cell = r * cols + c
            if mass.fades:
                total += sight.gains[i] * (mass.weights[cell] * mass.fade[cell])
            else:
                total += sight.gains[i] * mass.weights[cell]
    return total


@inlined
def fade_at(
    row: int, col: int, heading: int, rows: int, cols: int, mass: Mass, sight: Sight, logged: int
) -> int:
    """Let what is seen from here fade by 1 - p_tp, as the paper does in the tree.

    The cells go into the log, beginning at `logged`; returns how many are in it now. When the log is full
    nothing fades any more, so that everything that did can be restored.
    """
    for i in range(sight.offsets.shape[1]):
        r = row + sight.offsets[heading, i, 0]
        c = col + sight.offsets[heading, i, 1]
        if 0 <= r < rows and 0 <= c < cols and logged < mass.log.size:
            cell = r * cols + c
            mass.fade[cell] *= sight.miss[i]
            mass.log[logged] = cell
            logged += 1
    return logged


@inlined
def restore(mass: Mass, logged: int) -> None:
    """Undo all fading that is in the log."""
    for i in range(logged):
        mass.fade[mass.log[i]] = 1.0
