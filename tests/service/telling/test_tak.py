"""Cursor on Target: events as the public schema has them, received and parsed by a TAK client library."""

from __future__ import annotations

import asyncio
import re
import socket
import warnings
import xml.etree.ElementTree as ET
from collections.abc import AsyncIterator
from configparser import ConfigParser
from contextlib import asynccontextmanager
from datetime import datetime
from typing import Any

import pytest

from service.telling import Telling, TellingPlan
from service.telling.cot import AIRCRAFT, FOUND, GONE, SEARCHED, SUSPECT, Events
from service.telling.searched import Outline
from service.telling.settings import Tak
from service.telling.tak import TakTeller
from service.view.state import RunState
from tests.service.telling.seen import found, state, suspect, two_aircraft

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # pytak tells of extras that a receiver does not need
    import pytak
    import takproto

PATIENCE_S = 30.0
NOW = 1_767_225_600.25


def events() -> Events:
    return Events("run", "Falcon & 1")


def parsed(data: bytes) -> ET.Element:
    return ET.fromstring(data)


GROUND = [
    Outline(((47.05, 8.30), (47.05, 8.31), (47.06, 8.31), (47.05, 8.30)), (47.053, 8.307), 42.1),
    Outline(((47.07, 8.30), (47.07, 8.31), (47.08, 8.31), (47.07, 8.30)), (47.073, 8.307), 42.0),
]


def all_events() -> list[bytes]:
    """Every kind that there is: one aircraft and several, places and ground, and that they are none any more."""
    made, together = events(), Events("fleet", "Falcon")
    pose = state()["pose"]
    both = [{**each, "pose": pose} for each in two_aircraft()["aircraft"]]
    return [
        *made.aircraft(state(), NOW),
        *together.aircraft(state(aircraft=both), NOW),
        *made.places(state(suspects=[suspect(), suspect(lat=47.06)], found=found()), NOW),
        *made.searched(GROUND, NOW),
        *made.places(state(), NOW),
        *made.searched(GROUND[:1], NOW),
    ]


@pytest.mark.parametrize("data", all_events())
def test_every_event_is_as_the_public_schema_has_it(data: bytes) -> None:
    """Event-PUBLIC.xsd of MITRE, version 2.0: its required attributes, patterns and ranges."""
    event = parsed(data)
    assert event.tag == "event"
    assert set(event.attrib) == {"version", "uid", "type", "time", "start", "stale", "how"}
    assert float(event.attrib["version"]) == 2.0
    assert re.fullmatch(r"\w+(-\w+)*(;[^;]*)?", event.attrib["type"])
    assert re.fullmatch(r"\w(-\w+)*", event.attrib["how"])
    times = [datetime.fromisoformat(event.attrib[key]) for key in ("time", "start", "stale")]
    assert times[0] == times[1] < times[2]
    assert event.attrib["time"].endswith("Z")
    assert [child.tag for child in event] == ["point", "detail"]
    point = event[0]
    assert set(point.attrib) == {"lat", "lon", "hae", "ce", "le"}
    assert -90.0 <= float(point.attrib["lat"]) <= 90.0
    assert -180.0 <= float(point.attrib["lon"]) <= 180.0
    assert all(float(point.attrib[key]) > 0.0 for key in ("hae", "ce", "le"))


@pytest.mark.parametrize("data", all_events())
def test_a_client_library_reads_every_event(data: bytes) -> None:
    message = takproto.parse_proto(takproto.xml2proto(data))
    event, root = message.cotEvent, parsed(data)
    assert (event.uid, event.type) == (root.attrib["uid"], root.attrib["type"])
    assert (event.lat, event.lon) == pytest.approx(
        tuple(float(root[0].attrib[key]) for key in ("lat", "lon"))
    )
    assert (event.sendTime, event.startTime, event.staleTime) == tuple(
        pytest.approx(1000.0 * datetime.fromisoformat(root.attrib[key]).timestamp(), abs=1.0)
        for key in ("time", "start", "stale")
    )
    known = {"contact": ["callsign"], "status": ["battery"], "track": ["course"]}
    for tag, names in known.items():  # what else there is it hands on as XML
        said = root.find(f"detail/{tag}")
        assert event.detail.HasField(tag) == (said is not None)
        for name in names if said is not None else ():
            value = getattr(getattr(event.detail, tag), name)
            assert value == (
                pytest.approx(float(said.attrib[name])) if tag != "contact" else said.attrib[name]
            )
    rest = ET.fromstring(f"<rest>{event.detail.xmlDetail}</rest>")
    assert [child.tag for child in rest] == [child.tag for child in root[1] if child.tag not in known]


