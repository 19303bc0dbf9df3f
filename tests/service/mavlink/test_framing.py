"""Bytes: whatever arrives, nothing is raised and no good frame is lost."""

from __future__ import annotations

import random
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.core import LinkCore
from service.mavlink.framing import Codec, Framer
from service.mavlink.settings import MavlinkSettings

from .peer import START, Peer


def heartbeats(messages: list[Any]) -> list[int]:
    return [m.custom_mode for m in messages if m.get_type() == "HEARTBEAT"]


def numbered_frames(count: int) -> list[bytes]:
    """Heartbeats that carry their number as custom mode."""
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    return [
        bytes(mavlink.MAVLink_heartbeat_message(2, 12, 1, n, 4, 3).pack(mav)) for n in range(1, count + 1)
    ]


def read(chunks: list[bytes], *, at_end: bool = True) -> list[int]:
    framer = Framer(Codec(1, 191))
    found = [m for chunk in chunks for m in framer.feed(chunk, START)]
    if at_end:
        found += framer.expire(START + 10.0)
    return heartbeats(found)


def test_frame_cut_at_every_byte_is_read() -> None:
    frame = numbered_frames(1)[0]
    assert read([bytes([b]) for b in frame], at_end=False) == [1]


def test_false_start_byte_does_not_cost_the_frame_behind_it() -> None:
    for false_start in (b"\xfd", b"\xfe", b"\xfd\x09\x00", b"\xfe\xff\x00\x00"):
        assert read([false_start + numbered_frames(1)[0]]) == [1]


def test_bad_checksum_is_dropped_and_the_next_frame_read() -> None:
    first, second = numbered_frames(2)
    broken = bytearray(first)
    broken[12] ^= 0x55
    assert read([bytes(broken) + second], at_end=False) == [2]


def test_mavlink_1_frames_are_read() -> None:
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    frame = mavlink.MAVLink_heartbeat_message(2, 12, 1, 5, 4, 3).pack(mav, force_mavlink1=True)
    assert frame[0] == 0xFE
    assert read([bytes(frame)]) == [5]


def test_message_of_unknown_kind_is_stepped_over() -> None:
    first, second = numbered_frames(2)
    unknown = bytes([0xFD, 3, 0, 0, 0, 7, 1, 0xF0, 0xFF, 0xFF, 1, 2, 3, 0, 0])
    framer = Framer(Codec(1, 191))
    messages = framer.feed(first + unknown + second, START)
    assert heartbeats(messages) == [1, 2]
    assert framer.skipped == 0


@given(data=st.lists(st.binary(max_size=300), max_size=8))
def test_any_bytes_never_raise(data: list[bytes]) -> None:
    core = LinkCore(MavlinkSettings(), speaks_first=True)
    now = START
    for chunk in data:
        now += 0.3
        core.receive_data(chunk, now)
        core.tick(now)
    core.tick(now + 5.0)


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32),
    message_id=st.sampled_from(sorted(mavlink.mavlink_map)),
    paired=st.booleans(),
)
def test_any_content_of_a_valid_frame_never_raises(seed: int, message_id: int, paired: bool) -> None:
    """Checksums are right, so every message is taken in; its fields are random, NaN among them."""
    rng = random.Random(seed)
    core, peer = LinkCore(MavlinkSettings(), speaks_first=True), Peer()
    if paired:
        core.receive_data(peer.heartbeat(), START)
    kind = mavlink.mavlink_map[message_id]
    payload = bytes(rng.choice((rng.randrange(256), 0xFF, 0x7F, 0x00)) for _ in range(kind.unpacker.size))
    header = bytes([len(payload), 0, 0, 0, 7, 1, *message_id.to_bytes(3, "little")])
    checksum = mavlink.x25crc(header + payload + bytes([kind.crc_extra])).crc
    core.receive_data(b"\xfd" + header + payload + checksum.to_bytes(2, "little"), START + 0.1)
    assert core.messages_received == 1 + paired
    core.tick(START + 0.2)
    core.tick(START + 4.0)


@given(
    noise=st.lists(st.binary(max_size=60), min_size=6, max_size=6),
    cuts=st.lists(st.integers(1, 40), min_size=1, max_size=60),
)
@example(
    noise=[b"", b"", b"\xfeY\x00\x00", bytes(9), bytes(9), bytes(12)], cuts=[1]
)  # a frame that ends where one begins
def test_noise_between_frames_never_costs_a_frame(noise: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(n + f for n, f in zip(noise, numbered_frames(6), strict=True))
    chunks, at = [], 0
    for cut in cuts:
        chunks.append(stream[at : at + cut])
        at += cut
    assert [n for n in read([*chunks, stream[at:]]) if 1 <= n <= 6] == [1, 2, 3, 4, 5, 6]
