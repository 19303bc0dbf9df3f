"""The vehicle over real sockets, against the mock autopilot as a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import signal
import socket
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.clock import Clock
from service.errors import BadInput
from service.mavlink import (
    CommandFailed,
    LinkError,
    MavlinkSettings,
    NotAnswered,
    NotPermitted,
    NoVehicle,
    Vehicle,
)
from service.mavlink.events import (
    LinkBack,
    LinkLost,
    ModeChanged,
    Stalled,
    Target,
    TargetNotTaken,
    TargetTaken,
    VehicleEvent,
)
from service.mavlink.target import distance_m
from sim.autopilot.process import AutopilotProcess
from tests.fixtures_autopilot import StartAutopilot, flavor, start_autopilot

from .peer import GUIDED, PILOT, RETURN, START, Peer

__all__ = ["flavor", "start_autopilot"]

SPEEDUP = 20.0
HOME = (47.0, 8.0, 489.0)
METRE = 1.0 / 111_194.93
PILOT_MODE = {"px4": (1.0, 3.0, 0.0), "ardupilot": (1.0, 5.0, 0.0)}


@dataclass
class Mock:
    """A mock autopilot process with two links: ours, and one for a pilot's ground station."""

    flavor: str
    process: AutopilotProcess

    @property
    def url(self) -> str:
        return self.process.urls[0].replace("udpin", "udpout")

    def pilot(self) -> Pilot:
        return Pilot(int(self.process.urls[1].rsplit(":", 1)[1]))


class Pilot:
    """A ground station on the second link, in pymavlink's own words."""

    def __init__(self, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)

    def set_mode(self, flavor: str, system: int) -> None:
        params = (*PILOT_MODE[flavor], 0.0, 0.0, 0.0, 0.0)
        message = mavlink.MAVLink_command_long_message(system, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, *params)
        self.socket.send(bytes(message.pack(self.mav)))


@pytest.fixture
def mock(flavor: str, start_autopilot: StartAutopilot) -> Mock:
    home = ("--home", ",".join(map(str, HOME)))
    return Mock(
        flavor, start_autopilot(flavor, listen=["udpin://127.0.0.1:0"] * 2, speedup=SPEEDUP, options=home)
    )


def north(metres: float) -> float:
    return HOME[0] + metres * METRE


def flight(
    mock: Mock, body: Callable[[Vehicle, list[VehicleEvent]], Coroutine[Any, Any, None]], **settings: Any
) -> list[VehicleEvent]:
    """Run a flight; returns all its events."""
    events: list[VehicleEvent] = []
    settings = {"allow_arming": True, **settings}

    async def record(vehicle: Vehicle) -> None:
        async for event in vehicle.events():
            events.append(event)

    async def main() -> None:
        link = Vehicle.open(mock.url, clock=Clock(SPEEDUP), settings=MavlinkSettings(**settings))
        async with asyncio.timeout(60.0), asyncio.TaskGroup() as group, link as vehicle:
            group.create_task(record(vehicle))
            await body(vehicle, events)

    asyncio.run(main())
    return events


async def up(vehicle: Vehicle, height_m: float = 20.0) -> None:
    """From power-on to the hover."""
    await vehicle.connect(60.0)
    await vehicle.wait_ready(120.0)
    await vehicle.enter_guided()
    await vehicle.arm()
    await vehicle.take_off(height_m)


async def arrive(vehicle: Vehicle, lat: float, lon: float, within_m: float, timeout_s: float = 60.0) -> float:
    """Wait until the aircraft is near a place; returns its speed there."""

    def near() -> bool:
        t = vehicle.telemetry
        return distance_m(Target(t.lat, t.lon, 0.0), Target(lat, lon, 0.0)) < within_m

    assert await vehicle.wait_until(lambda t: near(), timeout_s), f"never came within {within_m} m"
    return vehicle.telemetry.ground_speed_mps


