"""`roisearch-sim bench intake`: how many detector reports a searching service takes in, and how long each takes.

A real service process flies the built-in mock and plans; this process sends it reports of frames below the aircraft at
every door at once: HTTP in batches, lines over UDP and over a Unix socket. How long a report takes from its arrival to
the belief, the service tells in /metrics. The times in the table are more than that: from when a report was due to be
sent until its receipt is here, which comes when it is on disk and in the belief. Then every door is driven as fast as
it goes, and compared with one report per HTTP request.

Lost is a report without a receipt that says so, or that the journal does not hold exactly once.
"""

from __future__ import annotations

import http.client
import itertools
import json
import os
import random
import re
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from service.errors import Parser

Report = dict[str, Any]
RATE_AT_LEAST, P99_AT_MOST_MS = 500.0, 50.0
COUNTED = ("roisearch_report_to_belief_seconds", "roisearch_hit_to_waypoint_seconds")
HIT_SHARE = 0.01
BATCH = 20
WINDOW = 64  # reports on their way at once when a door is driven as fast as it goes
SETTINGS = {
    "ROISEARCH_SEARCH_FOUND_AT": "0.999999999",  # the search shall go on
    "ROISEARCH_SEARCH_STOP_AT_POS": "0.999999",
    "ROISEARCH_FLIGHT_MAX_FLIGHT_S": "36000",
    "ROISEARCH_DEMO_ENDURANCE_MIN": "600",
    "ROISEARCH_HTTP_REPORTS_PER_S": "1000000",
}


@dataclass
class Tally:
    """What was sent at one door and what came back: seconds until each receipt."""

    door: str
    sent: int = 0
    seconds: list[float] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)
    elsewise: list[Report] = field(default_factory=list)
    took_s: float = 0.0

    def receive(self, receipts: Sequence[Report], since: float) -> None:
        """Receipts that are here now, of reports that were due at `since` (monotonic)."""
        now = time.monotonic()
        for receipt in receipts:
            self.ids.append(receipt["id"])
            self.seconds.append(now - since)
            if receipt["status"] != "accepted":
                self.elsewise.append(receipt)

    @property
    def rate(self) -> float:
        """Receipts a second."""
        return len(self.ids) / self.took_s

    def percentile_ms(self, share: float) -> float:
        """A percentile of the times, milliseconds."""
        return 1e3 * float(np.percentile(self.seconds, share)) if self.seconds else float("nan")


class Camera:
    """Frames below the aircraft: it follows the service's state and makes reports of it; one in a hundred has a hit."""

    def __init__(self, address: str, seed: int) -> None:
        self._address, self._rng = address, random.Random(seed)
        self._count = itertools.count()
        self._state: dict[str, Any] = {}
        self._gone = ""
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def start(self, patience_s: float) -> None:
        """Wait until the search has begun."""
        self._thread.start()
        deadline = time.monotonic() + patience_s
        while self._state.get("state") not in ("SEARCHING", "CONFIRMING"):
            if self._gone or time.monotonic() > deadline:
                raise RuntimeError(f"the service does not search: {self._gone or self._state.get('state')}")
            time.sleep(0.1)

    def stop(self) -> None:
        """Follow no more."""
        self._ended.set()
        self._thread.join()

    @property
    def searching(self) -> bool:
        """Whether the aircraft still flies its search."""
        return self._state.get("state") in ("SEARCHING", "CONFIRMING")

    def frame(self, source: str) -> Report:
        """The report of one frame."""
        state, number = self._state, next(self._count)
        seen = []
        cells = state["footprint"]["cells"]
        if cells and self._rng.random() < HIT_SHARE:
            seen.append({"class": "person", "score": 0.8, "lat": cells[0]["lat"], "lon": cells[0]["lon"]})
        when = state["pose"]["time"] - 0.5 * self._rng.random()
        return {
            "id": f"{source}-{number}",
            "source": source,
            "captured_at": when,
            "threshold": 0.4,
            "detections": seen,
        }

    def _follow(self) -> None:
        connection = http.client.HTTPConnection(self._address, timeout=30)
        while not self._ended.wait(0.1):
            try:
                connection.request("GET", "/api/state")
                state = json.loads(connection.getresponse().read())
            except (OSError, http.client.HTTPException) as error:
                self._gone = str(error)
                return
            if state["pose"] is not None:
                self._state = state


