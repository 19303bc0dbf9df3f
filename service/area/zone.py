"""A shape that is asked often, from any thread."""

from __future__ import annotations

import threading

import shapely


class Zone:
    """A shape on a plane, ready to be asked many times what touches it or lies in it.

    GEOS answers fast about a prepared shape, but what it keeps for that is not safe to share: two threads that ask the
    same one at once end the process (GEOS: "Prepared geometry is not thread-safe"). So each thread has its own copy.

    Attributes:
        shape: as given, not prepared; safe in any thread.
    """

    def __init__(self, shape: shapely.Geometry) -> None:
        self.shape = shape
        self._mine = threading.local()

    def __reduce__(self) -> tuple[type[Zone], tuple[shapely.Geometry]]:
        return Zone, (self.shape,)

    @property
    def prepared(self) -> shapely.Geometry:
        """The shape as the calling thread may ask it; not to be handed to another one."""
        try:
            mine: shapely.Geometry = self._mine.shape
        except AttributeError:
            mine = self._mine.shape = shapely.from_wkb(shapely.to_wkb(self.shape))
            shapely.prepare(mine)
        return mine
