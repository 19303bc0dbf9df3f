"""What is new in a state is told once; what is told has an id that survives a restart."""

from __future__ import annotations

from service.telling.news import Newsdesk, sure
from tests.service.telling.seen import found, state, suspect


def test_a_suspect_is_told_once_wherever_evidence_moves_it_a_little() -> None:
    watch = Newsdesk("run")
    (first,) = watch.news(state(suspects=[suspect()]), 1.0)
    assert (first.kind, first.place) == ("suspect", (47.05, 8.3))
    assert first.text == "field <&>: suspect at 47.0500, 8.3000, probability 60.0 %: look there"
    assert watch.news(state(suspects=[suspect(lat=47.0501)]), 2.0) == []  # 11 m
    (second,) = watch.news(state(suspects=[suspect(lat=47.0501), suspect(lat=47.0512)]), 3.0)
    assert second.place[0] == 47.0512
    assert watch.news(state(), 4.0) == []
    assert watch.news(state(suspects=[suspect()]), 5.0) == []


def test_a_find_is_told_and_taken_back_and_found_again() -> None:
    watch = Newsdesk("run")
    (told,) = watch.news(state(state="FOUND", found=found()), 1.0)
    assert (told.kind, told.state, told.within_m) == ("found", "FOUND", 7.2)
    assert "FOUND at 32T MT 46916 11171, probability over 99.9 %, 95 % within 7 m" in told.text
    assert watch.news(state(state="RETURNING", found=found()), 2.0) == []
    (back,) = watch.news(state(), 3.0)
    assert (back.kind, back.written) == ("withdrawn", "32T MT 46916 11171")
    assert "the find at 32T MT 46916 11171 is taken back" in back.text
    assert [each.kind for each in watch.news(state(found=found()), 4.0)] == ["found"]


def test_ids_are_the_same_after_a_restart_and_different_for_another_run() -> None:
    seen = state(suspects=[suspect()], found=found())
    first, again, other = (Newsdesk(run).news(seen, 1.0) for run in ("a", "a", "b"))
    assert [each.id for each in first] == [each.id for each in again]
    assert not {each.id for each in first} & {each.id for each in other}


def test_a_detector_that_sees_everything_is_not_told_without_end() -> None:
    watch = Newsdesk("run")
    many = [suspect(lat=47.0 + n * 0.001) for n in range(500)]
    assert len(watch.news(state(suspects=many), 1.0)) == 200


def test_nothing_is_a_hundred_per_cent_that_is_less() -> None:
    assert [sure(p) for p in (0.5, 0.9994, 0.9997, 1.0)] == ["50.0 %", "99.9 %", "over 99.9 %", "over 99.9 %"]
