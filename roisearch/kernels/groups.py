"""The fields that several kernels are handed alike, by the record that they become; see `handover.Layout`."""

from __future__ import annotations

import numpy as np
from numpy.typing import DTypeLike

Fields = dict[str, DTypeLike | tuple[DTypeLike, int]]

FOREST: Fields = {
    "cell_of": (np.int64, 1),
    "first": (np.int64, 1),
    "last": (np.int64, 1),
    "box": (np.int64, 2),
    "roots": (np.int64, 1),
}
"""See `records.Forest`, but for its peaks, which the belief keeps."""

LAND: Fields = {"legal": (np.uint8, 1), "cols": np.int64}
"""See `records.Land`."""

SIGHT: Fields = {"offsets": (np.int64, 3), "gains": (np.float64, 1), "is_point": np.bool_}
"""See `records.Sight`; where nothing fades `miss` is not asked for, and `gains` stand in its place."""

FADING: Fields = {"miss": (np.float64, 1), "fade": (np.float64, 1), "fades": np.bool_, "log": (np.int64, 1)}
"""See `records.Sight` and `records.Mass`: where what was seen fades in thought."""

RANGING: Fields = {
    "worth": (np.float64, 1),
    "reach": np.int64,
    "forward": (np.int32, 1),
    "queue": (np.int64, 1),
    "stack": (np.int64, 1),
}
"""See `records.Ranging`."""
