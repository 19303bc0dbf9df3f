"""Commands: matched to their answers, repeated, given up."""

from __future__ import annotations

from service.mavlink.command import Command, CommandBook
from service.mavlink.events import Accepted, Cancelled, CommandDone, Refused, Silent

SPEED = Command(178, (1.0, 5.0))
MODE = Command(176, (1.0, 4.0, 3.0), motion=True, goal_mode="AUTO_LOITER", acked_twice=True)
OTHER = Command(20)
ACCEPTED, REJECTED, IN_PROGRESS = 0, 1, 5


class Wire:
    """A book, and what it has sent."""

    def __init__(self) -> None:
        self.sent: list[tuple[Command, int]] = []
        self.book = CommandBook(
            lambda command, confirmation: self.sent.append((command, confirmation)),
            ack_timeout_s=1.0,
            attempts=3,
            in_progress_timeout_s=10.0,
        )
        self.now = 0.0

    def run(self, seconds: float) -> list[CommandDone]:
        done = []
        for _ in range(round(seconds * 10)):
            self.now += 0.1
            done += self.book.tick(self.now)
        return done


def test_an_accepted_command_is_sent_once_and_ends() -> None:
    wire = Wire()
    ticket = wire.book.submit(SPEED, 0.0)
    (done,) = wire.book.on_ack(178, ACCEPTED, 0.1)
    assert (done.ticket, done.outcome, done.name) == (ticket, Accepted(), "DO_CHANGE_SPEED")
    wire.run(10.0)
    assert wire.sent == [(SPEED, 0)]


def test_an_unanswered_command_is_repeated_with_its_confirmation_and_given_up() -> None:
    wire = Wire()
    wire.book.submit(SPEED, 0.0)
    (done,) = wire.run(10.0)
    assert [confirmation for _, confirmation in wire.sent] == [0, 1, 2]
    assert done.outcome == Silent(3)


def test_a_refusal_names_the_result() -> None:
    wire = Wire()
    wire.book.submit(SPEED, 0.0)
    (done,) = wire.book.on_ack(178, REJECTED, 0.1)
    assert done.outcome == Refused(1, "TEMPORARILY_REJECTED")


def test_in_progress_is_waited_for_without_repeating() -> None:
    wire = Wire()
    wire.book.submit(SPEED, 0.0)
    wire.book.on_ack(178, IN_PROGRESS, 0.1)
    assert wire.run(8.0) == []
    assert len(wire.sent) == 1
    (done,) = wire.book.on_ack(178, ACCEPTED, wire.now)
    assert done.outcome == Accepted()


def test_an_answer_to_another_command_is_not_taken() -> None:
    wire = Wire()
    wire.book.submit(SPEED, 0.0)
    assert wire.book.on_ack(20, ACCEPTED, 0.1) == []
    assert wire.book.on_ack(178, ACCEPTED, 0.1) != []


def test_commands_of_one_number_wait_for_each_other_and_others_do_not() -> None:
    wire = Wire()
    slower, faster = Command(178, (1.0, 2.0)), Command(178, (1.0, 9.0))
    wire.book.submit(slower, 0.0)
    wire.book.submit(faster, 0.0)
    wire.book.submit(OTHER, 0.0)
    assert [c for c, _ in wire.sent] == [slower, OTHER]
    wire.book.on_ack(178, ACCEPTED, 0.1)
    wire.run(0.2)
    assert [c for c, _ in wire.sent] == [slower, OTHER, faster]


def test_the_second_answer_to_a_mode_command_does_not_answer_the_next_one() -> None:
    """PX4 says ACCEPTED and then TEMPORARILY_REJECTED to one DO_SET_MODE."""
    wire = Wire()
    wire.book.submit(MODE, 0.0)
    next_ticket = wire.book.submit(Command(176, (1.0, 4.0, 5.0), acked_twice=True), 0.0)
    wire.book.on_ack(176, ACCEPTED, 0.05)
    assert wire.book.on_ack(176, REJECTED, 0.06) == []
    wire.run(1.0)
    (done,) = wire.book.on_ack(176, ACCEPTED, wire.now)
    assert (done.ticket, done.outcome) == (next_ticket, Accepted())


def test_a_mode_command_ends_when_the_heartbeat_shows_the_mode() -> None:
    wire = Wire()
    wire.book.submit(MODE, 0.0)
    assert wire.book.on_mode("POSCTL", 0.5) == []
    (done,) = wire.book.on_mode("AUTO_LOITER", 0.6)
    assert done.outcome == Accepted()
    wire.run(10.0)
    assert len(wire.sent) == 1


def test_cancelled_motion_commands_are_never_sent_again() -> None:
    wire = Wire()
    wire.book.submit(MODE, 0.0)
    waiting = wire.book.submit(MODE, 0.0)
    harmless = wire.book.submit(SPEED, 0.0)
    done = wire.book.cancel("the pilot took over", 0.1, only_motion=True)
    assert {d.outcome for d in done} == {Cancelled("the pilot took over")}
    assert waiting in {d.ticket for d in done}
    assert harmless not in {d.ticket for d in done}
    wire.run(10.0)
    assert [c for c, _ in wire.sent].count(MODE) == 1
