"""MAVLink 2 signing, with pymavlink's own signing as the other side, which shares no code with ours."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import logging
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.clock import Clock
from service.config import read_settings
from service.errors import BadInput
from service.mavlink import MavlinkSettings, NoVehicle, Vehicle, read_signing_key
from service.mavlink.framing import Codec, Framer, own_heartbeat
from service.mavlink.keeper import TimestampKeeper
from service.mavlink.signing import EPOCH_S, PER_S, Signer, timestamp_at
from service.run import run

from .peer import PILOT, START, Peer, Rig

KEY, OTHER_KEY = bytes(range(1, 33)), bytes(range(2, 34))
NOW = timestamp_at(START)


def let_sign(mav: Any, key: bytes = KEY, timestamp: int = NOW, link_id: int = 3) -> None:
    """Make pymavlink sign what it sends, and check what it reads."""
    mav.signing.secret_key = key
    mav.signing.sign_outgoing = True
    mav.signing.timestamp = timestamp
    mav.signing.link_id = link_id


def signed_rig(key: bytes = KEY) -> Rig:
    """A core with our key and a peer that signs with another copy of it, or with another key."""
    rig = Rig(signing_key=KEY)
    assert rig.core.codec.signer is not None
    rig.core.codec.signer.advance(NOW)
    let_sign(rig.peer.mav, key)
    let_sign(rig.reader, key)
    return rig


def read(frame: bytes, key: bytes = KEY) -> Any:
    """What pymavlink makes of a frame; raises MAVError when the signature is not right."""
    reader = mavlink.MAVLink(None)
    let_sign(reader, key, timestamp=0)
    return reader.decode(bytearray(frame))


# ---- what we send


def test_what_is_sent_is_signed_as_pymavlink_checks_it() -> None:
    signer = Signer(KEY, link_id=5)
    signer.advance(NOW)
    codec = Codec(7, 191, signer)
    for message in (own_heartbeat(), mavlink.MAVLink_statustext_message(6, b"hello", 0, 0)):
        frame = codec.encode(message)
        heard = read(frame)
        assert (heard.get_type(), heard.get_signed()) == (message.get_type(), True)
        assert (heard.get_srcSystem(), heard.get_srcComponent(), heard.get_link_id()) == (7, 191, 5)
        with pytest.raises(mavlink.MAVError):
            read(frame, OTHER_KEY)


def test_every_command_of_a_signed_flight_is_accepted_by_a_signing_autopilot() -> None:
    rig = signed_rig().flying()
    rig.core.reposition(47.0, 8.0, 520.0, rig.now)
    assert rig.messages("COMMAND_INT", mavlink.MAV_CMD_DO_REPOSITION)
    assert all(message.get_signed() for message in rig.sent)
    assert rig.core.codec.refused == 0


def timestamp_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def test_timestamps_only_grow_whatever_the_clock_and_the_peer_do() -> None:
    signer = Signer(KEY)
    codec = Codec(7, 191, signer)
    peer = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    let_sign(peer, timestamp=NOW + 9 * PER_S)
    used = []
    for clock in (NOW, NOW, NOW - 50 * PER_S, 0, NOW + PER_S):
        signer.advance(clock)
        used += [timestamp_of(codec.encode(own_heartbeat())) for _ in range(3)]
    ahead = bytearray(mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3).pack(peer))
    assert signer.verify(ahead)
    used.append(timestamp_of(codec.encode(own_heartbeat())))
    assert used == sorted(set(used))
    assert used[0] > NOW
    assert used[-1] > NOW + 9 * PER_S  # the guide: a believed timestamp ahead of ours becomes ours


def test_time_is_counted_from_the_beginning_of_2015_in_ten_microseconds() -> None:
    assert timestamp_at(EPOCH_S) == 0
    assert timestamp_at(EPOCH_S + 1.0) == 100_000
    assert timestamp_at(0.0) == 0
    assert EPOCH_S == 1_420_070_400


# ---- what we believe


def test_without_a_key_signed_and_unsigned_are_read() -> None:
    for sign in (False, True):
        rig = Rig()
        if sign:
            let_sign(rig.peer.mav)
        rig.say(rig.peer.heartbeat())
        assert rig.core.paired


@pytest.mark.parametrize("kind", ["unsigned", "other key", "mavlink 1"])
def test_who_has_not_our_key_is_never_paired_with(kind: str) -> None:
    rig = signed_rig()
    if kind == "other key":
        let_sign(rig.peer.mav, OTHER_KEY)
    else:
        rig.peer = Peer()
    frame = rig.peer.heartbeat()
    if kind == "mavlink 1":
        message = mavlink.MAVLink_heartbeat_message(2, 12, 129, 0, 4, 3)
        frame = bytes(message.pack(rig.peer.mav, force_mavlink1=True))
    assert rig.say(frame) == []
    assert not rig.core.paired
    assert (rig.core.codec.refused, rig.core.messages_received) == (1, 0)


def test_a_forged_mode_change_of_the_paired_vehicle_changes_nothing() -> None:
    rig = signed_rig().flying()
    forger = Peer()
    forger.mode = PILOT["px4"]
    before = rig.core.telemetry
    rig.say(forger.heartbeat())
    assert rig.core.telemetry == before
    assert rig.core.in_control
    rig.peer.mode = PILOT["px4"]
    rig.say(rig.peer.heartbeat())
    assert not rig.core.in_control


def test_a_recorded_frame_is_not_believed_again() -> None:
    rig = signed_rig()
    recorded = [rig.peer.heartbeat() for _ in range(3)]
    rig.say(recorded[1])
    received = rig.core.messages_received
    for frame in (recorded[1], recorded[0]):
        rig.say(frame, source="elsewhere")
    assert rig.core.messages_received == received
    rig.say(recorded[2])
    assert rig.core.messages_received == received + 1


def heard(signer: Signer, timestamp: int, link_id: int = 3, key: bytes = KEY) -> bool:
    """Whether a heartbeat of the vehicle with this timestamp is believed."""
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    let_sign(mav, key, timestamp, link_id)
    return signer.verify(mavlink.MAVLink_heartbeat_message(2, 12, 1, 0, 4, 3).pack(mav))


def test_a_stream_heard_for_the_first_time_may_lag_one_minute() -> None:
    signer = Signer(KEY)
    signer.advance(NOW)
    assert not heard(signer, NOW - 60 * PER_S - 1)
    assert heard(signer, NOW - 60 * PER_S)
    assert not heard(signer, NOW - 60 * PER_S)
    assert heard(signer, NOW - 60 * PER_S, link_id=4)  # each link has timestamps of its own


def test_a_forged_frame_from_the_future_does_not_silence_the_vehicle() -> None:
    """pymavlink's own check falls for it: it keeps the timestamp before it has looked at the signature."""
    signer = Signer(KEY)
    signer.advance(NOW)
    assert heard(signer, NOW)
    assert not heard(signer, NOW + 1000 * PER_S, key=OTHER_KEY)
    assert heard(signer, NOW + 1)
    assert signer.timestamp < NOW + 1000 * PER_S


