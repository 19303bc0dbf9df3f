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
import logging
import math
import sqlite3
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from service.area import Grid
from service.clock import Clock
from service.drawing import RegionsRow
from service.entries import as_json, of_aircraft
from service.errors import shown
from service.evidence.counts import Counts
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation, Reading, Unreadable, observe
from service.evidence.passes import Passes
from service.evidence.plausible import check_pose
from service.evidence.receipts import said_of
from service.evidence.reports import Receipt, Report
from service.evidence.sensors import Profile
from service.evidence.verdict import verdict_on
from service.evidence.waiting import WaitingBatch, WaitingReport
from service.geometry import Cell
from service.journal import Journal, JournalLost
from service.known import Judgement, Known, Withdrawn
from service.news.bearing import FieldNews
from service.rows import ClockRow, NewsRow, ReportRow, VerdictRow, WithdrawnRow
from service.search import Search

log = logging.getLogger("roisearch")
PoseAt = Callable[[float], FramePose | None]
PIECE, PIECE_S = (
    64,
    0.01,
)  # most reports in one transaction, and most seconds to work out what they mean: a hit
# behind a large batch does not wait for all of it, nor does the flight for a camera's geometry
MOST_WAITING = 20_000
MOST_KNOWN = 200_000  # what is older than these, the journal itself knows
_MOST_CHARACTERS = 200
_SAME_S = 1e-3  # what is sent again says the same time
ANOTHER_FRAME = (
    "it was taken in before, for a frame of another time; give every frame its own id, after a restart too"
)


