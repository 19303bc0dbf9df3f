"""What any bytes may be thrown at. Each target takes bytes and raises only when the software did something wrong.

Wrong is: an exception that is not the one meant for bad input, an answer of 500 or more, or a belief that is not
a probability any more.
"""

from __future__ import annotations

import asyncio
import atexit
import json
import tempfile
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from roisearch import Belief
from service.area import build_grid, parse_area
from service.area.faults import BadArea
from service.clock import Clock
from service.config import Settings, read_settings
from service.errors import BadInput
from service.evidence.intake import Intake
from service.evidence.mask import Sensor
from service.evidence.moments import Moments
from service.evidence.observe import FramePose, Observation
from service.evidence.reports import OrderReceipt, Receipt, Report
from service.http import create_app, split_address
from service.journal import Journal
from service.mavlink import NotPermitted
from service.mavlink.core import LinkCore
from service.mavlink.settings import MavlinkSettings
from service.mavlink.url import parse_url
from service.search import Search
from tests.integration.flight import FIELD
from tests.service.mavlink.peer import START, Peer

CELL_M = 10.0
SYSTEM = 7


def check(belief: Belief) -> None:
    """A belief is a probability: finite, not negative, and with `outside` it sums to one."""
    p, outside = belief.probability(), belief.outside
    assert np.isfinite(p).all(), "the belief is not finite"
    assert (p >= 0).all(), "the belief is negative"
    assert 0 <= outside <= 1, "'outside' is not a probability"
    assert abs(p.sum() + outside - 1.0) < 1e-9, f"the belief sums to {p.sum() + outside!r}"


def field_search() -> Search:
    """A search of a small field."""
    settings = Settings.model_validate({"sensor": {"cell_m": CELL_M}})
    return Search(build_grid(parse_area(json.dumps(FIELD).encode(), source="field"), CELL_M), settings)


def sensor_of(search: Search) -> Sensor:
    """A camera that sees one cell."""
    return Sensor(search.grid.frame, search.fov, 0.9, 0.9, 0.2, 0.8, 30.0)


# ---- MAVLink


def frame_of(number: int, payload: bytes) -> bytes:
    """A good frame of the vehicle with any content: a message of any kind, its checksum right."""
    known = sorted(mavlink.mavlink_map)
    message_id = known[number % len(known)]
    kind = mavlink.mavlink_map[message_id]
    payload = payload[: kind.unpacker.size] or b"\0"
    header = bytes([len(payload), 0, 0, number & 0xFF, SYSTEM, 1, *message_id.to_bytes(3, "little")])
    checksum = mavlink.x25crc(header + payload + bytes([kind.crc_extra])).crc
    return b"\xfd" + header + payload + checksum.to_bytes(2, "little")


def pieces_of(data: bytes) -> list[bytes]:
    """Bytes cut up by themselves: the first says how long the next piece is."""
    pieces = []
    while data:
        length, data = data[0], data[1:]
        pieces.append(data[:length])
        data = data[length:]
    return pieces


def fuzz_mavlink(data: bytes) -> None:
    """Whatever the wire brings: noise, or good frames with any content, signed link or not."""
    if not data:
        return
    flavor, paired, signed = ("px4", "ardupilot")[data[0] & 1], data[0] & 2, data[0] & 4
    core = LinkCore(MavlinkSettings(signing_key=b"k" * 32 if signed else None), speaks_first=True)
    now = START
    if paired and not signed:
        core.receive_data(Peer(flavor, system=SYSTEM).heartbeat(), now)
        core.tick(now)
    for piece in pieces_of(data[1:]):
        now += 0.05
        if len(piece) > 2 and piece[0] & 1:
            piece = frame_of(int.from_bytes(piece[:2], "little") >> 1, piece[2:])
        core.receive_data(piece, now)
        core.tick(now)
        for order in (core.take_control, core.hold):
            try:
                order(now)
            except NotPermitted:
                continue
        for frame in core.data_to_send():
            assert mavlink.MAVLink(None).decode(bytearray(frame)) is not None
        _look_from(core, now)
    core.tick(now + 5.0)
    assert not signed or not core.paired


_field: Search | None = None


