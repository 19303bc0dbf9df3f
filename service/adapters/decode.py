"""What the outputs of an object detector mean: four layouts, in which nearly all exported networks answer.

| layout | outputs | who exports it so |
| --- | --- | --- |
| `columns` | `[1, 4 + C, N]`: cx, cy, width, height, then a score for each class | Ultralytics YOLOv8, YOLO11 |
| `rows` | `[1, N, 5 + C]`: cx, cy, width, height, P(anything there), then the classes | YOLOv5, YOLOv7, YOLOX |
| `ends` | `[1, N, 6]`: x0, y0, x1, y1, score, class | YOLOv10, YOLO26, and exports with non-maximum suppression |
| `lists` | boxes `[N, 4]` (x0, y0, x1, y1), scores `[N]`, labels `[N]`, with or without a batch of 1 | torchvision |

All boxes are in pixels of the network's input image.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from service.errors import BadInput

LAYOUTS = ("columns", "rows", "ends", "lists")
_MOST_ENDS = 1000
"""`[1, N, 6]` with more rows than that is no selection: it is `rows` with one class."""


class Raw(NamedTuple):
    """Detections in pixels of the network's input: boxes float [k, 4] (x0, y0, x1, y1), scores [k], classes int [k]."""

    boxes: NDArray[np.float64]
    scores: NDArray[np.float64]
    classes: NDArray[np.int64]

    def where(self, keep: NDArray[np.generic]) -> Raw:
        """Those of a mask or of indices."""
        return Raw(self.boxes[keep], self.scores[keep], self.classes[keep])


def layout_of(shapes: Sequence[Sequence[int]]) -> str:
    """The layout by the shapes of the outputs. Raises BadInput when it is none that is known."""
    if len(shapes) >= 3:
        return "lists"
    shape = tuple(shapes[0]) if shapes else ()
    if len(shape) == 3 and shape[0] == 1:
        if shape[2] == 6 and shape[1] <= _MOST_ENDS:
            return "ends"
        if shape[1] >= 5 and shape[1] < shape[2]:
            return "columns"
        if shape[2] >= 6:
            return "rows"
    told = " and ".join("[" + ", ".join(map(str, each)) + "]" for each in shapes) or "nothing"
    raise BadInput(
        f"the model answers with {told}, which is no known layout; name one of {', '.join(LAYOUTS)} with --layout, "
        "or export the model with one of them"
    )


def decode(outputs: Sequence[NDArray[np.generic]], layout: str) -> Raw:
    """The detections of one image, before any are left out. Raises BadInput when the outputs are not of the layout."""
    try:
        if layout == "lists":
            return _lists(outputs)
        table = np.asarray(outputs[0], dtype=np.float64).squeeze(0)
        if layout == "ends":
            return Raw(table[:, :4], table[:, 4], table[:, 5].astype(np.int64))
        if layout == "columns":
            table = table.T
            return _by_class(table[:, :4], table[:, 4:])
        return _by_class(table[:, :4], table[:, 5:] * table[:, 4:5])
    except (IndexError, ValueError, StopIteration) as error:
        shapes = ", ".join(str(list(each.shape)) for each in outputs)
        raise BadInput(f"the model's outputs {shapes} are not of the layout '{layout}'") from error


def _by_class(middles: NDArray[np.float64], scores: NDArray[np.float64]) -> Raw:
    """Boxes by their middle and size, each with its best class; scores are [k, C]."""
    half = middles[:, 2:] / 2.0
    boxes = np.hstack([middles[:, :2] - half, middles[:, :2] + half])
    best = scores.argmax(axis=1)
    return Raw(boxes, scores[np.arange(len(scores)), best], best.astype(np.int64))


def _lists(outputs: Sequence[NDArray[np.generic]]) -> Raw:
    """Boxes are what has four columns, labels what is whole, scores the other."""
    flat = [np.asarray(each) for each in outputs]
    boxes = next(each for each in flat if each.shape[-1:] == (4,) and each.ndim > 1).reshape(-1, 4)
    if not len(boxes):  # as most frames of a search
        return Raw(boxes.astype(np.float64), np.zeros(0), np.zeros(0, dtype=np.int64))
    others = [each.reshape(-1) for each in flat if each.size == len(boxes) and each.size != boxes.size]
    labels = next(each for each in others if np.issubdtype(each.dtype, np.integer))
    scores = next(each for each in others if np.issubdtype(each.dtype, np.floating))
    return Raw(boxes.astype(np.float64), scores.astype(np.float64), labels.astype(np.int64))
