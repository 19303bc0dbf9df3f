"""The one intake behind every door: a detector report is checked, written to the journal, and then believed.

A report is acknowledged only after it is on disk, together with what it was taken to mean, so a restart that
replays the journal has the same belief to the last bit. A repeated id changes nothing.

Reports are taken in in pieces: what has gathered while the last piece was being written, in the order of capture.
That is all the waiting there is, a few milliseconds, so a hit is not delayed. It is enough, because lateness costs
nothing: a frame is applied to the pose it was captured at, passes go by the time of capture, and Bayes' rule does
not mind the order. What is older than the telemetry's memory is refused.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import sqlite3
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from service.clock import Clock
from service.evidence.observe import Cell, Observation, Pose, Unreadable, observe
from service.evidence.passes import Passes
from service.evidence.reports import Receipt, Report
from service.evidence.sensors import Profile
from service.evidence.verdict import ROW as VERDICT
from service.evidence.verdict import verdict_on, verdict_row
from service.journal import Journal, Row
from service.search import Search

log = logging.getLogger("roisearch")
PoseAt = Callable[[float], Pose | None]
PIECE, PIECE_S = (
    64,
    0.01,
)  # most reports in one transaction, and most seconds to work out what they mean: a hit
# behind a large batch does not wait for all of it, nor does the flight for a camera's geometry
MOST_WAITING = 20_000
MOST_IDS = 200_000  # what is older than these, the journal itself knows
_MOST_CHARACTERS = 200
AHEAD_S = 0.5  # how far in the future of the service's clock a frame may be: as far as a pose is carried on


class JournalLost(RuntimeError):
    """The journal cannot be written: nothing may be believed or acknowledged any more."""


@dataclass(slots=True, eq=False)
class _Waiting:
    """A report on its way in; `receipt` is there once it has arrived."""

    report: Report
    arrived: float
    captured: float
    receipt: Receipt | None = None
    error: Exception | None = None
    batch: _Batch | None = None

    def settle(self, receipt: Receipt | None, error: Exception | None = None) -> None:
        """Say what became of it; the batch that it came with is told when it is the last of it."""
        self.receipt, self.error = receipt, error
        if self.batch is not None:
            self.batch.open -= 1
            if not self.batch.open and not self.batch.done.done():
                self.batch.done.set_result(None)


@dataclass(slots=True, eq=False)
class _Batch:
    open: int
    done: asyncio.Future[None]


@dataclass
class Intake:
    """Where reports go in. `pose_at` looks a capture time up in the telemetry, `time_of_boot` translates the
    autopilot's time since boot; `told` is called after each applied observation with the time (perf_counter) at
    which its report arrived, `believed` after each report with the seconds that it took. `history_s` is how far back
    the telemetry remembers."""

    search: Search
    sensor: Profile
    journal: Journal
    clock: Clock
    pose_at: PoseAt
    told: Callable[[Observation, float], None]
    time_of_boot: Callable[[float], float | None] = lambda boot_s: None
    believed: Callable[[float], None] = lambda seconds: None
    history_s: float = 120.0
    passes: Passes = field(default_factory=Passes)
    accepted: int = 0
    refused: int = 0
    last_at: float = 0.0
    _ids: OrderedDict[str, None] = field(default_factory=OrderedDict)
    _waiting: list[_Waiting] = field(default_factory=list)
    _working: asyncio.Task[None] | None = None
    _believing: asyncio.Lock = field(
        default_factory=asyncio.Lock
    )  # what is believed keeps the journal's order

    async def submit(self, report: Report) -> Receipt:
        """Take one report in. Raises JournalLost when it could not be written."""
        return (await self.submit_all([report]))[0]

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Take several reports in; their receipts in the same order.

        Raises JournalLost when one could not be written; all may be sent again then.
        """
        arrived = time.perf_counter()
        waiting = [_Waiting(report, arrived, report.captured_at) for report in reports]
        self._place(waiting)
        batch = _Batch(0, asyncio.get_running_loop().create_future())
        for each in waiting:
            if each.receipt is None:
                each.batch = batch
                batch.open += 1
                self._waiting.append(each)
        if batch.open:
            if self._working is None or self._working.done():
                self._working = asyncio.create_task(self._work())
            await batch.done
        receipts = []
        for each in waiting:
            if each.error is not None:
                raise each.error
            assert each.receipt is not None
            receipts.append(each.receipt)
        return receipts

    def remember(self, ids: Iterable[str]) -> None:
        """Ids that an earlier run of the same search has counted."""
        for name in ids:
            self._ids[name] = None
        while len(self._ids) > MOST_IDS:
            self._ids.popitem(last=False)

    def recall(self, row: Row) -> None:
        """Take up the passes that a report of an earlier run of the same search belongs to; rows come in their order.

        Raises KeyError, TypeError or ValueError when this is no row of a report.
        """
        report = Report.model_validate(row.body["report"])
        captured = row.body.get("captured", row.time)  # not told by early versions
        lat, lon, height, heading, pitch, roll = row.body["pose"]
        with contextlib.suppress(Unreadable):  # the sensor may have been set otherwise since
            reading = self.sensor.read(Pose(lat, lon, height, heading, captured, pitch, roll), report)
            if report.usable:
                observe(self.passes, report.source, captured, reading)
        self.passes.settle()

    async def judge(self, cell: Cell, *, confirmed: bool) -> None:
        """Take in what an operator says about the place around `cell`; raises JournalLost."""
        reliability = self.search.settings.search.reject_reliability
        observation = verdict_on(cell, self.search.grid.frame.shape, reliability, confirmed=confirmed)
        async with self._believing:
            try:
                body = verdict_row(cell, observation, confirmed=confirmed)
                await self.journal.append(self.clock.now(), VERDICT, body)
            except (sqlite3.Error, OSError) as error:
                raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
            self.search.judge(cell, observation, confirmed=confirmed)

    # ---- piece by piece

    async def _work(self) -> None:
        """Take in what waits, until nothing does."""
        while self._waiting:
            self._waiting.sort(key=lambda each: each.captured)
            piece, self._waiting = self._waiting[:PIECE], self._waiting[PIECE:]
            try:
                async with self._believing:
                    await self._take(piece)
            except asyncio.CancelledError:
                self._fail([*piece, *self._waiting], JournalLost("the service is ending"))
                raise
            except Exception as error:
                self._fail(piece, error)  # whoever sent them hears of it

    @staticmethod
    def _fail(waiting: Iterable[_Waiting], error: Exception) -> None:
        for each in waiting:
            if each.receipt is None:
                each.settle(None, error)

    async def _take(self, piece: list[_Waiting]) -> None:
        """Work out what each report means, write them all, and then believe them."""
        new: dict[str, tuple[_Waiting, Observation | None]] = {}
        repeated: list[_Waiting] = []
        try:
            rows = self._understand(piece, new, repeated)
            fresh = await self.journal.append_all(rows)
        except Exception as error:
            self.passes.undo()  # whatever it was: the same reports may come again
            if isinstance(error, (sqlite3.Error, OSError)):
                raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
            raise
        self.passes.settle()
        self.remember(new)
        for (each, observation), is_new in zip(new.values(), fresh, strict=True):
            if is_new:
                self._believe(each, observation)
            else:
                repeated.append(each)
        for each in repeated:
            each.settle(Receipt(id=each.report.id, status="duplicate"))

    def _understand(
        self,
        piece: list[_Waiting],
        new: dict[str, tuple[_Waiting, Observation | None]],
        repeated: list[_Waiting],
    ) -> list[tuple[float, str, str, str]]:
        """What each report means, until the time is up; the rest waits again. Returns the rows of those in `new`."""
        rows: list[tuple[float, str, str, str]] = []
        enough = time.perf_counter() + PIECE_S
        for number, each in enumerate(piece):
            if time.perf_counter() > enough:
                self._waiting += piece[number:]
                del piece[number:]
                break
            report = each.report
            if report.id in self._ids or report.id in new:
                repeated.append(each)
                continue
            try:
                pose = self._pose(report, each.captured)
                reading = self.sensor.read(pose, report)
            except Unreadable as why:
                self._refuse(each, str(why))
                continue
            except Exception as fault:  # one report that we cannot work out must not cost the others theirs
                log.exception("report %r could not be read", report.id)
                why_not = f"{type(fault).__name__}: {fault}"[:_MOST_CHARACTERS]
                self._refuse(
                    each,
                    f"what the frame shows cannot be worked out ({why_not}); check its pose, gimbal and intrinsics",
                )
                continue
            observation = None
            if report.usable:
                observation = observe(self.passes, report.source, each.captured, reading)
            new[report.id] = (each, observation)
            body = _row(report, pose, each.captured, observation)
            rows.append((self.clock.now(), "report", f"report {report.id}", body))
        return rows

    def _believe(self, each: _Waiting, observation: Observation | None) -> None:
        self.accepted += 1
        self.last_at = self.clock.now()
        looks = hits = 0
        if observation is not None:
            self.search.apply(observation)
            self.told(observation, each.arrived)
            looks, hits = len(observation.cells), int(observation.hits.sum())
        self.believed(time.perf_counter() - each.arrived)
        each.settle(Receipt(id=each.report.id, status="accepted", looks=looks, hits=hits))

    # ---- when and where

    def _place(self, waiting: list[_Waiting]) -> None:
        """Put each report at its time of capture in the service's clock, or refuse it."""
        now, room = self.clock.now(), MOST_WAITING - len(self._waiting)
        for each in waiting:
            report, captured = each.report, each.captured
            if report.id in self._ids:
                continue
            if room <= 0:
                self._refuse(
                    each, f"{MOST_WAITING} reports are waiting already; send it again, and more slowly"
                )
                continue
            if report.clock == "boot":
                found = self.time_of_boot(captured)
                if found is None:
                    why = "is not in the telemetry: no position of the aircraft is known for it"
                    self._refuse(each, f"captured_at {captured:.3f} s since boot {why}")
                    continue
                captured = each.captured = found
            if captured < now - self.history_s:
                self._refuse(
                    each,
                    f"captured_at {captured:.3f} is {now - captured:.1f} s ago, and the telemetry is kept for "
                    f"{self.history_s:g} s: no position of the aircraft is known for it",
                )
            elif captured > now + AHEAD_S:
                self._refuse(
                    each,
                    f"captured_at {captured:.3f} is {captured - now:.1f} s in the future of the service's clock, "
                    "which GET /api/state tells",
                )
            else:
                room -= 1

    def _refuse(self, each: _Waiting, reason: str) -> None:
        self.refused += 1
        each.settle(Receipt(id=each.report.id, status="refused", reason=reason))

    def _pose(self, report: Report, captured: float) -> Pose:
        """Where the frame was taken: as the report says, else as the telemetry of that time; raises Unreadable."""
        own, known = report.pose, self.pose_at(captured)
        if own is None:
            if known is None:
                raise Unreadable(
                    "no position of the aircraft is known and trusted for "
                    f"captured_at {report.captured_at:.3f}"
                )
            return known
        pitch, roll = (known.pitch_deg, known.roll_deg) if known else (0.0, 0.0)
        pitch = own.pitch_deg if own.pitch_deg is not None else pitch
        roll = own.roll_deg if own.roll_deg is not None else roll
        return Pose(own.lat, own.lon, own.height_m, own.heading_deg, captured, pitch, roll)


def _row(report: Report, pose: Pose, captured: float, observation: Observation | None) -> str:
    """What the journal keeps of a report, as JSON; `captured` is in the service's clock."""
    body = {
        "report": report.model_dump(by_alias=True, exclude_unset=True),
        "pose": [pose.lat, pose.lon, pose.height_m, pose.heading_deg, pose.pitch_deg, pose.roll_deg],
        "captured": captured,
        "observation": observation.to_dict() if observation else None,
    }
    return json.dumps(body)
