"""Lines of JSON in, lines of JSON out: what every door here speaks."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence

from pydantic import ValidationError

from service.complaint import complaint
from service.evidence.reports import Receipt, Report, field_names
from service.http.rate import Buckets
from service.http.run import Unanswered
from service.journal import JournalLost

log = logging.getLogger("roisearch")
SubmitAll = Callable[[Sequence[Report]], Awaitable[list[Receipt]]]
_MOST_CHARACTERS = 300
_MOST_LINES = 25  # read at once, before whatever else goes on has its turn
_MOST_AT_ONCE = 1 << 12  # bytes of them, unless a single line has more
LONGEST_LINE = 1 << 18


async def answer(data: bytes, submit: SubmitAll) -> bytes:
    """Take in the reports in `data`, one a line; the receipts, one a line in the same order.

    A line that is no report is answered like one that is refused, under its id if it has one.
    """
    answers = []
    for lines in _in_turns(data):
        answers.append(await _answer(lines, submit))
        await asyncio.sleep(0)
    return b"".join(answers)


def _in_turns(data: bytes) -> Iterator[list[bytes]]:
    """The lines in `data`, so many at a time as are quickly read."""
    lines: list[bytes] = []
    size = 0
    for line in data.split(b"\n"):
        if not line.strip():
            continue
        if lines and (len(lines) == _MOST_LINES or size + len(line) > _MOST_AT_ONCE):
            yield lines
            lines, size = [], 0
        lines.append(line)
        size += len(line)
    if lines:
        yield lines


def limited(submit: SubmitAll, detections_per_s: float) -> SubmitAll:
    """A way in that refuses reports as soon as they bring more detections than that: each costs the flight some
    milliseconds, while a frame in which nothing was seen costs next to nothing."""
    buckets = Buckets()

    async def taken(reports: Sequence[Report]) -> list[Receipt]:
        refused: dict[int, Receipt] = {}
        for number, report in enumerate(reports):
            count = len(report.detections)
            if count and buckets.take("", detections_per_s, time.monotonic(), count):
                why = f"more than {detections_per_s:g} detections a second; send it again, and more slowly"
                refused[number] = refusal(report.id, why)
        rest = [report for number, report in enumerate(reports) if number not in refused]
        receipts = iter(await submit(rest) if rest else ())
        return [refused[number] if number in refused else next(receipts) for number in range(len(reports))]

    return taken


async def _answer(lines: Sequence[bytes], submit: SubmitAll) -> bytes:
    parsed = [_read(line) for line in lines]
    reports = [each for each in parsed if isinstance(each, Report)]
    try:
        taken = iter(await submit(reports) if reports else ())
    except Exception as error:  # a fault of ours must not close the door for the reports to come
        if not isinstance(error, (JournalLost, Unanswered)):
            log.exception("reports could not be taken in")
        taken = iter([refusal(report.id, str(error)) for report in reports])
    receipts = [next(taken) if isinstance(each, Report) else each for each in parsed]
    return b"".join(as_line(receipt) for receipt in receipts)


def refusal(name: str, reason: str) -> Receipt:
    """The receipt of a report that was not taken in."""
    return Receipt(id=name, status="refused", reason=reason)


def as_line(receipt: Receipt) -> bytes:
    """A receipt as a line."""
    return json.dumps(receipt.model_dump()).encode() + b"\n"


def _read(line: bytes) -> Report | Receipt:
    if len(line) > LONGEST_LINE:  # not even looked at: a minute of JSON is no report
        return refusal("", f"a line has at most {LONGEST_LINE} bytes")
    try:
        return Report.model_validate_json(line)
    except ValidationError as error:
        return refusal(_id_of(line), _complaint(error))


def _complaint(error: ValidationError) -> str:
    """What is wrong, without the input itself, which may be long."""
    told = []
    for found in error.errors(include_url=False, include_input=False, include_context=False):
        where = ".".join(str(part) for part in found["loc"])
        said = complaint(found, field_names())
        told.append(f"{where}: {said}" if where else said)
    return "; ".join(told)[:_MOST_CHARACTERS]


def _id_of(line: bytes) -> str:
    """The id of what is no report, empty if there is none that a report could have."""
    try:
        name = json.loads(line)["id"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return ""
    return name if isinstance(name, str) and 0 < len(name) <= 128 else ""