def test_events_say_what_there_is() -> None:
    made = events()
    (event,) = made.aircraft(state(), NOW)
    aircraft = parsed(event)
    assert aircraft.find("detail/contact").attrib["callsign"] == "Falcon & 1"  # type: ignore[union-attr]
    assert "SEARCHING, 30 m above launch, POS 25%, battery 91 %" in (
        aircraft.findtext("detail/remarks") or ""
    )
    assert made.aircraft(state(pose=None), NOW) == []

    find, seen = (parsed(each) for each in made.places(state(suspects=[suspect()], found=found()), NOW))
    assert find.attrib["type"] == "b-m-p-s-m"
    assert find[0].attrib["ce"] == "7.2"
    assert "FOUND at 32T MT 46916 11171, probability over 99.9 %" in (find.findtext("detail/remarks") or "")
    assert seen.attrib["type"] == "a-u-G"


def test_each_of_several_aircraft_is_one_on_the_map_with_its_own_name() -> None:
    (event,) = Events("run", "Falcon").aircraft(two_aircraft(), NOW)  # the other has been nowhere yet
    aircraft = parsed(event)
    assert aircraft.attrib["uid"] == "roisearch-run-aircraft-north"
    assert aircraft.find("detail/contact").attrib["callsign"] == "Falcon north"  # type: ignore[union-attr]
    assert "battery 81 %" in (aircraft.findtext("detail/remarks") or "")


def test_searched_ground_is_a_closed_ring_and_goes_when_it_is_one_with_another() -> None:
    made = events()
    first, second = (parsed(each) for each in made.searched(GROUND, NOW))
    assert first.attrib["type"] == "u-d-f"
    places = [link.attrib["point"] for link in first.findall("detail/link")]
    assert places[0] == places[-1] == "47.0500000,8.3000000"
    assert len(places) == 4
    assert first.findtext("detail/remarks") == "searched: 42.1 ha with a POD of 50% or more"
    same, gone = (parsed(each) for each in made.searched(GROUND[:1], NOW))
    assert same.attrib["uid"] == first.attrib["uid"]
    assert gone.attrib["type"] == "t-x-d-d"
    assert gone.find("detail/link").attrib["uid"] == second.attrib["uid"]  # type: ignore[union-attr]


def test_what_is_no_suspect_any_more_is_taken_off_the_maps() -> None:
    made = events()
    (seen,) = made.places(state(suspects=[suspect()]), NOW)
    (gone,) = (parsed(each) for each in made.places(state(), NOW))
    assert gone.attrib["type"] == "t-x-d-d"
    assert gone.find("detail/link").attrib["uid"] == parsed(seen).attrib["uid"]  # type: ignore[union-attr]
    assert made.places(state(), NOW) == []


async def tak_client(port: int) -> tuple[Any, Any]:
    """Another team's client of the server: pytak's receiving half, and the stream to close at the end."""
    config: Any = ConfigParser()
    config["client"] = {"COT_URL": f"tcp://127.0.0.1:{port}"}
    reader, writer = await pytak.protocol_factory(config["client"])
    client = pytak.RXWorker.__new__(pytak.RXWorker)
    client.reader, client.use_protobuf = reader, False
    return client, writer