def test_the_end_of_the_counter_is_never_followed() -> None:
    signer = Signer(KEY)
    assert not heard(signer, (1 << 48) - 1)
    signer.advance((1 << 48) + 5)
    Codec(1, 191, signer).encode(own_heartbeat())


@given(at=st.integers(1, 10_000), bit=st.integers(0, 7))
def test_no_bit_of_a_signed_frame_can_be_changed(at: int, bit: int) -> None:
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    let_sign(mav)
    frame = bytearray(mavlink.MAVLink_heartbeat_message(2, 12, 1, 5, 4, 3).pack(mav))
    frame[at % len(frame)] ^= 1 << bit
    signer = Signer(KEY)
    framer = Framer(Codec(1, 191, signer))
    assert framer.feed(bytes(frame), START) + framer.expire(START + 10.0) == []
    assert signer.timestamp == 0


def test_a_radio_needs_no_signature_and_is_never_taken_for_the_vehicle() -> None:
    rig = signed_rig()
    radio = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    status = bytes(mavlink.MAVLink_radio_status_message(200, 200, 90, 20, 20, 0, 0).pack(radio))
    framer = Framer(Codec(1, 191, Signer(KEY)))
    assert [m.get_type() for m in framer.feed(status, START)] == ["RADIO_STATUS"]
    rig.say(rig.peer.heartbeat(), source="vehicle")
    rig.now += 10.0
    rig.say(status, source="radio")
    assert rig.core.codec.refused == 0
    assert rig.core.destination == "vehicle"


@given(noise=st.lists(st.binary(max_size=60), min_size=4, max_size=4))
def test_noise_between_signed_frames_never_costs_one(noise: list[bytes]) -> None:
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    let_sign(mav)
    frames = [bytes(mavlink.MAVLink_heartbeat_message(2, 12, 1, n, 4, 3).pack(mav)) for n in range(1, 5)]
    framer = Framer(Codec(1, 191, Signer(KEY)))
    stream = b"".join(n + f for n, f in zip(noise, frames, strict=True))
    found = framer.feed(stream, START) + framer.expire(START + 10.0)
    assert [m.custom_mode for m in found if m.get_type() == "HEARTBEAT"] == [1, 2, 3, 4]


