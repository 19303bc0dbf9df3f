"""Two processes and a real socket between: what passes, what does not, and what happens when one of them ends."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest
from websockets.asyncio.client import connect

from service.border import keeper
from service.journal import JournalLost
from service.outlet import OF_A_TERMINAL
from service.telling import TellingPlan
from service.telling.settings import Tak
from service.view.feed import Moment

from .flown import PATIENCE_S, Flown, behind_a_door, children

FRAME = {"id": "a", "captured_at": 1.0}


def test_what_strangers_ask_passes_and_comes_back(tmp_path: Path) -> None:
    run, unix = Flown(), tmp_path / "reports.sock"

    async def talk() -> None:
        async with behind_a_door(run, tmp_path, {"unix": str(unix)}) as client:
            receipts = (await client.post("/api/reports", json=[FRAME, {**FRAME, "id": "b"}])).json()
            assert [each["status"] for each in receipts] == ["accepted", "accepted"]
            assert receipts[0]["looks"] == 2
            reject = {"command": "reject", "lat": 47.0, "lon": 8.0}
            assert (await client.post("/api/commands", json=reject)).json() == {"state": "HOLDING"}
            assert (await client.get("/api/state")).json()["state"] == "HOLDING"
            await client.post("/api/commands", json={"command": "replace", "system_id": 7})
            assert "roisearch_pos 0.25" in (await client.get("/metrics")).text
            assert (await client.get("/readyz")).text == "ready\n"
            assert (await client.get("/api/decisions")).json() == []
            reader, writer = await asyncio.open_unix_connection(unix)
            writer.write(json.dumps({**FRAME, "id": "c"}).encode() + b"\n")
            assert json.loads(await asyncio.wait_for(reader.readline(), PATIENCE_S))["status"] == "accepted"
            writer.close()

    asyncio.run(talk())
    assert [report.id for report in run.reports] == ["a", "b", "c"]
    assert run.orders == [("reject", (47.0, 8.0)), ("replace", None)]
    assert run.wanted_system == 7


class Searched(Flown):
    """A run that has searched two cells of its ground."""

    def moment(self) -> Moment:
        pod = np.zeros(self.ground.grid.frame.shape)
        pod[0, :2], pod[0, 2] = 0.5, 0.49
        return replace(super().moment(), pod=pod)


def test_a_tak_team_is_told_what_was_searched_by_the_door_process(tmp_path: Path) -> None:
    run = Searched()

    async def talk() -> ET.Element:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
            inbox.bind(("127.0.0.1", 0))
            inbox.setblocking(False)
            tak = Tak("udp", "127.0.0.1", inbox.getsockname()[1], "Falcon")
            async with (
                behind_a_door(run, tmp_path, telling=TellingPlan(tak=tak)),
                asyncio.timeout(PATIENCE_S),
            ):
                return ET.fromstring(await asyncio.get_running_loop().sock_recv(inbox, 9000))

    event = asyncio.run(talk())
    assert event.attrib["type"] == "u-d-f"
    hectares = 2 * run.ground.grid.frame.cell_m**2 * 1e-4
    assert f"searched: {hectares:.1f} ha" in (event.findtext("detail/remarks") or "")


def test_the_door_process_imports_neither_the_search_nor_its_compiler() -> None:
    """Without them its imports take 96 MiB and not 162, and six tenths of the processor time."""
    program = "import sys, service.border.__main__; print(*sorted(sys.modules))"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    heavy = {"numba", "llvmlite", "skimage", "matplotlib", "pymavlink", "roisearch", "sim"}
    assert sorted({name.split(".")[0] for name in said.split()} & heavy) == []


def test_a_door_process_at_work_has_no_compiler_in_it_either(tmp_path: Path) -> None:
    """Also what it unpickles, and what it imports when it is asked."""
    pages = ("/api/state", "/api/map", "/api/map?format=geojson", "/", "/openapi.json")

    async def talk() -> str:
        async with behind_a_door(Flown(), tmp_path) as client:
            for page in pages:
                assert (await client.get(page)).status_code == 200, page
            (door,) = await children()
            return await asyncio.to_thread(Path(f"/proc/{door}/maps").read_text)

    mapped = asyncio.run(talk())
    assert "python" in mapped
    assert "numba" not in mapped
    assert "llvmlite" not in mapped


def test_news_pass_and_what_is_wrong_with_them_comes_back_in_words(tmp_path: Path) -> None:
    run = Flown()
    geometry = {"type": "Point", "coordinates": [8.3006, 47.0507]}
    clue = {"role": "clue", "bayes_factor": 5, "sigma_m": 30}
    feature = {"type": "Feature", "id": "glove", "geometry": geometry, "properties": clue}
    far = {**feature, "geometry": {"type": "Point", "coordinates": [47.0507, 8.3006]}}

    async def talk() -> None:
        async with behind_a_door(run, tmp_path) as client:
            heard = (await client.post("/api/news", json=feature)).json()
            cells = len(run.news[0].cells)
            assert heard == {"id": "glove", "status": "accepted", "cells": cells, "notes": []}
            refused = await client.post("/api/news", json=far)
            assert refused.status_code == 422
            assert "are longitude and latitude swapped?" in refused.json()["detail"]
            back = (await client.post("/api/news/glove/withdraw")).json()
            assert back["status"] == "withdrawn"
            again = await client.post("/api/news/glove/withdraw")
            assert (again.status_code, again.json()["detail"]) == (422, "there is no news 'glove'")

    asyncio.run(talk())


def test_the_map_passes_to_the_last_bit_and_only_what_is_new_of_the_track(tmp_path: Path) -> None:
    run = Flown()

    async def talk() -> None:
        async with behind_a_door(run, tmp_path) as client:
            told = (await client.get("/api/map")).json()
            shown = np.array([[0.0 if p is None else p for p in row] for row in told["probability"]])
            assert np.array_equal(
                shown.ravel(), np.where(run.ground.grid.searchable.ravel(), run.weights, 0.0)
            )
            assert told["digest"] == "a digest"
            run.weights[run.weights > 0.0] *= 0.5
            run.tracks[0] += [(47.0, 8.0), (47.1, 8.1)]
            cells = (await client.get("/api/map?format=geojson")).json()["features"]
            track = [each for each in cells if each["properties"]["role"] == "track"]
            assert track[0]["geometry"]["coordinates"] == [[8.0, 47.0], [8.1, 47.1]]
            assert track[0]["properties"] == {"role": "track"}
            masses = [c["properties"]["probability"] for c in cells if c["properties"]["role"] == "cell"]
            assert sum(masses) == pytest.approx(0.5)
            run.tracks[0].append((47.2, 8.2))
            url = str(client.base_url).replace("http", "ws").rstrip("/")
            async with connect(f"{url}/api/events") as watcher:
                assert json.loads(await watcher.recv())["type"] == "scene"
                moment = json.loads(await watcher.recv())
                assert moment["track"] == {"from": 0, "rows": [[47.0, 8.0], [47.1, 8.1], [47.2, 8.2]]}
                assert "tracks" not in moment

    asyncio.run(talk())


def test_the_tracks_of_all_aircraft_pass_and_of_each_only_what_is_new(tmp_path: Path) -> None:
    run = Flown()
    run.tracks = [[(47.0, 8.0), (47.1, 8.1)], [(46.0, 8.0), (46.1, 8.1), (46.2, 8.2)]]

    async def talk() -> None:
        async with behind_a_door(run, tmp_path) as client:
            url = str(client.base_url).replace("http", "ws").rstrip("/")
            async with connect(f"{url}/api/events") as watcher:
                assert json.loads(await watcher.recv())["type"] == "scene"
                moment = json.loads(await watcher.recv())
                assert "track" not in moment
                assert moment["tracks"] == [
                    {"from": 0, "rows": [[47.0, 8.0], [47.1, 8.1]]},
                    {"from": 0, "rows": [[46.0, 8.0], [46.1, 8.1], [46.2, 8.2]]},
                ]
                run.tracks[1].append((46.3, 8.3))
                while "tracks" not in (moment := json.loads(await watcher.recv())):
                    pass
                assert moment["tracks"] == [None, {"from": 3, "rows": [[46.3, 8.3]]}]
            cells = (await client.get("/api/map?format=geojson")).json()["features"]
            lines = [each for each in cells if each["properties"]["role"] == "track"]
            assert [each["properties"]["aircraft"] for each in lines] == ["drone 1", "drone 2"]
            assert [len(each["geometry"]["coordinates"]) for each in lines] == [2, 4]

    asyncio.run(talk())


def test_a_lost_journal_is_told_at_the_door(tmp_path: Path) -> None:
    run = Flown()
    run.fault = JournalLost("the journal j cannot be written: disk full")

    async def talk() -> list[httpx.Response]:
        async with behind_a_door(run, tmp_path) as client:
            return [
                await client.post("/api/reports", json=FRAME),
                await client.post("/api/commands", json={"command": "hold"}),
            ]

    for answer in asyncio.run(talk()):
        assert answer.status_code == 503
        assert "disk full" in answer.json()["detail"]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_door_process_that_ends_or_hangs_is_started_again_and_the_flight_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, number: int
) -> None:
    monkeypatch.setattr(keeper, "SILENT_BEATS", 2)
    run = Flown()

    async def talk() -> None:
        async with behind_a_door(run, tmp_path) as client:
            (first,) = await children()
            turns = 0
            os.kill(first, number)
            async with asyncio.timeout(PATIENCE_S):
                while first in await children() or not await children():
                    turns += 1
                    await asyncio.sleep(0.01)
                assert turns > 10  # the flight has had its turns all the while
                answer = await client.post("/api/commands", json={"command": "hold"})
            assert answer.json() == {"state": "HOLDING"}

    asyncio.run(talk())
    said = "SIGKILL" if number == signal.SIGKILL else "no sign of life for 2 s"
    assert f"the door process has ended ({said if 'no' in said else 'by ' + said})" in caplog.text
    assert "the flight goes on" in caplog.text


def test_the_doors_stay_open_on_the_way_home(tmp_path: Path) -> None:
    """Ctrl-C and a service manager's SIGTERM are for the flight, and no terminal ends them."""
    run = Flown()

    async def talk() -> None:
        async with behind_a_door(run, tmp_path) as client:
            (process,) = await children()
            for number in (signal.SIGINT, signal.SIGTERM, *OF_A_TERMINAL):
                os.kill(process, number)
            assert (await client.get("/healthz")).text == "ok\n"
            assert await children() == [process]

    asyncio.run(talk())


