"""The map that both processes see: belief and probability of detection, in memory that they share.

The flying process writes it only when it is asked to, the door process reads it when it has the answer and asks
again only after that: neither ever sees half a map, and no map passes through the channel. The memory has no name
in the file system (memfd_create), so a killed service leaves nothing behind.
"""

from __future__ import annotations

import mmap
import os

import numpy as np
from numpy.typing import NDArray


class SharedMap:
    """Two arrays, float [rows, cols] each, in one piece of memory: the weights of the belief and the POD."""

    def __init__(self, file: int, shape: tuple[int, int]) -> None:
        """The map in the memory of a file descriptor, which is not ours to close."""
        rows, cols = shape
        self.file, self.shape = file, shape
        self._memory = mmap.mmap(file, 2 * rows * cols * 8)
        both = np.frombuffer(self._memory, dtype=np.float64)
        self._weights, self._pod = both[: rows * cols], both[rows * cols :].reshape(shape)

    @classmethod
    def create(cls, shape: tuple[int, int]) -> SharedMap:
        """A new one; its `file` can be handed to another process."""
        file = os.memfd_create("roisearch-map", os.MFD_CLOEXEC)
        os.ftruncate(file, 2 * shape[0] * shape[1] * 8)
        return cls(file, shape)

    def write(self, weights: NDArray[np.float64], pod: NDArray[np.float64]) -> None:
        """Put a map there: unnormalised weights, float [cells], and POD, float [rows, cols]."""
        np.copyto(self._weights, weights)
        np.copyto(self._pod, pod)

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A copy of the map that is there."""
        return self._weights.copy(), self._pod.copy()
