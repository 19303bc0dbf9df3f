"""Reports on their way in, and the batches that they came with."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from service.evidence.observe import FramePose, Reading
from service.evidence.reports import Receipt, Report


@dataclass(slots=True, eq=False)
class WaitingReport:
    """A report on its way in; `receipt` is there once it has arrived. `captured` is in the service's clock."""

    report: Report
    arrived: float
    captured: float
    receipt: Receipt | None = None
    error: Exception | None = None
    pose: FramePose | None = None
    reading: Reading | Exception | None = None  # what the frame shows, once that is worked out
    batch: WaitingBatch | None = None

    def settle(self, receipt: Receipt | None, error: Exception | None = None) -> None:
        """Say what became of it; the batch that it came with is told when it is the last of it."""
        self.receipt, self.error = receipt, error
        if self.batch is not None:
            self.batch.open -= 1
            if not self.batch.open and not self.batch.done.done():
                self.batch.done.set_result(None)


@dataclass(slots=True, eq=False)
class WaitingBatch:
    """How many of a batch's reports are still on their way, and what is told when none is."""

    open: int
    done: asyncio.Future[None]