def _look_from(core: LinkCore, now: float) -> None:
    """What the telemetry makes of a frame taken now must be a look at the belief, or nothing."""
    global _field
    _field = _field or field_search()
    pose = core.history.pose_at(now)
    if pose is not None:
        sensor = sensor_of(_field)
        sensor.footprint(FramePose(pose.lat, pose.lon, pose.alt_home_m, pose.heading_deg, now))


# ---- area files


def fuzz_area(data: bytes) -> None:
    """Whatever is in an area file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)  # a division by zero, even if it ends well
            area = parse_area(data, source="fuzz")
            grid = build_grid(area, 20.0, max_cells=20_000)
    except BadInput as error:
        assert_sentence(error)
        return
    assert abs(grid.prior.sum() - 1.0) < 1e-9
    assert (grid.prior >= 0).all()
    check(Belief(grid.prior, searchable=grid.searchable, outside=grid.outside))


def assert_sentence(error: BadInput) -> None:
    """A message for a person: one line, or one for each fault of an area file and one before them; not endless, and
    something that any terminal can show."""
    text = str(error)
    first, *faults = text.split("\n")
    assert first
    assert len(text) < 2000 * (1 + len(faults))
    assert not faults or (isinstance(error, BadArea) and len(faults) > 1)
    assert all(fault.startswith("  ") and fault.strip() for fault in faults)
    text.encode("utf-8")


# ---- settings


def fuzz_settings(data: bytes) -> None:
    """Whatever is in a settings file, and the addresses that it gives."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "settings.toml"
        file.write_bytes(data)
        try:
            settings = read_settings(file, environment={})
            split_address(settings.http.listen)
            if settings.link.connect:
                parse_url(settings.link.connect)
        except BadInput as error:
            assert_sentence(error)


# ---- detector reports


class OpenDoor:
    """The real application, intake, journal and belief, without a vehicle."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._runner = asyncio.Runner()
        self.search = field_search()
        self._journal = Journal(Path(self._folder.name) / "journal.sqlite")
        clock = Clock()
        lat, lon = self.search.grid.frame.to_latlon([[3, 3]])[0]
        here = FramePose(float(lat), float(lon), 30.0, 0.0, clock.now())
        self.intake = Intake(
            self.search,
            sensor_of(self.search),
            self._journal,
            Moments(clock),
            lambda moment: here,
            self._told,
        )
        self._client = httpx.AsyncClient(
            transport=httpx.ASGITransport(app=create_app(self)), base_url="http://localhost"
        )

    def _told(self, observation: Observation, arrived: float) -> None:
        check(self.search.belief)

    async def state(self) -> dict[str, Any]:
        return {"state": "SEARCHING"}

    async def map(self) -> bytes:
        return b"{}"

    async def picture(self) -> bytes:
        return b""

    async def ready(self) -> bool:
        return True

    async def submit_all(self, reports: Sequence[Report]) -> list[Receipt]:
        return await self.intake.submit_all(reports)

    async def order(self, command: str) -> OrderReceipt:
        return OrderReceipt(state="HOLDING")

    def post(self, path: str, body: bytes, headers: dict[str, str] | None = None) -> httpx.Response:
        """Post bytes; an exception of the application is raised here."""
        given = {"content-type": "application/json"} if headers is None else headers
        return self._runner.run(self._client.post(path, content=body, headers=given))

    def close(self) -> None:
        """Give the folder back."""
        self._runner.run(self._client.aclose())
        self._runner.close()
        self._journal.close()
        self._folder.cleanup()


_door: OpenDoor | None = None


def open_door() -> OpenDoor:
    """The one door of this process, closed at its end."""
    global _door
    if _door is None:
        _door = OpenDoor()
        atexit.register(_door.close)
    return _door


def fuzz_door(data: bytes) -> httpx.Response:
    """Whatever is posted as a report."""
    door = open_door()
    answer = door.post("/api/reports", data)
    assert answer.status_code in (200, 400, 413, 415, 422, 429), answer.text
    json.loads(answer.content.decode("utf-8"))
    check(door.search.belief)
    return answer


TARGETS: dict[str, Callable[[bytes], object]] = {
    "mavlink": fuzz_mavlink,
    "area": fuzz_area,
    "settings": fuzz_settings,
    "door": fuzz_door,
}