# ---- only the paired vehicle


@pytest.mark.parametrize(("system", "component"), [(8, 1), (7, 2), (7, 191), (255, 190), (0, 1)])
def test_the_right_key_does_not_make_another_system_the_vehicle(system: int, component: int) -> None:
    rig = signed_rig().flying()
    before, received = rig.core.telemetry, rig.core.messages_received
    stranger = Peer(system=system, component=component)
    let_sign(stranger.mav, timestamp=NOW + PER_S)
    stranger.mode, stranger.armed, stranger.landed, stranger.lat = PILOT["px4"], False, 1, 10.0
    rig.say(stranger.heartbeat() + stranger.position(rig.now) + stranger.landed_state())
    rig.say(stranger.sys_status() + stranger.home_position() + stranger.text("RTL", 2))
    assert rig.core.messages_received == received + 6
    assert rig.core.telemetry == before
    assert rig.core.in_control
    assert rig.events == []


# ---- the key


@pytest.mark.parametrize(
    ("content", "key"),
    [
        (KEY, KEY),
        (KEY.hex().encode(), KEY),
        (KEY.hex().upper().encode() + b"\n", KEY),
        (b"open sesame\n", hashlib.sha256(b"open sesame").digest()),
        (b"a passphrase of thirty-two signs", hashlib.sha256(b"a passphrase of thirty-two signs").digest()),
        ("drüben am Berg".encode(), hashlib.sha256("drüben am Berg".encode()).digest()),
    ],
    ids=["raw", "hex", "HEX", "passphrase", "32 printable", "umlaut"],
)
def test_a_key_is_raw_hexadecimal_or_a_passphrase(tmp_path: Path, content: bytes, key: bytes) -> None:
    file = tmp_path / "key"
    file.write_bytes(content)
    assert read_signing_key(str(file)) == key


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"short", "at least 8"),
        (b"\xff" * 31, "32 bytes, 64"),
        (b"x" * 5000, "more than 4096"),
    ],
)
def test_what_is_no_key_is_refused_without_being_shown(tmp_path: Path, content: bytes, words: str) -> None:
    file = tmp_path / "key"
    file.write_bytes(content)
    with pytest.raises(BadInput, match=words) as caught:
        read_signing_key(str(file))
    assert not content or repr(content[:8])[2:-1] not in str(caught.value)
    with pytest.raises(BadInput, match="cannot be read"):
        read_signing_key(str(tmp_path / "none"))


def test_the_key_is_shown_by_nothing_that_holds_it() -> None:
    settings = MavlinkSettings(signing_key=KEY)
    shown = repr(settings) + repr(settings.for_speedup(20.0)) + repr(Signer(KEY))
    assert repr(KEY) not in shown
    assert "signing_key=" not in shown


def test_the_built_in_mock_is_not_flown_with_a_key(tmp_path: Path) -> None:
    area = Path(__file__).parents[3] / "config" / "area.geojson"
    key = tmp_path / "key"
    key.write_bytes(KEY)
    settings = read_settings(None, environment={}, flags={"link.signing_key_file": str(key)})
    with pytest.raises(BadInput, match="does not sign"):
        run(area, None, settings)


# ---- restarts