@asynccontextmanager
async def tak_server() -> AsyncIterator[tuple[int, list[asyncio.StreamWriter]]]:
    """What a TAK server does: each connection hears what the others say."""
    connected: list[asyncio.StreamWriter] = []

    async def relay(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connected.append(writer)
        while data := await reader.read(1 << 16):
            for other in connected:
                if other is not writer:
                    other.write(data)
        connected.remove(writer)

    async with await asyncio.start_server(relay, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1], connected


def test_a_tak_client_receives_the_find_over_a_server_that_comes_late_and_goes_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("service.telling.tak.RETRY_S", 0.05)
    monkeypatch.setattr("service.telling.tak.PLACES_EVERY_S", 0.1)

    async def talk() -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            closed = probe.getsockname()[1]
        async with tak_server() as (port, connected):
            client, writer = await tak_client(port)
            late = TakTeller(Tak("tcp", "127.0.0.1", closed, "Falcon"), "run")
            tried = asyncio.create_task(late.run())
            late.tell(state(found=found()))  # nobody is there, and nothing waits
            tried.cancel()
            teller = TakTeller(Tak("tcp", "127.0.0.1", port, "Falcon"), "run")
            working = asyncio.create_task(teller.run())
            types = set()
            for turn in range(2):
                types.clear()
                async with asyncio.timeout(PATIENCE_S):
                    while types < {"b-m-p-s-m", "a-u-G"}:
                        teller.tell(state(suspects=[suspect()], found=found()))
                        with_timeout = asyncio.wait_for(client.readcot(), 1.0)
                        try:
                            event = await with_timeout
                        except TimeoutError:
                            continue
                        types.add(parsed(event).attrib["type"])
                        await asyncio.sleep(0.02)
                if turn == 0:  # the server throws us out, and not the client that listens
                    for each in connected[1:]:
                        each.close()
            working.cancel()
            await asyncio.wait([working, tried])
            writer.close()

    asyncio.run(talk())


def test_a_tak_client_receives_and_parses_every_event() -> None:
    async def talk() -> list[bytes]:
        async with tak_server() as (port, connected):
            client, writer = await tak_client(port)
            _, ours = await asyncio.open_connection("127.0.0.1", port)
            async with asyncio.timeout(PATIENCE_S):
                while len(connected) < 2:  # noqa: ASYNC110 - the server tells nobody
                    await asyncio.sleep(0.01)
                ours.write(b"".join(all_events()))
                received = [await client.readcot() for _ in all_events()]
            ours.close()
            writer.close()
            return received

    received = asyncio.run(talk())
    told = [takproto.parse_proto(takproto.xml2proto(each)).cotEvent for each in received]
    said = [parsed(each).attrib for each in all_events()]
    assert [(each.uid, each.type) for each in told] == [(each["uid"], each["type"]) for each in said]
    assert {each.type for each in told} == {AIRCRAFT, SUSPECT, FOUND, SEARCHED, GONE}
    assert len({each.uid for each in told if each.type == AIRCRAFT}) == 3


def test_the_ground_that_was_searched_is_told_beside_the_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.telling.telling.GROUND_EVERY_S", 0.05)

    async def talk() -> set[str]:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
            inbox.bind(("127.0.0.1", 0))
            inbox.setblocking(False)
            tak = Tak("udp", "127.0.0.1", inbox.getsockname()[1], "Falcon")
            telling = Telling(TellingPlan(run="run", tak=tak))

            async def ask() -> RunState:
                return state()

            async def see() -> list[Outline]:
                return GROUND

            telling.start(ask, see)
            types: set[str] = set()
            async with asyncio.timeout(PATIENCE_S):
                while types < {AIRCRAFT, SEARCHED}:
                    data = await asyncio.get_running_loop().sock_recv(inbox, 9000)
                    types.add(parsed(data).attrib["type"])
            await telling.end(None)
            return types

    assert asyncio.run(talk()) == {AIRCRAFT, SEARCHED}


def test_datagrams_reach_who_listens() -> None:
    async def talk() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
            inbox.bind(("127.0.0.1", 0))
            inbox.setblocking(False)
            teller = TakTeller(Tak("udp", "127.0.0.1", inbox.getsockname()[1], "Falcon"), "run")
            working = asyncio.create_task(teller.run())
            teller.tell(state(found=found()))
            loop = asyncio.get_running_loop()
            async with asyncio.timeout(PATIENCE_S):
                seen = {parsed(await loop.sock_recv(inbox, 9000)).attrib["type"] for _ in range(1)}
                await teller.told()
            working.cancel()
            await asyncio.wait([working])
        assert seen <= {"a-f-A-M-H-Q", "b-m-p-s-m"}

    asyncio.run(talk())
