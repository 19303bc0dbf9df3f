"""From frames to reports, until there are no more frames, the service is gone, or somebody stops it."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from service.adapters.door import Door, Gone
from service.adapters.frames import Frame

GONE = 4
"""Exit code when the service does not answer any longer."""


def report_all(door: Door, frames: Iterable[Frame]) -> int:
    """Report each frame as it comes; 0 at their end or Ctrl-C, 4 when the service is gone."""
    sent = hits = refused = 0
    try:
        with door:
            for frame in frames:
                receipt = door.send(frame)
                sent += 1
                hits += int(receipt["hits"])
                refused += receipt["status"] == "refused"
    except Gone as gone:
        print(f"roisearch-service detector: {gone}", file=sys.stderr)
        return GONE
    except KeyboardInterrupt:
        pass
    print(f"{sent} frames reported, {hits} hits, {refused} refused")
    return 0