class WallClock:
    """A wall clock that a test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = START
        monkeypatch.setattr("service.mavlink.keeper.time.time", lambda: self.now)


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> WallClock:
    return WallClock(monkeypatch)


def test_a_restart_with_the_clock_set_back_reuses_no_timestamp(tmp_path: Path, wall: WallClock) -> None:
    file = tmp_path / "kept" / "signing-timestamp"
    used: list[int] = []
    for clock in (START, START - 1e6, START - 2e6, START + 100.0):
        wall.now = clock
        signer = Signer(KEY)
        keeper = TimestampKeeper(signer, file)
        keeper.begin()
        codec = Codec(7, 191, signer)
        for second in range(25):  # then the process is killed
            wall.now = clock + second
            asyncio.run(keeper.keep())
            used += [timestamp_of(codec.encode(own_heartbeat())) for _ in range(50)]
    assert used == sorted(set(used))


def test_what_is_stored_is_ahead_by_less_than_a_peer_allows(tmp_path: Path, wall: WallClock) -> None:
    file = tmp_path / "signing-timestamp"
    for _ in range(5):
        signer = Signer(KEY)
        TimestampKeeper(signer, file).begin()
        wall.now += 20.0
    assert signer.timestamp - timestamp_at(wall.now) < 60 * PER_S


def test_a_timestamp_that_cannot_be_kept_is_said_before_the_flight(tmp_path: Path, wall: WallClock) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(BadInput, match="signing timestamp cannot be kept"):
        TimestampKeeper(Signer(KEY), blocked / "signing-timestamp").begin()


def test_a_disk_that_fills_up_in_flight_is_warned_of_once(
    tmp_path: Path, wall: WallClock, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    signer = Signer(KEY)
    keeper = TimestampKeeper(signer, tmp_path / "signing-timestamp")
    keeper.begin()

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("service.mavlink.keeper.os.fsync", full)
    for _ in range(3):
        wall.now += 60.0
        asyncio.run(keeper.keep())
    assert caplog.text.count("No space left on device") == 1
    assert signer.timestamp == timestamp_at(wall.now)


@pytest.mark.parametrize("content", ["", "-5", "many", "9" * 400, "ü"])
def test_a_broken_store_is_warned_of_and_the_clock_used(
    tmp_path: Path, wall: WallClock, caplog: pytest.LogCaptureFixture, content: str
) -> None:
    file = tmp_path / "signing-timestamp"
    file.write_text(content, encoding="utf-8")
    signer = Signer(KEY)
    with caplog.at_level(logging.WARNING):
        TimestampKeeper(signer, file).begin()
    assert signer.timestamp == NOW
    assert "no signing timestamp" in caplog.text


# ---- over a real socket


class SocketPeer:
    """An autopilot on pymavlink's own codec, that beats and says where it is until the test ends."""

    def __init__(self, address: str, key: bytes | None) -> None:
        host, port = address.removeprefix("udpin://").rsplit(":", 1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((host, int(port)))
        self._socket.settimeout(0.02)
        self._peer = Peer()
        self._peer.mav.robust_parsing = True
        if key is not None:
            let_sign(self._peer.mav, key, timestamp_at(time.time()))
        self.heard: list[Any] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.is_set():
            self._socket.send(self._peer.heartbeat())
            self._socket.send(self._peer.position(START))
            with contextlib.suppress(TimeoutError):
                while True:
                    data = self._socket.recv(4096)
                    self.heard += self._peer.mav.parse_buffer(bytearray(data)) or []

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._socket.close()


@pytest.mark.parametrize("key", [KEY, None], ids=["signed", "unsigned"])
def test_a_signing_autopilot_is_flown_over_a_socket_and_no_other(tmp_path: Path, key: bytes | None) -> None:
    async def scenario() -> None:
        settings = MavlinkSettings(signing_key=KEY, signing_timestamp_file=tmp_path / "signing-timestamp")
        async with Vehicle.open("udpin://127.0.0.1:0", clock=Clock(), settings=settings) as vehicle:
            peer = SocketPeer(vehicle.address, key)
            try:
                if key is None:
                    with pytest.raises(NoVehicle, match="not signed with our key"):
                        await vehicle.connect(1.5)
                    assert peer.heard == []
                    return
                assert (await vehicle.connect(20.0)).system_id == 7
                async with asyncio.timeout(20.0):
                    while {"HEARTBEAT", "COMMAND_LONG"} > {m.get_type() for m in peer.heard}:  # noqa: ASYNC110
                        await asyncio.sleep(0.05)
                assert all(m.get_signed() for m in peer.heard)
            finally:
                peer.close()
        assert int((tmp_path / "signing-timestamp").read_text()) > timestamp_at(START)

    asyncio.run(scenario())


def test_a_time_of_ours_that_is_ahead_is_told_as_that_and_not_as_a_wrong_key(tmp_path: Path) -> None:
    kept = tmp_path / "signing-timestamp"
    kept.write_text(str(timestamp_at(time.time() + 86_400.0)))  # the clock was a day ahead once

    async def scenario() -> None:
        settings = MavlinkSettings(signing_key=KEY, signing_timestamp_file=kept)
        async with Vehicle.open("udpin://127.0.0.1:0", clock=Clock(), settings=settings) as vehicle:
            peer = SocketPeer(vehicle.address, KEY)
            try:
                with pytest.raises(
                    NoVehicle, match=r"signed with our key at a time that is 8640\d s behind ours"
                ):
                    await vehicle.connect(1.5)
            finally:
                peer.close()

    asyncio.run(scenario())