def test_where_memory_runs_out_the_doors_go_first(tmp_path: Path) -> None:
    def chance(process: int | str) -> int:
        return int(Path(f"/proc/{process}/oom_score_adj").read_text())

    async def talk() -> int:
        async with behind_a_door(Flown(), tmp_path):
            (process,) = await children()
            return chance(process)

    assert asyncio.run(talk()) >= chance("self") + 400


def test_a_flight_that_does_not_answer_is_told_and_does_not_look_healthy(tmp_path: Path) -> None:
    run = Flown()

    async def talk() -> list[int]:
        async with behind_a_door(run, tmp_path) as client:
            codes = [(await client.get("/healthz")).status_code]
            url = f"http://127.0.0.1:{client.base_url.port}/healthz"
            loop = asyncio.get_running_loop()
            asking = loop.run_in_executor(None, lambda: httpx.get(url, timeout=PATIENCE_S))
            time.sleep(8.0)  # noqa: ASYNC251 - the flight's loop stands still
            return [*codes, (await asking).status_code]

    assert asyncio.run(talk()) == [200, 503]


def test_a_killed_service_leaves_no_address_taken(tmp_path: Path) -> None:
    """Whoever starts it again has the same address at once."""
    code = (
        "import asyncio, sys\n"
        "from pathlib import Path\n"
        "from tests.service.border.flown import Flown, behind_a_door\n"
        "async def stay():\n"
        "    async with behind_a_door(Flown(), Path(sys.argv[1])) as client:\n"
        "        print(client.base_url.port, flush=True)\n"
        "        await asyncio.sleep(600)\n"
        "asyncio.run(stay())\n"
    )
    root = Path(__file__).parents[3]
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], cwd=root, stdout=subprocess.PIPE, text=True
    ) as service:
        assert service.stdout is not None
        port = int(service.stdout.readline())
        service.kill()
        service.wait()
        deadline = time.monotonic() + PATIENCE_S
        while True:
            with socket.socket() as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind(("127.0.0.1", port))
                    probe.listen()
                    return
                except OSError:
                    assert time.monotonic() < deadline
                    time.sleep(0.02)


