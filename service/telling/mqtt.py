"""MQTT: the state of a search on retained topics, so that whoever comes later knows it at once.

<topic>/online      true, and false by the broker's will when we are gone
<topic>/state       state, why, area, pos, outside, steps, flight_time_s, battery_percent
<topic>/aircraft    lat, lon, written, height_m, heading_deg; null while its place is unknown
<topic>/aircraft/*  of each of several by its name: state, why, battery_percent, and that as place
<topic>/place       the most likely place: lat, lon, written, probability
<topic>/suspects    a list of places with their probability
<topic>/found       the place found: lat, lon, written, probability, ellipse; null until there is one
<topic>/news        each piece of news as a webhook has it; not retained
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from typing import Any

from service.cancelling import end_if_cancelled
from service.doors.mqtt import RETRY_S, Broker
from service.telling.news import Announcement
from service.view.state import PoseState, RunState

log = logging.getLogger("roisearch")
_QOS = 1
_PUBLISH_S = 10.0
BEAT_S = 10.0
MOST_NEWS = 300


class StateTopics:
    """Publishes what has changed. Only the newest of each topic waits for a broker that is away."""

    def __init__(self, broker: Broker) -> None:
        self._broker = broker
        self._new: dict[str, str] = {}
        self._sent: dict[str, str] = {}
        self._news: list[str] = []
        self._more, self._quiet = asyncio.Event(), asyncio.Event()
        self._quiet.set()

    def tell(self, state: RunState, news: list[Announcement]) -> None:
        """Take a state in, and the news in it."""
        for topic, value in topics(state).items():
            text = json.dumps(value, ensure_ascii=False)
            if self._sent.get(topic) != text:
                self._new[topic] = text
            else:
                self._new.pop(topic, None)
        self._news += [json.dumps(each.body(), ensure_ascii=False) for each in news]
        del self._news[:-MOST_NEWS]
        if self._new or self._news:
            self._quiet.clear()
            self._more.set()

    async def told(self) -> None:
        """Wait until all is out."""
        await self._quiet.wait()

    async def run(self) -> None:
        """Publish until cancelled; a broker that is away is called again and again."""
        import aiomqtt

        said = ""
        broker, will = self._broker, f"{self._broker.topic}/online"
        while True:
            try:
                last_word = aiomqtt.Will(will, "false", qos=_QOS, retain=True)
                async with broker.client(will=last_word) as client:
                    self._new, self._sent = (
                        {**self._sent, **self._new},
                        {},
                    )  # the broker may have forgotten them
                    self._quiet.clear()
                    await client.publish(will, "true", qos=_QOS, retain=True, timeout=_PUBLISH_S)
                    log.info("the state is told on %s/# at %s", broker.topic, broker.url)
                    said = ""
                    try:
                        await self._publish(client)
                    finally:
                        with contextlib.suppress(aiomqtt.MqttError):
                            await client.publish(will, "false", qos=_QOS, retain=True, timeout=1.0)
            except (aiomqtt.MqttError, OSError) as error:
                if str(error) != said:
                    log.warning("the MQTT broker %s cannot be told (%s): trying again", broker.url, error)
                said = str(error)
                end_if_cancelled()
            await asyncio.sleep(RETRY_S)

    async def _publish(self, client: Any) -> None:
        while True:
            while self._new or self._news:
                if self._new:
                    topic = next(iter(self._new))
                    text = self._new[topic]
                    await client.publish(
                        f"{self._broker.topic}/{topic}", text, qos=_QOS, retain=True, timeout=_PUBLISH_S
                    )
                    self._sent[topic] = text
                    if self._new.get(topic) == text:
                        del self._new[topic]
                else:
                    text = self._news[0]
                    await client.publish(f"{self._broker.topic}/news", text, qos=_QOS, timeout=_PUBLISH_S)
                    if self._news and self._news[0] is text:
                        del self._news[0]
            end_if_cancelled()
            self._more.clear()
            self._quiet.set()
            with contextlib.suppress(TimeoutError):  # a broker that is gone is noticed by what is sent to it
                async with asyncio.timeout(BEAT_S):
                    await self._more.wait()
            if not self._more.is_set():
                await client.publish(
                    f"{self._broker.topic}/online", "true", qos=_QOS, retain=True, timeout=_PUBLISH_S
                )


def topics(state: RunState) -> dict[str, Any]:
    """What each topic says of a state."""
    pose, found, place = state["pose"], state["found"], state["place"]
    few = ("state", "why", "area", "pos", "outside", "steps", "battery_percent")
    return {
        "state": {**{key: _short(state[key]) for key in few}, "flight_time_s": round(state["flight_time_s"])},  # type: ignore[literal-required]
        "aircraft": _pose(pose),
        **_each_aircraft(state),
        "place": _place(place),
        "suspects": [_place(each) for each in state["suspects"]],
        "found": None if found is None else {**_place(found), "ellipse": found["ellipse"]},
    }


def _each_aircraft(state: RunState) -> dict[str, Any]:
    """A topic for each aircraft, where there are several: where it is, its state and its battery."""
    if len(state["aircraft"]) < 2:
        return {}
    return {
        f"aircraft/{each['name']}": {
            "state": each["state"],
            "why": each["why"],
            "battery_percent": _short(each["battery"]),
            "place": _pose(each["pose"]),
        }
        for each in state["aircraft"]
    }


def _pose(pose: PoseState | None) -> dict[str, Any] | None:
    if pose is None:
        return None
    return {
        "lat": round(pose["lat"], 7),
        "lon": round(pose["lon"], 7),
        "written": pose["written"],
        "height_m": round(pose["height_m"], 1),
        "heading_deg": None if pose["heading_deg"] is None else round(pose["heading_deg"], 1),
    }


def _place(place: Any) -> dict[str, Any]:
    said = {"lat": round(place["lat"], 7), "lon": round(place["lon"], 7)}
    return {**said, "written": place["written"], "probability": _short(place["probability"])}


def _short(value: Any) -> Any:
    """Fewer digits, so that a topic changes when something has."""
    return round(value, 4) if isinstance(value, float) else value