Make = Callable[[], Report]


class Http:
    """One connection, a batch in each request."""

    def __init__(self, address: str, batch: int) -> None:
        self.batch = batch
        self._connection = http.client.HTTPConnection(address, timeout=30)

    def steady(self, make: Make, rate: float, seconds: float, tally: Tally) -> None:
        """Send at a rate, whatever comes back."""
        began = time.monotonic()
        for number in range(int(rate * seconds / self.batch)):
            due = began + number * self.batch / rate
            time.sleep(max(0.0, due - time.monotonic()))
            self._exchange(make, tally, due)
        tally.took_s = time.monotonic() - began

    def flat_out(self, make: Make, seconds: float, tally: Tally) -> None:
        """Send as fast as it goes."""
        began = time.monotonic()
        while (now := time.monotonic()) < began + seconds:
            self._exchange(make, tally, now)
        tally.took_s = time.monotonic() - began

    def _exchange(self, make: Make, tally: Tally, due: float) -> None:
        reports = [make() for _ in range(self.batch)]
        tally.sent += len(reports)
        body = json.dumps(reports if self.batch > 1 else reports[0])
        self._connection.request("POST", "/api/reports", body, {"content-type": "application/json"})
        answer = self._connection.getresponse()
        content = answer.read()
        if answer.status != 200:
            raise RuntimeError(f"HTTP {answer.status}: {content[:200]!r}")
        tally.receive(json.loads(content), due)


class Lines:
    """Lines of JSON over a datagram or stream socket; receipts are read by a thread of their own."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._socket.settimeout(10.0)
        self._due: dict[str, float] = {}
        self._free = threading.Semaphore(0)

    def steady(self, make: Make, rate: float, seconds: float, tally: Tally) -> None:
        """Send at a rate, whatever comes back."""
        with self._receiving(tally):
            began = time.monotonic()
            for number in range(int(rate * seconds)):
                due = began + number / rate
                time.sleep(max(0.0, due - time.monotonic()))
                self._send(make, tally, due)
            tally.took_s = time.monotonic() - began

    def flat_out(self, make: Make, seconds: float, tally: Tally) -> None:
        """Keep a window of reports on their way."""
        self._free = threading.Semaphore(WINDOW)
        with self._receiving(tally):
            began = time.monotonic()
            while (now := time.monotonic()) < began + seconds:
                if self._free.acquire(timeout=1.0):
                    self._send(make, tally, now)
            tally.took_s = time.monotonic() - began

    def _send(self, make: Make, tally: Tally, due: float) -> None:
        report = make()
        self._due[report["id"]] = due
        tally.sent += 1
        self._socket.sendall(json.dumps(report).encode() + b"\n")

    @contextmanager
    def _receiving(self, tally: Tally) -> Iterator[None]:
        """Read receipts meanwhile, and afterwards until all are here or none has come for a while."""
        done = threading.Event()

        def read() -> None:
            rest = b""
            while not (done.is_set() and len(tally.ids) >= tally.sent):
                try:
                    *whole, rest = (rest + self._socket.recv(1 << 16)).split(b"\n")
                except TimeoutError:
                    return  # what is missing is lost
                for line in whole:
                    receipt = json.loads(line)
                    tally.receive([receipt], self._due.pop(receipt["id"]))
                    self._free.release()

        reader = threading.Thread(target=read)
        reader.start()
        try:
            yield
        finally:
            done.set()
            if len(tally.ids) >= tally.sent:
                self._socket.settimeout(0.2)
            reader.join()
            self._socket.settimeout(10.0)


@dataclass(frozen=True)
class Service:
    """A searching service: its doors and its journal."""

    address: str
    udp: int
    unix: str
    runs: Path

    def by_udp(self) -> Lines:
        """The UDP door."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.connect(("127.0.0.1", self.udp))
        return Lines(sock)

    def by_unix(self) -> Lines:
        """The Unix socket."""
        sock = socket.socket(socket.AF_UNIX)
        sock.connect(self.unix)
        return Lines(sock)

    def counted(self, name: str) -> dict[float, float]:
        """What the service counts in /metrics: events that took up to so many seconds."""
        connection = http.client.HTTPConnection(self.address, timeout=30)
        connection.request("GET", "/metrics")
        text = connection.getresponse().read().decode()
        found = re.findall(rf'^{name}_bucket\{{le="([^"]+)"\}} (\S+)', text, re.MULTILINE)
        return {float(limit): float(count) for limit, count in found}

    def rows(self, kind: str) -> list[dict[str, Any]]:
        """The journal's rows of a kind."""
        (journal,) = self.runs.glob("*/journal.sqlite")
        database = sqlite3.connect(f"file:{journal}?mode=ro", uri=True)
        try:
            query = "SELECT body FROM events WHERE kind = ?"
            return [json.loads(body) for (body,) in database.execute(query, (kind,))]
        finally:
            database.close()


