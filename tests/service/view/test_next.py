"""What happens next, in one sentence with the area's names."""

from __future__ import annotations

import pytest

from service.mission.states import State
from service.reasons import Option
from service.view.next import next_state

RUIN = Option("region 1", 1, 9, 0.1, 0.2, 396.0, True, "")


@pytest.mark.parametrize(
    ("state", "chance", "words"),
    [
        (State.SEARCHING, 0.22, "Next: shieling ruin, 400 m, 22 %"),
        (State.CONFIRMING, 0.22, "Next: another look at shieling ruin, 400 m, 22 %"),
        (State.SEARCHING, 0.9993, "Next: shieling ruin, 400 m, over 99 %"),
        (State.SEARCHING, 0.0004, "Next: shieling ruin, 400 m, under 1 %"),
        (State.HOLDING, 0.22, "Next: nothing until you say Resume or Return"),
    ],
)
def test_one_sentence_says_where_it_goes(state: State, chance: float, words: str) -> None:
    assert next_state(state, [RUIN], ["shieling ruin"], [chance])["words"] == words