class Intake:
    """Where reports go in, and what has become of them so far."""

    def __init__(
        self,
        search: Search,
        sensor: Profile,
        journal: Journal,
        moments: Moments,
        pose_at: PoseAt,
        told: Callable[[Observation, float], None],
        *,
        believed: Callable[[float], None] = lambda seconds: None,
        passes: Passes | None = None,
    ) -> None:
        """`moments` tells when a frame was taken, `pose_at` looks that up in the telemetry; `told` is called after each
        applied observation with the time (perf_counter) at which its report arrived, `believed` after each report with
        the seconds that it took."""
        self.search, self.sensor, self.journal = search, sensor, journal
        self.moments, self.pose_at, self.told, self.believed = moments, pose_at, told, believed
        self.passes = Passes() if passes is None else passes
        self.placed: Callable[[], bool] = lambda: True
        """Whether the telemetry has told any position of the aircraft so far."""
        self.counts = Counts()
        self._known: OrderedDict[str, float] = OrderedDict()
        """Of the reports taken in, by their names, when their frames were taken, as they said."""
        self._waiting: list[WaitingReport] = []
        self._working: asyncio.Task[None] | None = None

    @property
    def clock(self) -> Clock:
        """The service's."""
        return self.moments.clock

    @property
    def history_s(self) -> float:
        """How far back the telemetry remembers."""
        return self.moments.history_s

    @property
    def accepted(self) -> int:
        """Reports taken in, by earlier runs of the same search too."""
        return self.counts.accepted

    @accepted.setter
    def accepted(self, count: int) -> None:
        self.counts.accepted = count

    @property
    def refused(self) -> int:
        """Reports refused by this process."""
        return self.counts.refused

    @property
    def last_at(self) -> float:
        """When the last report was taken in; 0 before any was."""
        return self.counts.accepted_at

    @last_at.setter
    def last_at(self, moment: float) -> None:
        self.counts.accepted_at = moment

    async def submit(self, report: Report) -> Receipt:
        """Take one report in. Raises JournalLost when it could not be written."""
        return (await self.submit_all([report]))[0]

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        """Take several reports in; their receipts in the same order.

        Raises JournalLost when one could not be written; all may be sent again then.
        """
        arrived = time.perf_counter()
        waiting = [WaitingReport(report, arrived, report.captured_s) for report in reports]
        self._place(waiting)
        batch = WaitingBatch(0, asyncio.get_running_loop().create_future())
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

    def remember(self, frames: Iterable[tuple[str, float]]) -> None:
        """Names of reports that have been taken in, as an earlier run of the same search may have, each with its
        captured_at."""
        self._known.update(frames)
        while len(self._known) > MOST_KNOWN:
            self._known.popitem(last=False)

    def recall(self, row: ReportRow) -> None:
        """Take up the passes that a report of an earlier run of the same search belongs to; rows come in their order.

        Raises ValueError when its report is none.
        """
        report = Report.model_validate(row.report)
        with contextlib.suppress(Unreadable):  # the sensor may have been set otherwise since
            reading = self.sensor.read(row.pose, report)
            if report.usable:
                observe(self.passes, report.source, row.captured, reading)
        self.passes.settle()

    async def judge(self, cell: Cell, *, confirmed: bool) -> None:
        """Take in what an operator says about the place around `cell`; raises JournalLost."""
        reliability = self.search.settings.search.reject_reliability
        observation = verdict_on(cell, self.search.grid.frame.shape, reliability, confirmed=confirmed)
        async with self.search.believing:  # what is believed keeps the journal's order
            now = self.clock.now()
            try:
                await self.journal.append(now, VerdictRow(confirmed, cell, observation))
            except (sqlite3.Error, OSError) as error:
                raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
            self.search.take(Judgement(cell, observation, confirmed), now)

    async def hear(self, said: FieldNews | Withdrawn) -> None:
        """Take in news, or take them back; raises JournalLost, and BadInput when that leaves no ground to fly over.

        In a thread, and on a copy: all that was seen is reckoned anew, and the flight has its turns meanwhile.
        """
        row = NewsRow(said) if isinstance(said, FieldNews) else WithdrawnRow(said.id)

        def reckoned(now: float) -> tuple[Known, Grid]:
            known = self.search.known.copy()
            known.take(said, now)
            return known, self.search.ground_of(known)

        async with self.search.believing:  # what is believed keeps the journal's order
            now = self.clock.now()
            known, grid = await asyncio.to_thread(reckoned, now)
            try:
                await self.journal.append(now, row)
            except (sqlite3.Error, OSError) as error:
                raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
            self.search.go_back(known, grid)

    # ---- piece by piece

    async def _work(self) -> None:
        """Take in what waits, until nothing does."""
        while self._waiting:
            self._waiting.sort(key=lambda each: each.captured)
            piece, self._waiting = self._waiting[:PIECE], self._waiting[PIECE:]
            try:
                async with self.search.believing:  # what is believed keeps the journal's order
                    await self._take(piece)
            except asyncio.CancelledError:
                self._fail([*piece, *self._waiting], JournalLost("the service is ending"))
                raise
            except Exception as error:
                self._fail(piece, error)  # whoever sent them hears of it

    @staticmethod
    def _fail(waiting: Iterable[WaitingReport], error: Exception) -> None:
        for each in waiting:
            if each.receipt is None:
                each.settle(None, error)

    async def _take(self, piece: list[WaitingReport]) -> None:
        """Work out what each report means, write them all, and then believe them."""
        new: dict[str, tuple[WaitingReport, Reading, Observation | None]] = {}
        repeated: list[WaitingReport] = []
        await self._read(piece)
        try:
            rows = self._understand(piece, new, repeated)
            ties = self.moments.unwritten()
            for tie in ties:  # before the reports that are put at their time by it
                await self.journal.append(tie.service, ClockRow(tie))
            self.moments.written(ties)
            fresh = await self.journal.append_all(rows)
        except Exception as error:
            self.passes.undo()  # whatever it was: the same reports may come again
            if isinstance(error, (sqlite3.Error, OSError)):
                raise JournalLost(f"the journal {self.journal.path} cannot be written: {error}") from error
            raise
        self.passes.settle()
        self.remember((name, each.report.captured_at) for name, (each, *_) in new.items())
        for (each, reading, observation), is_new in zip(new.values(), fresh, strict=True):
            if is_new:
                self._believe(each, reading, observation)
            else:
                repeated.append(each)
        for each in repeated:
            each.settle(self._again(each.report))
        await self._redraw()

    def _again(self, report: Report) -> Receipt:
        """The receipt of a report whose name is known; a frame that only took the name of another is lost, and that is
        told."""
        reason = ""
        if abs(self._known.get(report.name, math.nan) - report.captured_at) > _SAME_S:
            reason = ANOTHER_FRAME
            self.counts.refuse(self.clock.now(), report, f"id {shown(report.id)}: {reason}")
        return Receipt(id=report.id, status="duplicate", reason=reason)

    async def _redraw(self) -> None:
        """Go on with other regions of interest, if some are ready, once they are in the journal."""
        now = self.clock.now()
        if (sketch := self.search.redrawn(now)) is None:
            return
        with contextlib.suppress(sqlite3.Error, OSError):  # the mission sees that its journal is lost
            await self.journal.append(now, RegionsRow(sketch.drawing))
            known = self.search.drawing.words
            self.search.take_sketch(sketch)
            if sketch.drawing.words != known:
                log.info("regions of interest: %s", sketch.drawing.words)

    async def _read(self, piece: list[WaitingReport]) -> None:
        """Work out what each frame shows, until the time is up; the rest waits again.

        In a thread: a frame with hundreds of detections takes a second, in which the flight has its turns.
        """
        unread = [each for each in piece if each.report.name not in self._known and self._placed(each)]

        def read() -> int:
            enough = time.perf_counter() + PIECE_S
            for number, each in enumerate(unread):
                if time.perf_counter() > enough:
                    return number
                assert each.pose is not None
                try:
                    each.reading = self.sensor.read(each.pose, each.report)
                except Exception as fault:
                    each.reading = fault
            return len(unread)

        if unread and (done := await asyncio.to_thread(read)) < len(unread):
            start = piece.index(unread[done])
            self._waiting += piece[start:]
            del piece[start:]

    def _placed(self, each: WaitingReport) -> bool:
        """Whether it is known where the frame was taken."""
        try:
            each.pose = self._pose(each.report, each.captured)
        except Unreadable as why:
            each.reading = why
        return each.pose is not None

    def _understand(
        self,
        piece: list[WaitingReport],
        new: dict[str, tuple[WaitingReport, Reading, Observation | None]],
        repeated: list[WaitingReport],
    ) -> list[tuple[float, str, str, str]]:
        """What each report means. Returns the rows of those in `new`."""
        rows: list[tuple[float, str, str, str]] = []
        for each in piece:
            report, reading = each.report, each.reading
            if report.name in self._known or report.name in new:
                repeated.append(each)
                continue
            if isinstance(reading, Unreadable):
                self._refuse(each, str(reading))
                continue
            if isinstance(
                reading, Exception
            ):  # one report that cannot be worked out must not cost the others theirs
                log.error("report %r could not be read", report.id, exc_info=reading)
                why_not = f"{type(reading).__name__}: {reading}"[:_MOST_CHARACTERS]
                self._refuse(
                    each,
                    f"what the frame shows cannot be worked out ({why_not}); check its pose, gimbal and intrinsics",
                )
                continue
            assert each.pose is not None
            assert reading is not None
            observation = None
            if report.usable:
                observation = observe(self.passes, report.source, each.captured, reading)
            new[report.name] = (each, reading, observation)
            row = _row(report, each.pose, each.captured, observation)
            key = f"{row.key} of {self.search.aircraft}" if self.search.aircraft else row.key
            rows.append((self.clock.now(), row.kind, key, as_json(of_aircraft(row, self.search.aircraft))))
        return rows

    def _believe(self, each: WaitingReport, reading: Reading, observation: Observation | None) -> None:
        looks = hits = 0
        if observation is not None:
            self.search.take(observation, each.captured)
            self.told(observation, each.arrived)
            looks, hits = len(observation.cells), int(observation.hits.sum())
        self.believed(time.perf_counter() - each.arrived)
        why = said_of(each.report, reading, looks, hits)
        self.counts.took_in(self.clock.now(), why if not looks else "")
        each.settle(Receipt(id=each.report.id, status="accepted", reason=why, looks=looks, hits=hits))

    # ---- when and where

    def _place(self, waiting: list[WaitingReport]) -> None:
        """Put each report at its time of capture in the service's clock, or refuse it."""
        self.moments.measure()
        now, room = self.clock.now(), MOST_WAITING - len(self._waiting)
        for each in waiting:
            if each.report.name in self._known:
                continue
            if room <= 0:
                self._refuse(
                    each, f"{MOST_WAITING} reports are waiting already; send it again, and more slowly"
                )
                continue
            try:
                each.captured = self.moments.of(each.report, now)
            except Unreadable as why:
                self._refuse(each, str(why))
            else:
                room -= 1

    def refuse(self, report: Report, reason: str) -> Receipt:
        """Count a report as refused; its receipt, with the reason."""
        self.counts.refuse(self.clock.now(), report, reason)
        return Receipt(id=report.id, status="refused", reason=reason)

    def _refuse(self, each: WaitingReport, reason: str) -> None:
        each.settle(self.refuse(each.report, reason))

    def _pose(self, report: Report, captured: float) -> FramePose:
        """Where the frame was taken: as the report says, else as the telemetry of that time; raises Unreadable."""
        own, known = report.pose, self.pose_at(captured)
        if known is None and (own is None or self.placed()):  # what cannot be compared is not believed either
            raise Unreadable(
                f"no position of the aircraft is known and trusted for captured_at {report.captured_at:.3f}"
            )
        if own is None:
            assert known is not None
            return known
        if known is not None:
            check_pose(own, known)
        pitch, roll = (known.pitch_deg, known.roll_deg) if known else (0.0, 0.0)
        pitch = own.pitch_deg if own.pitch_deg is not None else pitch
        roll = own.roll_deg if own.roll_deg is not None else roll
        return FramePose(own.lat, own.lon, own.height_m, own.heading_deg, captured, pitch, roll)


def _row(report: Report, pose: FramePose, captured: float, observation: Observation | None) -> ReportRow:
    """What the journal keeps of a report; `captured` is in the service's clock."""
    sent = report.model_dump(by_alias=True, exclude_unset=True)
    return ReportRow(sent, replace(pose, time=captured), observation)