def test_a_whole_flight(mock: Mock) -> None:
    flavor = mock.flavor

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        t = vehicle.telemetry
        assert t.alt_home_m == pytest.approx(20.0, abs=2.0)
        assert t.alt_amsl_m == pytest.approx(HOME[2] + 20.0, abs=2.0)
        await vehicle.set_speed(5.0)
        alt = HOME[2] + 20.0
        speeds = []
        for leg in range(1, 5):
            vehicle.reposition(north(20.0 * leg), HOME[1], alt)
            speeds.append(await arrive(vehicle, north(20.0 * leg), HOME[1], 5.0))
        assert min(speeds) > 1.0, "the next target was sent early, so it does not stop in between"
        stopped_at = vehicle.telemetry
        vehicle.hold()
        assert await vehicle.wait_until(lambda t: t.ground_speed_mps < 0.3, 20.0)
        assert distance_m(
            Target(stopped_at.lat, stopped_at.lon, 0.0),
            Target(vehicle.telemetry.lat, vehicle.telemetry.lon, 0.0),
        ) < (15.0)
        assert vehicle.status_text("search ends, flying home")
        await vehicle.return_to_launch()
        assert await vehicle.wait_until(lambda t: not t.armed, 200.0)
        assert vehicle.telemetry.landed_state == "on_ground"

    events = flight(mock, fly)
    assert all(event.commanded for event in events if isinstance(event, ModeChanged))
    assert [e for e in events if isinstance(e, TargetNotTaken)] == []
    taken = [e.target.lat for e in events if isinstance(e, TargetTaken)]
    assert taken[:4] == [pytest.approx(north(20.0 * leg)) for leg in range(1, 5)]
    modes = [e.mode for e in events if isinstance(e, ModeChanged)]
    assert RETURN[flavor] in modes


def test_pilot_takes_over_in_flight_and_nothing_moves_the_aircraft_until_an_order(mock: Mock) -> None:
    flavor = mock.flavor

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        alt = HOME[2] + 20.0
        vehicle.reposition(north(200.0), HOME[1], alt)
        await arrive(vehicle, north(20.0), HOME[1], 10.0)
        mock.pilot().set_mode(flavor, vehicle.telemetry.system_id)
        assert await vehicle.wait_until(lambda t: t.mode == PILOT[flavor], 10.0)
        with pytest.raises(NotPermitted, match="not by us"):
            vehicle.reposition(north(100.0), HOME[1], alt)
        with pytest.raises(NotPermitted):
            vehicle.hold()
        with pytest.raises(NotPermitted):
            await vehicle.return_to_launch()
        assert await vehicle.wait_until(lambda t: t.ground_speed_mps < 0.5, 30.0)
        where = vehicle.telemetry
        assert not await vehicle.wait_until(lambda t: t.mode != PILOT[flavor], 30.0), (
            "the mode was taken back"
        )
        now = vehicle.telemetry
        assert distance_m(Target(where.lat, where.lon, 0.0), Target(now.lat, now.lon, 0.0)) < 5.0
        await vehicle.enter_guided()  # the operator resumes
        vehicle.reposition(north(60.0), HOME[1], alt)
        await arrive(vehicle, north(60.0), HOME[1], 3.0)

    events = flight(mock, fly)
    modes = [(e.mode, e.commanded) for e in events if isinstance(e, ModeChanged)]
    assert (PILOT[flavor], False) in modes
    assert modes[-1] == (GUIDED[flavor], True)


