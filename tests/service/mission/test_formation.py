"""Who flies together, and whom each of them sees."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from service.mission.apart import Other
from service.mission.formation import Formation
from service.mission.news import Order
from tests.service.mission.flown import HERE, place, searching


def seen(name: str, up_m: float = 30.0) -> Other:
    """An aircraft of that name."""
    return Other(name, HERE, up_m, HERE, HERE, 30.0, 8.0)


def test_who_flies_alone_sees_nobody_and_is_not_several() -> None:
    formation = Formation()
    formation.join("", partial(seen, ""))
    assert formation.others("") == ()
    assert not formation.several


def test_each_sees_the_others_as_they_are_when_it_asks() -> None:
    formation, height = Formation(), {"south": 30.0}
    formation.join("north", partial(seen, "north"))
    formation.join("south", lambda: seen("south", height["south"]))
    assert formation.several
    assert formation.others("north") == (seen("south"),)
    assert formation.others("south") == (seen("north"),)
    height["south"] = 12.0
    assert formation.others("north") == (seen("south", 12.0),)


@pytest.mark.parametrize(
    ("second", "is_another"),
    [
        ({}, False),
        ({"age_s": 20.0, "place": place(200.0, 150.0)}, False),  # that link is gone since
        ({"ended": False}, True),
        ({"system_id": 4}, True),
        ({"place": place(200.0, 90.0)}, True),  # two with the same id
    ],
)
def test_a_second_link_to_an_aircraft_whose_mission_ended_for_that_is_no_other(
    second: dict[str, Any], is_another: bool
) -> None:
    own = replace(seen("north"), system_id=3)
    other = replace(seen("south"), **{"system_id": 3, "ended": True, **second})
    formation = Formation()
    formation.join("north", lambda: own)
    formation.join("south", lambda: other)
    assert formation.others("north") == ((other,) if is_another else ())


def test_a_mission_that_has_ended_tells_so() -> None:
    talk = searching()
    assert not talk.core.told(talk.seen, talk.now).ended
    talk.on(Order("abort"))
    assert talk.core.told(talk.seen, talk.now).ended
