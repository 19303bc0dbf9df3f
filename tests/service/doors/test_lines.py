"""Lines of reports, whatever door they come through: each is answered in its place."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from service.doors.lines import LONGEST_LINE, answer, limited
from service.evidence.reports import EXAMPLES, Receipt, Report
from service.journal import JournalLost

from .taking import Taker, frames, lines, said


def test_every_line_is_answered_in_its_place_whatever_it_is() -> None:
    data = b'\n{"id": "x"}\nnot JSON\n[]\n\n' + lines(*EXAMPLES.values()) + b'{"id": 3}\n' + b"[" * 5000
    receipts = said(asyncio.run(answer(data, Taker().submit_all)))
    assert [receipt["status"] for receipt in receipts] == ["refused"] * 3 + ["accepted"] * len(EXAMPLES) + [
        "refused"
    ] * 2
    assert receipts[0] == {
        "id": "x",
        "status": "refused",
        "reason": "captured_at: Field required",
        "looks": 0,
        "hits": 0,
    }
    assert [receipt["id"] for receipt in receipts[3:-2]] == [example["id"] for example in EXAMPLES.values()]


@given(
    st.binary(max_size=200)
    | st.lists(st.sampled_from([b'{"id":"a"}', b"\xff", b"\r", b"1e999"])).map(b"\n".join)
)
def test_any_bytes_get_a_receipt_for_each_line(data: bytes) -> None:
    receipts = said(asyncio.run(answer(data, Taker().submit_all)))
    assert len(receipts) == sum(bool(line.strip()) for line in data.split(b"\n"))


def test_many_lines_are_taken_in_part_by_part_and_others_have_their_turn() -> None:
    taker, sizes, turns = Taker(), [], 0

    async def submit_all(reports: Sequence[Report]) -> list[Receipt]:
        sizes.append(len(reports))
        return await taker.submit_all(reports)

    async def talk() -> bytes:
        async def others() -> None:
            nonlocal turns
            while True:
                turns += 1
                await asyncio.sleep(0)

        beside = asyncio.create_task(others())
        receipts = await answer(lines(*frames(1200)) + b"nonsense\n" * 1000, submit_all)
        beside.cancel()
        return receipts

    receipts = said(asyncio.run(talk()))
    assert [each["status"] for each in receipts] == ["accepted"] * 1200 + ["refused"] * 1000
    assert [each["id"] for each in receipts[:1200]] == [f"f{number}" for number in range(1200)]
    assert sizes == [25] * 48
    assert turns >= 20


def test_more_detections_than_allowed_are_refused_and_what_sees_nothing_is_not() -> None:
    crowd = {"id": "crowd", "captured_at": 1.0, "detections": [{"lat": 47.0, "lon": 8.0}] * 256}
    data = lines(crowd, {**crowd, "id": "again"}, *frames(3))
    receipts = said(asyncio.run(answer(data, limited(Taker().submit_all, 100.0))))
    assert [each["status"] for each in receipts] == ["accepted", "refused"] + ["accepted"] * 3
    assert receipts[1]["id"] == "again"
    assert "more than 100 detections a second" in receipts[1]["reason"]


def test_a_line_that_is_too_long_is_not_even_read() -> None:
    data = (
        b'{"id": "long", "captured_at": 1.0, "frame_id": "'
        + b"x" * LONGEST_LINE
        + b'"}\n'
        + lines(*frames(1))
    )
    receipts = said(asyncio.run(answer(data, Taker().submit_all)))
    assert [each["status"] for each in receipts] == ["refused", "accepted"]
    assert "a line has at most" in receipts[0]["reason"]


def test_large_lines_are_taken_in_few_at_a_time() -> None:
    taker, sizes = Taker(), []

    async def submit_all(reports: Sequence[Report]) -> list[Receipt]:
        sizes.append(len(reports))
        return await taker.submit_all(reports)

    seen = [{"lat": 47.0 + n / 1000, "lon": 8.0} for n in range(256)]
    asyncio.run(answer(lines(*({**each, "detections": seen} for each in frames(40))), submit_all))
    assert sum(sizes) == 40
    assert max(sizes) <= 10


def test_a_lost_journal_is_told_to_the_sender_who_may_send_again() -> None:
    async def lost(reports: Sequence[Report]) -> list[Receipt]:
        raise JournalLost("the journal j cannot be written: disk full")

    (receipt,) = said(asyncio.run(answer(lines(*frames(1)), lost)))
    assert (receipt["id"], receipt["status"]) == ("f0", "refused")
    assert "disk full" in receipt["reason"]