def started_by(process: int) -> list[int]:
    """The processes that a process has started and that still live."""
    tasks = Path(f"/proc/{process}/task").iterdir()
    return [int(pid) for task in tasks for pid in (task / "children").read_text().split()]


def lives(process: int) -> bool:
    return Path(f"/proc/{process}").exists()


def test_the_doors_share_the_flights_session_and_not_its_terminal(tmp_path: Path) -> None:
    """A session of its own is a group by itself to the kernel's scheduler: an order waited for a second on a core that
    others used."""

    async def look() -> tuple[int, int]:
        async with behind_a_door(Flown(), tmp_path):
            (door,) = await children()
            return os.getsid(door), os.getpgid(door)

    session, group = asyncio.run(look())
    assert session == os.getsid(0)
    assert group != os.getpgid(0)


def test_maps_are_drawn_in_another_process_that_may_end(tmp_path: Path) -> None:
    """The thread that writes a map would have the interpreter's lock whenever an order wants it."""

    async def talk() -> None:
        async with behind_a_door(Flown(), tmp_path) as client:
            (door,) = await children()
            assert not started_by(door)  # nobody has asked for one yet
            both = [client.get(path) for path in ("/api/map", "/api/map?format=geojson")]
            cells, geojson = await asyncio.gather(*both)
            assert len(cells.json()["probability"]) == Flown().ground.grid.frame.shape[0]
            assert geojson.json()["type"] == "FeatureCollection"
            assert (await client.get("/api/decisions")).json() == []
            (drawing,) = started_by(door)
            os.kill(drawing, signal.SIGKILL)
            said = (await client.get("/api/map")).status_code
            again = await client.get("/api/map")
            assert said in {200, 503}
            assert again.json()["digest"] == cells.json()["digest"]
            (drawing,) = started_by(door)
        async with asyncio.timeout(PATIENCE_S):
            while lives(drawing):  # noqa: ASYNC110 - a process
                await asyncio.sleep(0.01)

    asyncio.run(talk())


def test_who_draws_ends_without_a_word_when_the_one_who_asks_dies_in_the_middle_of_it() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        words = [sys.executable, "-m", "service.border.drawer", str(theirs.fileno())]
        drawer = subprocess.Popen(words, pass_fds=[theirs.fileno()], stderr=subprocess.PIPE, text=True)
        theirs.close()
        ours.sendall((100).to_bytes(4, "big") + b"the beginning of what was to be drawn")
    _, said = drawer.communicate(timeout=PATIENCE_S)
    assert (drawer.returncode, said) == (0, "")