def test_frozen_vehicle_is_a_lost_link_and_control_is_still_ours_when_it_comes_back(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        os.kill(mock.process.pid, signal.SIGSTOP)
        try:
            assert await vehicle.wait_until(lambda t: t.link_lost, 200.0)
            with pytest.raises(NotPermitted, match="not been heard"):
                vehicle.reposition(north(20.0), HOME[1], HOME[2] + 20.0)
            with pytest.raises(NotPermitted, match="not been heard"):
                await vehicle.return_to_launch(ordered=True)
        finally:
            os.kill(mock.process.pid, signal.SIGCONT)
        assert await vehicle.wait_until(lambda t: not t.link_lost, 100.0)
        assert await vehicle.wait_until(lambda t: vehicle.why_not_reposition() is None, 100.0)
        vehicle.reposition(north(20.0), HOME[1], HOME[2] + 20.0)
        await arrive(vehicle, north(20.0), HOME[1], 3.0)

    events = flight(mock, fly)
    kinds = [type(e) for e in events]
    assert kinds.index(LinkLost) < kinds.index(LinkBack)


def test_pilot_who_takes_over_while_our_process_stands_still_is_not_overruled(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        mock.pilot().set_mode(mock.flavor, vehicle.telemetry.system_id)
        time.sleep(1.5)  # noqa: ASYNC251 - the event loop is meant to stand still
        with pytest.raises(NotPermitted):
            vehicle.reposition(north(20.0), HOME[1], HOME[2] + 20.0)
        assert await vehicle.wait_until(lambda t: t.mode == PILOT[mock.flavor], 60.0)
        await asyncio.sleep(0.5)
        with pytest.raises(NotPermitted, match="not by us"):
            vehicle.reposition(north(20.0), HOME[1], HOME[2] + 20.0)

    events = flight(mock, fly)
    assert any(isinstance(e, Stalled) for e in events)
    assert (PILOT[mock.flavor], False) in [
        (e.mode, e.commanded) for e in events if isinstance(e, ModeChanged)
    ]


def test_take_off_needs_permission_arming_and_a_sane_height(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await vehicle.connect(60.0)
        await vehicle.wait_ready(120.0)
        with pytest.raises(NotPermitted, match="not armed"):
            await vehicle.take_off(20.0)
        for height in (0.0, math.nan, 5000.0):
            with pytest.raises(NotPermitted, match="no take-off to"):
                await vehicle.take_off(height)
        for speed in (0.0, -1.0, math.nan, 500.0):
            with pytest.raises(NotPermitted, match="no speed"):
                await vehicle.set_speed(speed)

    flight(mock, fly)


def test_without_permission_nothing_is_armed(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await vehicle.connect(60.0)
        await vehicle.wait_ready(120.0)
        with pytest.raises(NotPermitted, match="--takeoff"):
            await vehicle.arm()
        with pytest.raises(NotPermitted):
            await vehicle.take_off(20.0)
        assert not await vehicle.wait_until(lambda t: t.armed, 5.0)

    flight(mock, fly, allow_arming=False)


def test_an_aircraft_that_was_taken_from_us_is_not_armed(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await vehicle.connect(60.0)
        await vehicle.wait_ready(120.0)
        await vehicle.enter_guided()
        vehicle.release_control("the pilot has it")
        with pytest.raises(NotPermitted, match="the pilot has it"):
            await vehicle.arm()
        assert not vehicle.in_control

    flight(mock, fly)


def test_arming_before_it_is_ready_is_refused_by_us(mock: Mock) -> None:
    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await vehicle.connect(60.0)
        if not vehicle.telemetry.ready_to_arm:
            with pytest.raises(NotPermitted, match="the vehicle was not armed: it "):
                await vehicle.arm()

    flight(mock, fly, ready_hold_s=1000.0)


# ---- opening and closing, with a peer of our own


@contextlib.asynccontextmanager
async def opened(url: str, speedup: float = 50.0) -> AsyncIterator[Vehicle]:
    async with asyncio.timeout(20.0), Vehicle.open(url, clock=Clock(speedup)) as vehicle:
        yield vehicle


def test_silence_garbage_and_strangers_are_told_apart_when_nothing_can_be_paired_with() -> None:
    async def main() -> None:
        async with opened("udpin://127.0.0.1:0") as vehicle:
            with pytest.raises(NoVehicle, match="nothing was heard"):
                await vehicle.connect(5.0)
            port = int(vehicle.address.rsplit(":", 1)[1])
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.connect(("127.0.0.1", port))
                sender.send(b"hello world")
                with pytest.raises(NoVehicle, match="not MAVLink"):
                    await vehicle.connect(5.0)
                sender.send(Peer(component=100).heartbeat())
                with pytest.raises(NoVehicle, match="no autopilot's heartbeat"):
                    await vehicle.connect(5.0)
                sender.send(Peer().heartbeat(mavlink.MAV_TYPE_FIXED_WING))
                with pytest.raises(NoVehicle, match="FIXED_WING"):
                    await vehicle.connect(5.0)
                sender.send(Peer().heartbeat())
                with pytest.raises(NoVehicle, match="no position"):
                    await vehicle.connect(5.0)

    asyncio.run(main())


def test_every_request_to_a_vehicle_that_was_never_heard_is_refused() -> None:
    async def main() -> None:
        async with opened("udpin://127.0.0.1:0") as vehicle:
            for order in (vehicle.enter_guided, vehicle.return_to_launch, vehicle.land):
                with pytest.raises(NotPermitted):
                    await order()
            with pytest.raises(NotPermitted):
                vehicle.reposition(47.0, 8.0, 500.0)
            with pytest.raises(NotPermitted):
                vehicle.hold()
            assert not vehicle.status_text("hello")

    asyncio.run(main())


def test_an_address_that_cannot_be_used_is_one_sentence() -> None:
    async def open_it(url: str) -> None:
        async with opened(url):
            pass

    with pytest.raises(BadInput, match="udpin"):
        asyncio.run(open_it("udp://0.0.0.0:1"))
    with pytest.raises(LinkError, match="not known"):
        asyncio.run(open_it("udpout://no.such.host.invalid:14550"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        with pytest.raises(LinkError, match="in use"):
            asyncio.run(open_it(f"udpin://127.0.0.1:{taken.getsockname()[1]}"))


def test_error_of_the_caller_leaves_the_link_as_it_is() -> None:
    async def main() -> None:
        async with opened("udpin://127.0.0.1:0"):
            raise CommandFailed("as it is")

    with pytest.raises(CommandFailed, match="as it is"):
        asyncio.run(main())


def test_error_inside_the_link_ends_it_and_is_not_swallowed(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        async with opened("udpin://127.0.0.1:0") as vehicle:

            def broken(now: float) -> list[VehicleEvent]:
                raise RuntimeError("broken inside")

            # an error that no input leads to, in the midst of the link
            monkeypatch.setattr(vehicle._core, "tick", broken)
            await asyncio.sleep(10.0)

    with pytest.raises(ExceptionGroup) as caught:
        asyncio.run(main())
    assert caught.group_contains(RuntimeError, match="broken inside")


def test_events_end_when_the_link_is_closed() -> None:
    async def main() -> int:
        async with opened("udpin://127.0.0.1:0") as vehicle:
            pass
        return len([event async for event in vehicle.events()])

    assert asyncio.run(main()) == 0


def test_the_last_heartbeat_counts_even_if_the_event_loop_has_not_got_round_to_it() -> None:
    async def main() -> None:
        async with opened("udpin://127.0.0.1:0", speedup=1.0) as vehicle:
            peer = Peer()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
                drone.connect(("127.0.0.1", int(vehicle.address.rsplit(":", 1)[1])))
                drone.send(peer.heartbeat())
                drone.send(peer.position(START))
                drone.send(peer.landed_state())
                await vehicle.connect(5.0)
                assert await vehicle.wait_until(lambda t: t.landed_state == "in_air", 5.0)
                await vehicle.enter_guided()
                assert vehicle.why_not_reposition() is None
                peer.mode = PILOT["px4"]
                drone.send(peer.heartbeat())
                with pytest.raises(NotPermitted, match="not by us"):  # at once, nothing awaited in between
                    vehicle.reposition(north(20.0), HOME[1], HOME[2] + 20.0)

    asyncio.run(main())


def test_a_command_that_was_refused_and_one_that_nobody_answered_fail_differently() -> None:
    """A refusal may lead to a landing where it is; silence tells nothing of whether it was heard."""

    async def beat(drone: socket.socket, peer: Peer) -> None:
        while True:
            drone.send(peer.heartbeat())
            await asyncio.sleep(0.2)

    async def main() -> None:
        async with opened("udpin://127.0.0.1:0", speedup=4.0) as vehicle:
            peer = Peer()
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as drone:
                drone.connect(("127.0.0.1", int(vehicle.address.rsplit(":", 1)[1])))
                for frame in (peer.heartbeat(), peer.position(START), peer.landed_state()):
                    drone.send(frame)
                await vehicle.connect(5.0)
                assert await vehicle.wait_until(lambda t: t.landed_state == "in_air", 5.0)
                await vehicle.enter_guided()
                beating = asyncio.create_task(beat(drone, peer))
                with pytest.raises(NotAnswered, match="it did not answer") as silence:
                    await vehicle.return_to_launch()
                ordered = asyncio.create_task(vehicle.return_to_launch())
                while not ordered.done():
                    drone.send(
                        peer.pack(
                            mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH, 2)
                        )
                    )
                    await asyncio.sleep(0.1)
                with pytest.raises(CommandFailed, match="it answered DENIED") as refusal:
                    await ordered
                beating.cancel()
                assert (silence.value.answered, refusal.value.answered) == (False, True)
                assert not NotPermitted("nothing was sent").answered

    asyncio.run(main())
