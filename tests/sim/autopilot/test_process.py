"""The mock as a process: what it prints, how it ends, what it says to bad input."""

from __future__ import annotations

import asyncio
import math
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from sim.autopilot import cli
from sim.autopilot.embedded import running
from sim.autopilot.settings import Settings
from tests.fixtures_autopilot import StartAutopilot, flavor, start_autopilot

__all__ = ["flavor", "start_autopilot"]


def test_prints_the_resolved_port_and_ends_with_zero_on_sigterm(start_autopilot: StartAutopilot) -> None:
    mock = start_autopilot("px4", listen=("udpin://127.0.0.1:0", "tcpin://127.0.0.1:0"))
    assert mock.urls[0].startswith("udpin://127.0.0.1:")
    assert mock.urls[1].startswith("tcpin://127.0.0.1:")
    assert mock.port > 0
    assert mock.stop() == 0


def test_answers_whoever_speaks_first_on_udp(start_autopilot: StartAutopilot, flavor: str) -> None:
    mock = start_autopilot(flavor, options=("--sysid", "7"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(10)
        codec = m.MAVLink(None, srcSystem=255, srcComponent=190)
        hello = m.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
        client.sendto(hello.pack(codec), ("127.0.0.1", mock.port))
        kinds = set()
        while "HEARTBEAT" not in kinds:
            for message in codec.parse_buffer(client.recv(65535)) or []:
                kinds.add(message.get_type())
                assert (message.get_srcSystem(), message.get_srcComponent()) == (7, 1)


def test_several_aircraft_share_an_address_and_each_obeys_its_own_commands(
    start_autopilot: StartAutopilot, flavor: str
) -> None:
    mock = start_autopilot(flavor, options=("--sysid", "7", "--aircraft", "3"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.settimeout(10)
        codec = m.MAVLink(None, srcSystem=255, srcComponent=190)
        ask = m.MAVLink_command_long_message(8, 1, m.MAV_CMD_DO_SET_HOME, 0, 1.0, *(0.0,) * 6)
        client.sendto(ask.pack(codec), ("127.0.0.1", mock.port))
        beating, answering = set(), []
        while beating != {7, 8, 9} or not answering:
            for message in codec.parse_buffer(client.recv(65535)) or []:
                if message.get_type() == "HEARTBEAT":
                    beating.add(message.get_srcSystem())
                if message.get_type() == "COMMAND_ACK":
                    answering.append(message.get_srcSystem())
    assert answering == [8]


def test_aircraft_in_a_row_start_apart() -> None:
    first, second, third = cli.beside_one_another(Settings(sysid=4), 3)
    assert (first.sysid, second.sysid, third.sysid) == (4, 5, 6)
    assert second.home[0] == pytest.approx(first.home[0])
    degrees = (third.home[1] - first.home[1]) * math.cos(math.radians(first.home[0]))
    assert degrees * 111_195.0 == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize(
    "options",
    [
        ("--listen", "udp://nowhere"),
        ("--home", "1,2"),
        ("--speedup", "1000"),
        ("--flavor", "betaflight"),
        ("--sysid", "0"),
        ("--sysid", "250", "--aircraft", "10"),
    ],
)
def test_bad_options_end_with_two_and_one_sentence(options: tuple[str, ...]) -> None:
    run = subprocess.run(
        [sys.executable, "-m", "sim", "autopilot", *options], capture_output=True, timeout=60, check=False
    )
    assert run.returncode == 2
    assert b"Traceback" not in run.stderr


def test_runs_inside_the_callers_event_loop(flavor: str) -> None:
    async def listen() -> set[str]:
        settings = Settings(flavor=flavor, speedup=20.0)
        async with running(settings, ("tcpin://127.0.0.1:0",)) as mock:
            reader, writer = await asyncio.open_connection("127.0.0.1", mock.addresses[0].port)
            codec, kinds = m.MAVLink(None, srcSystem=255, srcComponent=190), set()
            while "HEARTBEAT" not in kinds:
                data = await asyncio.wait_for(reader.read(4096), 10)
                kinds |= {message.get_type() for message in codec.parse_buffer(data) or []}
            writer.close()
            return kinds

    assert "HEARTBEAT" in asyncio.run(listen())


def test_file_of_faults_that_cannot_be_read_ends_with_two(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sim", "autopilot", "--faults", str(tmp_path / "none.toml")]
    run = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert run.returncode == 2
    assert b"none.toml" in run.stderr
    assert b"Traceback" not in run.stderr