@contextmanager
def searching_service(area: Path, folder: Path, speedup: float) -> Iterator[Service]:
    """A `roisearch-service` with the built-in mock and every door open."""
    unix = str(folder / "reports.sock")
    words = [sys.executable, "-m", "service", "--area", str(area), "--runs", str(folder / "runs")]
    words += ["--http", "127.0.0.1:0", "--speedup", f"{speedup:g}"]
    doors = {"ROISEARCH_DOORS_UDP": "127.0.0.1:0", "ROISEARCH_DOORS_UNIX": unix}
    process = subprocess.Popen(
        words,
        env={**os.environ, **SETTINGS, **doors},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    said: list[str] = []
    try:
        assert process.stdout is not None
        found: dict[str, str] = {}
        for line in process.stdout:
            said.append(line)
            for name, pattern in (
                ("udp", r"udp://127\.0\.0\.1:(\d+)"),
                ("http", r"listening on http://(\S+)"),
            ):
                if match := re.search(pattern, line):
                    found[name] = match.group(1)
            if len(found) == 2:
                break
        if len(found) < 2:
            raise RuntimeError("the service did not start:\n" + "".join(said))
        threading.Thread(target=lambda: said.extend(process.stdout or ()), daemon=True).start()
        yield Service(found["http"], int(found["udp"]), unix, folder / "runs")
    finally:
        process.terminate()
        process.terminate()  # twice: it does not fly home first
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def all_at_once(service: Service, camera: Camera, rate: float, seconds: float) -> list[Tally]:
    """A third of the rate at each door."""
    doors: list[tuple[str, Http | Lines]] = [
        (f"HTTP, batches of {BATCH}", Http(service.address, BATCH)),
        ("UDP", service.by_udp()),
        ("Unix socket", service.by_unix()),
    ]
    tallies = [Tally(name) for name, _ in doors]
    threads = [
        threading.Thread(
            target=door.steady, args=(lambda n=name: camera.frame(n), rate / len(doors), seconds, tally)
        )
        for (name, door), tally in zip(doors, tallies, strict=True)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return tallies


def each_flat_out(service: Service, camera: Camera, seconds: float) -> list[Tally]:
    """One door after the other, as fast as it goes; the first is the plain one."""
    tallies = []
    for name, door in (
        ("HTTP, one report a request", Http(service.address, 1)),
        (f"HTTP, batches of {BATCH}", Http(service.address, BATCH)),
        ("UDP", service.by_udp()),
        ("Unix socket", service.by_unix()),
    ):
        tally = Tally(f"{name}, flat out")
        door.flat_out(lambda n=tally.door: camera.frame(n), seconds, tally)  # type: ignore[misc]
        tallies.append(tally)
    return tallies


def p99_limit_ms(before: dict[float, float], after: dict[float, float]) -> float:
    """The smallest limit, in milliseconds, below which 99 of 100 events between two counts stayed; NaN: no events."""
    counts = {limit: after[limit] - before[limit] for limit in after}
    if not counts[float("inf")]:
        return float("nan")
    return min(1e3 * limit for limit, count in counts.items() if count >= 0.99 * counts[float("inf")])


def lost(tallies: Sequence[Tally], written: Sequence[str]) -> int:
    """Reports without a good receipt, or that the journal does not hold exactly once."""
    times: dict[str, int] = {}
    for name in written:
        times[name] = times.get(name, 0) + 1
    missing = sum(tally.sent - len(set(tally.ids)) + len(tally.elsewise) for tally in tallies)
    return missing + sum(times.get(name, 0) != 1 for tally in tallies for name in tally.ids)


def main(arguments: list[str]) -> int:
    """Run the benchmark; 1 with `--check` when a target is missed or anything was lost, else 0."""
    parser = Parser(prog="roisearch-sim bench intake", description=main.__doc__)
    parser.add_argument("--area", type=Path, default=Path("config/areas/mountain-valley.geojson"))
    parser.add_argument("--rate", type=float, default=600.0, help="reports a second, all doors (default 600)")
    parser.add_argument("--seconds", type=float, default=20.0, help="how long (default 20)")
    parser.add_argument("--flat-out", type=float, default=4.0, help="seconds at each door (default 4)")
    parser.add_argument("--speedup", type=float, default=5.0, help="of the mock (default 5)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--check", action="store_true", help="exit 1 when a target is missed")
    options = parser.parse_args(arguments)
    with (
        tempfile.TemporaryDirectory() as folder,
        searching_service(options.area, Path(folder), options.speedup) as service,
    ):
        camera = Camera(service.address, options.seed)
        camera.start(patience_s=180.0)
        decided, before = len(service.rows("decision")), [service.counted(name) for name in COUNTED]
        steady = all_at_once(service, camera, options.rate, options.seconds)
        p99_ms, waypoint_ms = (
            p99_limit_ms(first, service.counted(name)) for first, name in zip(before, COUNTED, strict=True)
        )
        decided = len(service.rows("decision")) - decided
        searching = camera.searching
        flat_out = each_flat_out(service, camera, options.flat_out)
        camera.stop()
        gone = lost([*steady, *flat_out], [row["report"]["id"] for row in service.rows("report")])
    whole = Tally("all doors at once")
    for tally in steady:
        whole.sent += tally.sent
        whole.ids += tally.ids
        whole.seconds += tally.seconds
        whole.took_s = max(whole.took_s, tally.took_s)
    plain = flat_out[0].rate
    print(f"{'door':38} {'sent':>6} {'reports/s':>9} {'p50 ms':>7} {'p99 ms':>7}  times the plain one")
    for tally in [whole, *steady, *flat_out]:
        ratio = f"{tally.rate / plain:.1f}" if tally in flat_out else ""
        times = f"{tally.percentile_ms(50):7.1f} {tally.percentile_ms(99):7.1f}"
        print(f"{tally.door:38} {tally.sent:6d} {tally.rate:9.0f} {times}  {ratio}")
    print(f"all doors at once, by the service's own clock: from arrival to belief p99 below {p99_ms:g} ms,")
    print(f"from a hit's report to the next waypoint p99 below {waypoint_ms:g} ms")
    print(f"decisions meanwhile: {decided}; still searching at the end: {'yes' if searching else 'no'}")
    print(f"lost: {gone}")
    for tally in [*steady, *flat_out]:
        for receipt in tally.elsewise[:2]:
            print(f"  {tally.door}: {receipt['status']} {receipt['reason']}")
    targets = [
        (f"at least {RATE_AT_LEAST:.0f} reports a second", whole.rate >= RATE_AT_LEAST),
        (f"p99 from arrival to belief at most {P99_AT_MOST_MS:.0f} ms", p99_ms <= P99_AT_MOST_MS),
        ("nothing lost", gone == 0),
        ("planning all the while", searching and decided > 0),
    ]
    for target, met in targets:
        print(f"{'met   ' if met else 'MISSED'} {target}")
    return 1 if options.check and not all(met for _, met in targets) else 0
