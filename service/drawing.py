"""The regions of interest as they are drawn at a time of a run: with names and news, and as a row of the journal.

The row holds the drawing itself, not what it was made from: a replay and a resumed run have the same regions to the
last cell, whatever version of whatever library would draw today.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from service.rowbody import Body

if TYPE_CHECKING:
    from roisearch import Regions

MOST_CELLS = 1 << 28
"""A row that claims more cells is damage."""


@dataclass(frozen=True, eq=False)
class Drawing:
    """The regions from some time of a run on. The door process reads them too, which knows nothing that plans.

    Attributes:
        number: how often they had been drawn again; 0: as the prior has them.
        labels, centroids, peaks, shares: see `roisearch.Regions`.
        names: what people call them, region 1 first; empty for drawing 0, whose names the view makes.
        words: what was new in it, for people, or in the last one before it in which more than borders had moved.
    """

    number: int
    labels: NDArray[np.int32]
    centroids: NDArray[np.float64]
    peaks: NDArray[np.int64]
    shares: NDArray[np.float64]
    names: tuple[str, ...] = ()
    words: str = ""

    @classmethod
    def of(cls, number: int, regions: Regions, names: tuple[str, ...] = (), words: str = "") -> Drawing:
        """The drawing of regions."""
        drawn = cls(number, regions.labels, regions.centroids, regions.peaks, regions.shares, names, words)
        drawn.__dict__["regions"] = regions
        return drawn

    @cached_property
    def regions(self) -> Regions:
        """The same as regions."""
        from roisearch import Regions

        return Regions(self.labels, len(self.centroids), self.centroids, self.peaks, self.shares)


def news_of(before: Regions, after: Regions, names: Sequence[str]) -> str:
    """What is new, in words: 'region 5 (open ground in the north) appeared, region 2 (the burn) is spent'."""
    told = [f"{_called(number, names)} appeared" for number in after.numbers if number not in before.numbers]
    told += [f"{_called(number, names)} is spent" for number in before.numbers if number not in after.numbers]
    return ", ".join(told)


def _called(number: int, names: Sequence[str]) -> str:
    return f"region {number} ({names[number - 1]})" if number <= len(names) else f"region {number}"


@dataclass(frozen=True, eq=False)
class RegionsRow:
    """The regions were drawn again."""

    kind: ClassVar[str] = "regions"
    drawing: Drawing

    def body(self) -> dict[str, Any]:
        drawing = self.drawing
        packed = zlib.compress(drawing.labels.astype("<i4").tobytes(), 6)
        return {
            "number": drawing.number,
            "words": drawing.words,
            "names": list(drawing.names),
            "shape": list(drawing.labels.shape),
            "labels": base64.b64encode(packed).decode(),
            "centroids": drawing.centroids.tolist(),
            "peaks": drawing.peaks.tolist(),
            "shares": drawing.shares.tolist(),
        }

    @classmethod
    def read(cls, body: Body, time: float) -> Self:
        centroids, peaks = body.rows("centroids"), body.cells("peaks")
        shares, names = body.numbers("shares"), tuple(body.texts("names"))
        shape, count = body.cell("shape"), len(centroids)
        if not len(peaks) == len(shares) - 1 == count or any(len(row) != 2 for row in centroids):
            raise ValueError(
                f"it has {count} centroids, {len(peaks)} peaks and {len(shares)} shares of regions; "
                "they should be as many, and one share more"
            )
        drawing = Drawing(
            body.count("number"),
            _unpacked(body.text("labels"), shape, count),
            np.array(centroids, dtype=np.float64).reshape(-1, 2),
            np.array(peaks, dtype=np.int64).reshape(-1, 2),
            np.array(shares, dtype=np.float64),
            names,
            body.text("words"),
        )
        return cls(drawing)


def _unpacked(text: str, shape: tuple[int, int], count: int) -> NDArray[np.int32]:
    """The labels of a row. Raises ValueError when they are not those of `count` regions on a map of `shape`."""
    rows, cols = shape
    if not (rows > 0 and cols > 0 and rows * cols <= MOST_CELLS):
        raise ValueError(f"its regions lie on a map of {rows} x {cols} cells")
    try:
        unpacking = zlib.decompressobj()
        raw = unpacking.decompress(base64.b64decode(text, validate=True), 4 * rows * cols + 1)
    except zlib.error as error:
        raise ValueError(f"its labels are damaged ({error})") from error
    if len(raw) != 4 * rows * cols:
        raise ValueError(f"its labels are {len(raw)} bytes, not {4 * rows * cols}")
    labels = np.frombuffer(raw, dtype="<i4").astype(np.int32).reshape(rows, cols)
    if int(labels.min()) < 0 or int(labels.max()) > count:
        raise ValueError(f"its labels go from {labels.min()} to {labels.max()}, with {count} regions")
    return labels
