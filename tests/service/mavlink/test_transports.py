"""The wires: every kind of link carries a vehicle, breaks, and comes back by itself."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
import time
import tty
from collections.abc import Callable
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.clock import Clock
from service.mavlink import LinkError, MavlinkSettings, Vehicle
from service.mavlink.transports import StreamTransport, make_transport
from service.mavlink.url import parse_url

from .peer import LAT, START, Peer

SPEEDUP = 10.0


async def speak(send: Callable[[bytes], object], peer: Peer) -> None:
    """A vehicle that says where it is, until the wire breaks or the task is cancelled."""
    while True:
        try:
            send(peer.heartbeat() + peer.position(START + time.monotonic() % 1e5))
        except OSError:
            return
        await asyncio.sleep(0.02)


async def heard(vehicle: Vehicle) -> None:
    """Wait until a new heartbeat comes in."""
    before = vehicle.telemetry.heartbeat_time
    assert await vehicle.wait_until(lambda t: t.heartbeat_time > before, 10.0 * SPEEDUP)


def own_heartbeats(data: bytes) -> int:
    found = mavlink.MAVLink(None).parse_buffer(bytearray(data)) or []
    return sum(m.get_type() == "HEARTBEAT" and m.get_srcComponent() == 191 for m in found)


def test_udp_that_listens_answers_the_vehicle_and_nobody_else() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        async with (
            asyncio.timeout(30.0),
            Vehicle.open("udpin://127.0.0.1:0", clock=Clock(SPEEDUP)) as vehicle,
        ):
            port = int(vehicle.address.rsplit(":", 1)[1])
            with (
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone,
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
            ):
                for each in (drone, stranger):
                    each.setblocking(False)
                    each.connect(("127.0.0.1", port))
                stranger.send(Peer(component=100).heartbeat())
                task = asyncio.create_task(speak(drone.send, Peer()))
                await vehicle.connect(100.0)
                stranger.send(Peer().heartbeat())
                assert own_heartbeats(await loop.sock_recv(drone, 4096)) == 1
                await heard(vehicle)
                with pytest.raises(BlockingIOError):
                    stranger.recv(4096)
                task.cancel()

    asyncio.run(main())


def test_udp_that_speaks_first_lives_through_nobody_listening() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
            drone.bind(("127.0.0.1", 0))
            port = drone.getsockname()[1]
        url = f"udpout://127.0.0.1:{port}"
        async with asyncio.timeout(30.0), Vehicle.open(url, clock=Clock(SPEEDUP)) as vehicle:
            await asyncio.sleep(0.5)  # every heartbeat is answered by "port unreachable"
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
                drone.setblocking(False)
                drone.bind(("127.0.0.1", port))
                data, source = await loop.sock_recvfrom(drone, 4096)
                assert own_heartbeats(data) == 1
                task = asyncio.create_task(speak(lambda d: drone.sendto(d, source), Peer()))
                assert (await vehicle.connect(100.0)).lat == pytest.approx(LAT)
                task.cancel()

    asyncio.run(main())


def test_tcp_client_connects_late_and_again_after_a_break() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        with socket.socket() as server:
            server.setblocking(False)
            server.bind(("127.0.0.1", 0))
            url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
            async with asyncio.timeout(30.0), Vehicle.open(url, clock=Clock(SPEEDUP)) as vehicle:
                await asyncio.sleep(0.1)  # refused so far
                server.listen()
                for _ in range(2):
                    client, _ = await loop.sock_accept(server)
                    with client:
                        client.setblocking(False)
                        task = asyncio.create_task(speak(client.send, Peer()))
                        await heard(vehicle)
                        await task if task.done() else task.cancel()

    asyncio.run(main())


def test_tcp_server_takes_one_client_and_the_next_after_it_has_gone() -> None:
    async def main() -> None:
        async with (
            asyncio.timeout(30.0),
            Vehicle.open("tcpin://127.0.0.1:0", clock=Clock(SPEEDUP)) as vehicle,
        ):
            port = int(vehicle.address.rsplit(":", 1)[1])
            for _ in range(2):
                with socket.create_connection(("127.0.0.1", port)) as client:
                    client.setblocking(False)
                    task = asyncio.create_task(speak(client.send, Peer()))
                    await heard(vehicle)
                    with socket.create_connection(("127.0.0.1", port)) as second:
                        second.settimeout(5.0)
                        assert await asyncio.to_thread(second.recv, 1) == b"", "one client at a time"
                    await heard(vehicle)
                    task.cancel()

    asyncio.run(main())


def test_serial_port_carries_a_vehicle_and_survives_silence() -> None:
    async def main() -> None:
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        url = f"serial://{os.ttyname(slave)}:57600"
        try:
            async with asyncio.timeout(30.0), Vehicle.open(url, clock=Clock(SPEEDUP)) as vehicle:
                await asyncio.sleep(0.1)
                task = asyncio.create_task(speak(lambda data: os.write(master, data), Peer()))
                await vehicle.connect(100.0)
                await asyncio.sleep(0.3)
                assert own_heartbeats(os.read(master, 65536)) >= 1
                task.cancel()
        finally:
            os.close(master)
            os.close(slave)

    asyncio.run(main())


def test_serial_port_that_is_not_there_is_one_sentence() -> None:
    async def main() -> None:
        async with Vehicle.open("serial:///dev/no-such-port:57600", clock=Clock()):
            pass

    with pytest.raises(LinkError, match="no-such-port"):
        asyncio.run(main())


def test_a_device_that_is_waited_for_is_opened_once_it_is_there(tmp_path: Path) -> None:
    async def main() -> None:
        device, waits = tmp_path / "by-id", MavlinkSettings(wait_for_ever=True)
        url = f"serial://{device}:57600"
        master, slave = pty.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        try:
            async with (
                asyncio.timeout(30.0),
                Vehicle.open(url, clock=Clock(SPEEDUP), settings=waits) as vehicle,
            ):
                await asyncio.sleep(0.2)
                device.symlink_to(os.ttyname(slave))
                task = asyncio.create_task(speak(lambda data: os.write(master, data), Peer()))
                await vehicle.connect(100.0)
                task.cancel()
        finally:
            os.close(master)
            os.close(slave)

    asyncio.run(main())


def test_pulled_cable_is_noticed() -> None:
    async def main() -> bool:
        master, slave = pty.openpty()
        transport = make_transport(parse_url(f"serial://{os.ttyname(slave)}:57600"))
        assert isinstance(transport, StreamTransport)
        await transport.open()
        task = asyncio.create_task(transport.run(lambda: None))
        await asyncio.sleep(0.05)
        assert transport.receive() == []
        assert transport.send(b"still there", None)
        os.close(slave)
        os.close(master)
        transport.receive()
        sent = transport.send(b"into the void", None)
        task.cancel()
        transport.close()
        return sent

    assert not asyncio.run(main())


def test_frame_that_a_blocked_stream_does_not_take_is_dropped_and_not_kept_for_later() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        with socket.socket() as server:
            server.setblocking(False)
            server.bind(("127.0.0.1", 0))
            server.listen()
            transport = make_transport(parse_url(f"tcp:127.0.0.1:{server.getsockname()[1]}"))
            task = asyncio.create_task(transport.run(lambda: None))
            client, _ = await loop.sock_accept(server)
            with client:
                await asyncio.sleep(0.05)
                filler = b"\xfd" + b"x" * 4095
                while transport.send(filler, None):
                    pass
                assert not transport.send(b"STALE WAYPOINT", None)
                received = b""
                client.settimeout(1.0)
                while not received.endswith(b"NEW WAYPOINT"):
                    received += await asyncio.to_thread(client.recv, 1 << 20)
                    transport.send(b"NEW WAYPOINT", None)
                assert b"STALE" not in received
                whole = received.replace(b"NEW WAYPOINT", b"")
                assert len(whole) % len(filler) == 0, "a frame that was cut is finished first"
            task.cancel()
            transport.close()

    asyncio.run(main())
