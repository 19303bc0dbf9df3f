"""What follows when a place is probable enough: by the setting, by the state, and by an operator's word."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import pytest

from service.chances import sure
from service.mavlink.texts import text_messages
from service.mission.effects import Answer, EnterGuided, Stop, Tell, WriteRow
from service.mission.news import Judged, MapChanged, Order
from service.mission.states import Event, State
from service.places import Coordinates, written
from service.rows import FoundRow, TransitionRow
from tests.service.mission.flown import FOUND, GRID, LEFT_US, ON_GROUND, Talk, reached, searching


def over(on_found: str, coordinates: Coordinates = "degrees") -> Talk:
    """A search that has just passed the level."""
    talk = searching({"search": {"on_found": on_found}}, grid=replace(GRID, coordinates=coordinates))
    talk.sees(found=FOUND, place_probability=FOUND.probability)
    talk.tick()
    return talk


def said(talk: Talk) -> int:
    """How often the place was written down."""
    return sum(isinstance(effect, WriteRow) and isinstance(effect.row, FoundRow) for effect in talk.wanted)


@pytest.mark.parametrize("on_found", ["return", "hover", "continue"])
def test_a_posterior_over_the_level_ends_the_search_unless_it_is_to_continue(on_found: str) -> None:
    talk = over(on_found)
    ends = on_found != "continue"
    assert talk.state == (State.FOUND if ends else State.CONFIRMING)
    assert talk.core.standing.found == FOUND
    talk.tick()
    assert said(talk) == 1  # and not once a tick


@pytest.mark.parametrize("how", get_args(Coordinates))
def test_where_it_was_found_is_as_the_team_writes_places_and_fits_into_one_statustext(
    how: Coordinates,
) -> None:
    talk, place = over("return", how), written((FOUND.lat, FOUND.lon), how)
    (told,) = [each.text for each in talk.wanted if isinstance(each, Tell) and "FOUND" in each.text]
    assert told.startswith(f"search FOUND: {place} p=")
    (message,) = text_messages(told, 2, 1)
    assert "?" not in message.text
    how_sure = f"{sure(FOUND.probability)} sure"
    assert talk.core.standing.why == f"found at {place}, {how_sure}: sure enough to end the search"


def test_hovering_over_what_was_found_ends_with_the_energy_for_the_way_home() -> None:
    talk = over("hover")
    assert Stop() in talk.tick()
    assert Stop() not in talk.pass_by(30.0)
    assert talk.state == State.FOUND
    talk.shows(battery_percent=18.0)
    talk.tick()
    assert (talk.state, talk.core.standing.why_stopped) == (State.RETURNING, "battery at 18 %")


def test_what_is_found_is_taken_back_when_more_looks_speak_against_it() -> None:
    talk = over("continue")
    talk.sees(found=None, place_probability=0.1)
    talk.tick()
    assert (talk.state, talk.core.standing.found) == (State.SEARCHING, None)


def test_a_confirmed_place_ends_the_search_whatever_its_probability() -> None:
    talk = searching({"search": {"on_found": "continue"}})
    place = replace(FOUND, probability=0.01)
    talk.sees(confirmed=True, found=place)
    talk.on(Judged(True, place))
    assert (talk.state, talk.core.standing.found) == (State.FOUND, place)
    assert talk.core.standing.why.endswith(f"{place.lon:.6f}: the operator confirmed the place")
    told = [each.text for each in talk.wanted if isinstance(each, Tell) and "FOUND" in each.text]
    assert told == [f"search FOUND: {place.lat:.6f}, {place.lon:.6f}"]
    talk.tick()
    assert talk.state == State.RETURNING


@pytest.mark.parametrize("state", list(State))
def test_a_persons_word_on_a_place_is_taken_in_every_state(state: State) -> None:
    talk = reached(state)
    talk.sees(confirmed=True, found=FOUND)
    assert Answer(7) in talk.on(Judged(True, FOUND, ticket=7))
    assert talk.core.standing.found == FOUND
    talk = reached(state)
    assert Answer(8) in talk.on(Judged(False, None, ticket=8))


@pytest.mark.parametrize(
    ("state", "after"),
    [
        (State.FOUND, State.SEARCHING),
        (State.RETURNING, State.SEARCHING),
        (State.YIELDED, State.YIELDED),
    ],
)
def test_a_rejection_takes_the_search_up_again_where_it_ended_for_that_place(
    state: State, after: State
) -> None:
    talk = over("hover" if state == State.FOUND else "return")
    if state == State.RETURNING:
        talk.tick()
    elif state == State.YIELDED:
        talk.pilot()
    assert talk.state == state
    talk.sees(found=None, place_probability=0.1)
    talk.on(Judged(False, None))
    assert talk.core.standing.found is None
    assert talk.state == after


def test_a_rejection_does_not_take_a_search_up_again_that_ended_for_something_else() -> None:
    talk = over("continue")
    talk.shows(battery_percent=18.0)
    talk.tick()
    assert talk.state == State.RETURNING
    talk.on(Judged(False, None))
    assert talk.state == State.RETURNING


def test_a_rejection_takes_the_aircraft_back_from_its_autopilot_first() -> None:
    talk = over("return")
    talk.tick()
    talk.shows(**{**LEFT_US, "mode": "RTL"})
    talk.on(Judged(False, None, ticket=7))
    assert (talk.doing(), talk.state) == (EnterGuided(), State.RETURNING)
    talk.shows(guided=True, in_control=True)
    talk.done()
    assert talk.state == State.SEARCHING


def test_hovering_over_what_was_found_ends_with_an_operators_word() -> None:
    talk = over("hover")
    talk.pass_by(10.0)
    assert talk.state == State.FOUND
    talk.sees(confirmed=True)
    talk.on(Judged(True, FOUND))
    talk.tick()
    assert talk.state == State.RETURNING


def test_a_suspect_in_view_is_hovered_over_where_that_gives_another_look() -> None:
    talk = searching({"sensor": {"hover_look_s": 2.0}})
    talk.sees(place_probability=0.6, suspect_in_view=True)
    did = talk.tick()
    assert talk.state == State.CONFIRMING
    assert Stop() in did
    assert Stop() not in talk.pass_by(3.0)


def test_an_operators_return_from_over_the_place_is_obeyed() -> None:
    talk = reached(State.FOUND, {"search": {"on_found": "hover"}})
    talk.on(Order("return"))
    assert talk.state == State.RETURNING


@pytest.mark.parametrize(
    ("state", "after"),
    [
        (State.READY, State.DONE),
        (State.GROUNDED, State.DONE),
        (State.TAKEOFF, State.DONE),  # it stands yet
        (State.HOLDING, State.HOLDING),  # an operator holds it: a person's word stands
        (State.YIELDED, State.YIELDED),
        (State.RETURNING, State.RETURNING),
        (State.SEARCHING, State.SEARCHING),  # it sees the same itself
    ],
)
def test_one_of_several_that_does_not_search_flies_no_more_when_the_search_is_over(
    state: State, after: State
) -> None:
    talk = reached(state, {"run": {"next_sortie_within_s": 3600.0}})
    talk.sees(over="found")
    talk.tick()
    assert talk.state == after
    assert talk.core.standing.settled == (state != State.SEARCHING)


def test_one_of_several_whose_detector_is_silent_comes_home_when_the_search_is_over() -> None:
    talk = searching()
    talk.silent.add("detector")
    talk.pass_by(15.0)
    assert talk.core.standing.causes == {"detector"}
    talk.sees(over="found")
    talk.tick()
    assert (talk.state, talk.core.standing.why_stopped) == (State.RETURNING, "found")


def searched_enough() -> Talk:
    """A search that has ended by what others said to have searched, and is on its way home."""
    talk = searching(WAITS)
    talk.sees(searched=0.99, enough=0.95)
    talk.on(MapChanged(GRID))
    talk.tick()
    assert (talk.state, talk.core.standing.settled) == (State.RETURNING, True)
    talk.wanted.clear()
    return talk


WAITS = {"run": {"next_sortie_within_s": 3600.0}}


def test_news_that_ended_the_search_and_are_taken_back_on_the_way_home_leave_another_sortie() -> None:
    talk = searched_enough()
    talk.sees(searched=0.3)
    talk.on(MapChanged(GRID))
    assert not talk.core.standing.settled
    (row,) = [each for each in talk.rows if isinstance(each, TransitionRow)]
    assert (row.before, row.event, row.after) == (State.RETURNING, Event.RESUME, State.RETURNING)
    assert any("the search is not over" in each.text for each in talk.wanted if isinstance(each, Tell))
    talk.shows(**ON_GROUND, in_control=False)
    talk.pass_by(1.0)
    assert talk.state == State.GROUNDED


@pytest.mark.parametrize("more", [{}, {"searched": 0.96}])
def test_news_that_leave_enough_searched_change_nothing(more: dict[str, float]) -> None:
    talk = searched_enough()
    talk.sees(**more)
    talk.on(MapChanged(GRID))
    assert talk.core.standing.settled


def test_what_an_operator_has_finished_stays_so_whatever_news_come() -> None:
    talk = searched_enough()
    talk.on(Order("finish"))
    talk.sees(searched=0.3)
    talk.on(MapChanged(GRID))
    assert talk.core.standing.settled
