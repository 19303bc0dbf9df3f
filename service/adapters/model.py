"""An ONNX detector: weights of the user's own, run by ONNX Runtime; pictures in and boxes out."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.adapters.decode import Raw, decode, layout_of
from service.adapters.frames import Seen, in_shares
from service.errors import BadInput

_PADDING = 114  # the grey around a picture that does not fill the network's input, as YOLO was trained with
_MOST_NAMES = 10_000
_SIDE = 640  # of the input, where the model leaves it open


@dataclass(frozen=True)
class Wishes:
    """What is asked of a model: scores from `threshold` on count, boxes that share more than `overlap` of their union
    are one object; `layout` None goes by the shapes."""

    threshold: float = 0.4
    overlap: float = 0.5
    layout: str | None = None


def need_extra() -> None:
    """Raises BadInput when OpenCV or ONNX Runtime is missing."""
    missing = [name for name in ("cv2", "onnxruntime") if importlib.util.find_spec(name) is None]
    if missing:
        raise BadInput(f"this needs {' and '.join(missing)}: pip install 'roisearch[onnx]'")


class Model:
    """A loaded network. Raises BadInput when the file is no model with one picture as its input."""

    def __init__(self, file: Path, names: Sequence[str] | None = None, wishes: Wishes | None = None) -> None:
        """`names` are those of the classes, by their number; without them, those in the model's metadata, if any."""
        import onnxruntime

        self._wishes = wishes or Wishes()
        try:
            self._session: Any = onnxruntime.InferenceSession(
                str(file), providers=onnxruntime.get_available_providers()
            )
        except Exception as error:  # ONNX Runtime's own classes, which it does not export
            raise BadInput(f"{file}: this is no ONNX model that can be run ({error})") from error
        inputs = self._session.get_inputs()
        if len(inputs) != 1 or len(inputs[0].shape) != 4:
            raise BadInput(
                f"{file}: a detector has one input, a picture [1, 3, height, width] or [1, height, width, 3]"
            )
        self._input = inputs[0].name
        self._type = {"tensor(uint8)": np.uint8, "tensor(float16)": np.float16}.get(
            inputs[0].type, np.float32
        )
        self._channels_last = inputs[0].shape[3] == 3
        height, width = inputs[0].shape[1:3] if self._channels_last else inputs[0].shape[2:4]
        self._height = height if isinstance(height, int) else _SIDE
        self._width = width if isinstance(width, int) else _SIDE
        self._names = list(names) if names is not None else _names_inside(self._session)

    def look(self, picture: NDArray[np.uint8]) -> tuple[Seen, ...]:
        """What is in a picture, [rows, cols, 3] in OpenCV's order (blue first)."""
        image, scale, left, top = self._fitted(picture)
        outputs = self._session.run(None, {self._input: image})
        layout = self._wishes.layout or layout_of([each.shape for each in outputs])
        found = self._chosen(decode(outputs, layout))
        rows, cols = picture.shape[:2]
        seen = []
        for box, score, kind in zip(*found, strict=True):
            placed = (box - [left, top, left, top]) / scale
            if (share := in_shares(placed, cols, rows)) is not None:
                seen.append(Seen(self._name(int(kind)), float(score), share))
        return tuple(seen)

    def _fitted(self, picture: NDArray[np.uint8]) -> tuple[NDArray[np.generic], float, int, int]:
        """The picture as the network wants it: whole, in its proportions, in the middle; with the scale and where the
        picture begins."""
        import cv2

        rows, cols = picture.shape[:2]
        scale = min(self._width / cols, self._height / rows)
        small = cv2.resize(picture, (max(round(cols * scale), 1), max(round(rows * scale), 1)))
        left, top = (self._width - small.shape[1]) // 2, (self._height - small.shape[0]) // 2
        canvas = np.full((self._height, self._width, 3), _PADDING, dtype=np.uint8)
        canvas[top : top + small.shape[0], left : left + small.shape[1]] = small
        image = canvas[:, :, ::-1]  # red first
        whole = image if self._type is np.uint8 else (image / 255.0).astype(self._type)
        ordered = whole if self._channels_last else whole.transpose(2, 0, 1)
        return np.ascontiguousarray(ordered[None]), scale, left, top

    def _chosen(self, raw: Raw) -> Raw:
        """Those that are sure enough, each object once."""
        import cv2

        raw = raw.where(np.isfinite(raw.boxes).all(axis=1) & (raw.scores >= self._wishes.threshold))
        if not len(raw.scores):
            return raw
        corners = np.hstack([raw.boxes[:, :2], raw.boxes[:, 2:] - raw.boxes[:, :2]])  # x, y, width, height
        keep = cv2.dnn.NMSBoxesBatched(
            corners.tolist(), raw.scores.tolist(), raw.classes.tolist(), 0.0, self._wishes.overlap
        )
        return raw.where(np.asarray(keep, dtype=np.int64).reshape(-1))

    def _name(self, number: int) -> str:
        return self._names[number] if 0 <= number < len(self._names) else str(number)


def _names_inside(session: Any) -> list[str]:
    """The names of classes that Ultralytics writes into the metadata of its exports: {0: 'person', ...}."""
    text = session.get_modelmeta().custom_metadata_map.get("names", "")
    try:
        names = ast.literal_eval(text)
    except (SyntaxError, ValueError):
        return []
    if not isinstance(names, dict) or not all(isinstance(number, int) for number in names):
        return []
    return [str(names.get(number, number)) for number in range(min(max(names, default=-1), _MOST_NAMES) + 1)]
