"""Names from the area file for regions, and the sentence for what happens next."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.area.document import name_in
from service.config import Settings
from service.mission.states import State
from service.reasons import Option
from service.search import Search
from service.survey import survey
from service.view.next import STATE_WORDS, choices, next_state
from service.view.scene import SearchGround

DEMO = Path(__file__).parents[3] / "config" / "area.geojson"
NAMES, REGIONS = ("shieling ruin", "burn"), (0.2, 0.004)


def option(region: int | None, *, chosen: bool = False, mass: float | None = 0.5) -> Option:
    return Option(f"region {region}", region, 3, 1.0, mass, 396.0, chosen, "ROI")


def test_regions_have_the_names_of_the_priors_that_made_them() -> None:
    settings = Settings()
    area, grid = survey(DEMO, None, settings)
    ground = SearchGround.of(area, grid, Search(grid, settings).regions.labels, "lookahead")
    assert ground.names == ("shieling ruin", "last phone fix", "burn, north-west", "burn, south-east")
    places = {each["name"]: each["role"] for each in ground.describe()["places"]}
    assert places == {"last phone fix": "prior", "shieling ruin": "prior", "burn": "prior", "mast": "exclude"}


@pytest.mark.parametrize(
    ("label", "name"), [('prior 2 ("the (old) fix")', "the (old) fix"), ("prior 2", ""), ('x ("")', "")]
)
def test_a_name_is_read_back_from_what_messages_call_a_part(label: str, name: str) -> None:
    assert name_in(label) == name


def test_what_happens_next_is_a_place_a_distance_and_a_chance() -> None:
    options = [option(2), option(1, chosen=True)]
    told = next_state(State.SEARCHING, options, NAMES, REGIONS)
    assert told == {
        "words": "Next: shieling ruin, 400 m, 20 %",
        "name": "shieling ruin",
        "distance_m": 396.0,
        "probability": 0.2,
    }
    again = next_state(State.CONFIRMING, options, NAMES, REGIONS, "47.000000, 8.000000, 55 %")
    assert again["words"] == "Next: another look at 47.000000, 8.000000, 55 %"
    assert next_state(State.SEARCHING, [], NAMES, REGIONS)["words"] == "Next: the ground ahead"
    assert next_state(State.HOLDING, options, NAMES, REGIONS)["name"] is None


@pytest.mark.parametrize(("chance", "words"), [(0.9993, "over 99 %"), (0.0004, "under 1 %"), (0.0, "0 %")])
def test_a_chance_is_never_said_to_be_more_or_less_than_it_is(chance: float, words: str) -> None:
    told = next_state(State.SEARCHING, [option(1, chosen=True)], NAMES, (chance, 0.0))
    assert told["words"] == f"Next: shieling ruin, 400 m, {words}"


def test_choices_are_places_each_once_the_chosen_one_first() -> None:
    told = choices([option(2), option(None), option(0), option(1, chosen=True), option(9)], NAMES, REGIONS)
    assert [each["name"] for each in told] == ["shieling ruin", "open ground", "burn"]
    assert [each["chosen"] for each in told] == [True, False, False]


def test_every_state_has_words_and_a_next_step_without_the_tools_own_words() -> None:
    for state in State:
        said = STATE_WORDS[state] + next_state(state, [option(1, chosen=True)], NAMES, REGIONS)["words"]
        assert not any(word in said.lower() for word in ("roi", "mass", "visits", "footprint", "index"))


@pytest.mark.parametrize(
    ("state", "causes", "down", "words"),
    [
        (State.HOLDING, {"operator"}, False, "nothing until you say Resume or Return"),
        (State.HOLDING, {"detector"}, False, "it goes on by itself when the detector reports again"),
        (
            State.HOLDING,
            {"position", "link"},
            False,
            "it goes on by itself when the autopilot is heard and the position is good again",
        ),
        (State.HOLDING, {"detector", "operator"}, False, "nothing until you say Resume or Return"),
        (State.HOLDING, {"detector"}, True, "nothing until you say Launch"),
        (State.YIELDED, set(), True, "nothing until you say Launch"),
        (State.YIELDED, set(), False, "nothing until the pilot hands over and you say Resume"),
    ],
)
def test_what_ends_by_itself_asks_for_no_order(
    state: State, causes: set[str], down: bool, words: str
) -> None:
    assert next_state(state, [], NAMES, REGIONS, causes=causes, down=down)["words"] == f"Next: {words}"
