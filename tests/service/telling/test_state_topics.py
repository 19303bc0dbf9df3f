"""State topics at a real broker: retained, only what changes, and the will when we are gone."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import aiomqtt
import pytest

from service.doors.mqtt import read_broker
from service.telling.mqtt import StateTopics, topics
from service.telling.news import Newsdesk
from tests.ports import free_port
from tests.service.doors.taking import PATIENCE_S
from tests.service.doors.test_mqtt import mosquitto, needs_mosquitto
from tests.service.telling.seen import found, state, suspect, two_aircraft


async def retained(port: int, enough: set[str], *, late: bool = False) -> dict[str, Any]:
    """What a client that comes now is told; `late`: when all has been published, so that all is retained."""
    said: dict[str, Any] = {}
    async with asyncio.timeout(PATIENCE_S), aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe("roisearch/run/#", qos=1)
        async for message in client.messages:
            assert message.retain or not late
            assert isinstance(message.payload, bytes)
            said[str(message.topic).removeprefix("roisearch/run/")] = json.loads(message.payload)
            if enough <= set(said):
                return said
    return said


@needs_mosquitto
def test_whoever_comes_later_knows_the_state_and_when_we_are_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.telling.mqtt.RETRY_S", 0.05)
    monkeypatch.setattr("service.telling.mqtt.BEAT_S", 0.2)
    port = free_port()
    teller = StateTopics(read_broker(f"mqtt://127.0.0.1:{port}", "roisearch/run", "", table="telling"))
    seen, all_topics = state(suspects=[suspect()], found=found()), {*topics(state()), "online"}

    async def talk() -> None:
        working = asyncio.create_task(teller.run())
        teller.tell(seen, Newsdesk("run").news(seen, 1.0))  # before there is a broker: nothing waits
        for _ in range(2):  # the second broker knows nothing of what the first was told
            with mosquitto(tmp_path, port, "allow_anonymous true"):
                said = await retained(port, all_topics)
                assert said["online"] is True
                assert said["found"]["written"] == "32T MT 46916 11171"
                assert said["state"]["state"] == "SEARCHING"
                assert len(said["suspects"]) == 1
                async with asyncio.timeout(PATIENCE_S):
                    await teller.told()
        with mosquitto(tmp_path, port, "allow_anonymous true"):
            await retained(port, all_topics)
            teller.tell(state(state="DONE"), [])
            async with asyncio.timeout(PATIENCE_S):
                await teller.told()
            working.cancel()
            await asyncio.wait([working])
            said = await retained(port, all_topics, late=True)
            assert said["online"] is False
            assert said["state"]["state"] == "DONE"
            assert said["found"] is None

    asyncio.run(talk())


def test_what_does_not_show_changes_no_topic() -> None:
    before = topics(state())
    assert topics(state(pos=0.250004, flight_time_s=4.3)) == before
    after = topics(state(pos=0.3))
    assert [name for name in before if after[name] != before[name]] == ["state"]


def test_each_of_several_aircraft_has_a_topic_of_its_own() -> None:
    told = topics(two_aircraft())
    assert told["aircraft/north"]["place"] == told["aircraft"]
    assert told["aircraft/south"] == {"state": "WAITING", "why": "", "battery_percent": None, "place": None}
    assert not any(topic.startswith("aircraft/") for topic in topics(state()))
