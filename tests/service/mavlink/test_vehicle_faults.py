"""What the mock's world does to the link, over a real socket."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.mavlink import NotPermitted, Vehicle
from service.mavlink.events import AnotherService, Notice, TargetReplaced, VehicleEvent
from tests.fixtures_autopilot import StartAutopilot, flavor, start_autopilot

from .peer import GUIDED, RETURN
from .test_vehicle import HOME, SPEEDUP, Mock, flight, north, up

__all__ = ["flavor", "start_autopilot"]

ALT = HOME[2] + 20.0


def world(start: StartAutopilot, flavor: str, folder: Path, faults: str) -> Mock:
    """A mock to which these faults happen."""
    file = folder / "faults.toml"
    file.write_text(faults, encoding="utf-8")
    options = ("--home", ",".join(map(str, HOME)), "--faults", str(file))
    listen = ["udpin://127.0.0.1:0"] * 2
    return Mock(flavor, start(flavor, listen=listen, speedup=SPEEDUP, options=options))


def test_what_is_not_told_any_longer_and_who_else_commands(
    flavor: str, start_autopilot: StartAutopilot, tmp_path: Path
) -> None:
    mock = world(
        start_autopilot,
        flavor,
        tmp_path,
        """
        [[fault]]
        kind = "stream_stops"
        message = "SYS_STATUS,BATTERY_STATUS"
        after_takeoff = 25.0
        [[fault]]
        kind = "pilot"
        mode = "keep"
        pitch = 0.25
        after_takeoff = 25.0
        [[fault]]
        kind = "second_service"
        every_s = 0.0
        after_takeoff = 30.0
        [[fault]]
        kind = "gcs_goes"
        north = -80.0
        after_takeoff = 90.0
        """,
    )
    seen: list[bool] = []

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        vehicle.reposition(north(30.0), HOME[1], ALT)
        seen.append(await vehicle.wait_until(lambda t: (t.sticks or 0.0) > 0.2, 60.0))
        seen.append(await vehicle.wait_until(lambda t: t.battery_percent is None, 60.0))
        seen.append(await vehicle.wait_until(lambda t: not t.in_control, 200.0))
        with pytest.raises(NotPermitted, match="another target"):
            vehicle.reposition(north(10.0), HOME[1], ALT)

    events = flight(mock, fly)
    assert seen == [True, True, True]
    assert len([e for e in events if isinstance(e, AnotherService)]) >= 1
    (replaced,) = [e for e in events if isinstance(e, TargetReplaced)]
    assert replaced.found.lat == pytest.approx(north(-80.0), abs=1e-5)


def test_a_brake_stops_it_without_a_position(
    flavor: str, start_autopilot: StartAutopilot, tmp_path: Path
) -> None:
    mock = world(start_autopilot, flavor, tmp_path, "")
    speeds: list[float] = []

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        vehicle.reposition(north(300.0), HOME[1], ALT)
        assert await vehicle.wait_until(lambda t: t.ground_speed_mps > 3.0, 30.0)
        vehicle.brake()
        assert await vehicle.wait_until(lambda t: t.ground_speed_mps < 0.3, 20.0)
        await vehicle.enter_guided()
        vehicle.reposition(north(0.0), HOME[1], ALT)
        assert await vehicle.wait_until(lambda t: t.ground_speed_mps > 2.0, 30.0)
        speeds.append(vehicle.telemetry.ground_speed_mps)

    flight(mock, fly)
    assert speeds


def test_what_an_earlier_process_stopped_is_taken_in_hand_where_it_stands_and_sent_home(
    flavor: str, start_autopilot: StartAutopilot, tmp_path: Path
) -> None:
    """ArduCopter stands in BRAKE, which no pilot has chosen; nothing leads it out of that before it is sent home."""
    mock = world(start_autopilot, flavor, tmp_path, "")
    modes: list[str] = []

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await up(vehicle)
        vehicle.brake()
        braked = "BRAKE" if flavor == "ardupilot" else GUIDED[flavor]
        assert await vehicle.wait_until(lambda t: t.mode == braked and t.ground_speed_mps < 0.3, 20.0)
        vehicle.release_control("another process")
        await vehicle.enter_guided(there=True)
        modes.append(vehicle.telemetry.mode)
        assert vehicle.telemetry.in_control
        await vehicle.return_to_launch()
        modes.append(vehicle.telemetry.mode)

    flight(mock, fly)
    assert modes == ["BRAKE" if flavor == "ardupilot" else GUIDED[flavor], RETURN[flavor]]


def test_arming_is_tried_again_while_the_autopilot_says_why_not(
    flavor: str, start_autopilot: StartAutopilot, tmp_path: Path
) -> None:
    faults = """
        [[fault]]
        kind = "arming_refused"
        text = "Need Position Estimate"
        at = 0.0
        seconds = 60.0
        """
    mock = world(start_autopilot, flavor, tmp_path, faults)

    async def fly(vehicle: Vehicle, events: list[VehicleEvent]) -> None:
        await vehicle.connect(60.0)
        await vehicle.enter_guided()
        await vehicle.arm()
        assert vehicle.telemetry.armed

    events = flight(mock, fly, arming_patience_s=300.0)
    notices = [event.text for event in events if isinstance(event, Notice)]
    assert notices
    assert all(text.startswith("not armed yet: ") for text in notices)
    assert any("Need Position Estimate" in text for text in notices)
