"""Lines of JSON in, lines of JSON out: what every door here speaks."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Awaitable, Callable, Sequence

from pydantic import ValidationError

from service.evidence.intake import JournalLost
from service.evidence.reports import Receipt, Report

log = logging.getLogger("roisearch")
SubmitAll = Callable[[Sequence[Report]], Awaitable[list[Receipt]]]
_MOST_CHARACTERS = 300
_MOST_LINES = 500  # read at once, before whatever else goes on has its turn


async def answer(data: bytes, submit: SubmitAll) -> bytes:
    """Take in the reports in `data`, one a line; the receipts, one a line in the same order.

    A line that is no report is answered like one that is refused, under its id if it has one.
    """
    lines = [line for line in data.split(b"\n") if line.strip()]
    answers = []
    for start in range(0, len(lines), _MOST_LINES):
        answers.append(await _answer(lines[start : start + _MOST_LINES], submit))
        await asyncio.sleep(0)
    return b"".join(answers)


async def _answer(lines: Sequence[bytes], submit: SubmitAll) -> bytes:
    parsed = [_read(line) for line in lines]
    reports = [each for each in parsed if isinstance(each, Report)]
    try:
        taken = iter(await submit(reports) if reports else ())
    except Exception as error:  # a fault of ours must not close the door for the reports to come
        if not isinstance(error, JournalLost):
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
    try:
        return Report.model_validate_json(line)
    except ValidationError as error:
        return refusal(_id_of(line), _complaint(error))


def _complaint(error: ValidationError) -> str:
    """The first thing that is wrong, without the input itself, which may be long."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    return f"{where}: {first['msg']}"[:_MOST_CHARACTERS] if where else first["msg"][:_MOST_CHARACTERS]


def _id_of(line: bytes) -> str:
    """The id of what is no report, empty if there is none that a report could have."""
    try:
        name = json.loads(line)["id"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return ""
    return name if isinstance(name, str) and 0 < len(name) <= 128 else ""
