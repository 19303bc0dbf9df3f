"""Who flies together, and whom each of them sees."""

from __future__ import annotations

from functools import partial

from service.mission.apart import Other
from service.mission.formation import Formation
from tests.service.mission.flown import HERE


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
