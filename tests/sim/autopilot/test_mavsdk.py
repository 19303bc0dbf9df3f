"""MAVSDK 4, a client that nobody here wrote, flies both flavours with the same calls."""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

from sim.autopilot.process import AutopilotProcess

pytest.importorskip("mavsdk", minversion="4.1", reason="MAVSDK has no wheel for this machine")

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.geofence import GeofenceAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.plugins.geofence import FenceType, GeofenceData, Point, Polygon
from mavsdk.plugins.mission_raw import MissionItem
from mavsdk.plugins.offboard import PositionNedYaw

FLAVORS = ("px4", "ardupilot")
SPEEDUP = 8.0
PATIENCE_S = 60.0  # wall time for what takes the vehicle a minute or less
A_DEGREE_M = 111_195.0
GLOBAL, RELATIVE, WAYPOINT = 0, 3, 16


class Drone:
    """The parts of MAVSDK that the tests use, on one system."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self.action, self.telemetry = ActionAsync(system), TelemetryAsync(system)
        self.params, self.offboard = ParamAsync(system), OffboardAsync(system)
        self.mission, self.geofence = MissionRawAsync(system), GeofenceAsync(system)

    async def until(self, stream: Any, condition: Callable[[Any], bool]) -> Any:
        """The first value of a subscription for which something holds."""

        async def first() -> Any:
            async for value in stream:
                if condition(value):
                    return value
            raise AssertionError("the subscription ended")

        return await asyncio.wait_for(first(), PATIENCE_S)

    async def healthy(self) -> Any:
        """Wait until every health flag is set."""
        return await self.until(self.telemetry.subscribe_health(), lambda health: all(vars(health).values()))

    async def take_off(self, height: float) -> None:
        """Arm and take off."""
        await self.action.set_takeoff_altitude(height)
        await self.action.arm()
        await self.action.takeoff()
        await self.until(
            self.telemetry.subscribe_position(), lambda position: position.relative_altitude_m > 0.95 * height
        )
        await self.until(self.telemetry.subscribe_velocity_ned(), lambda v: abs(v.down_m_s) < 0.3)
        await asyncio.sleep(2.0 / SPEEDUP)


@asynccontextmanager
async def drone(flavor: str) -> AsyncIterator[Drone]:
    """A mock of the flavour, discovered by MAVSDK, with the streams asked for."""
    with AutopilotProcess(flavor, speedup=SPEEDUP, options=("--sysid", "3")) as mock:
        station = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        async with Mavsdk(station) as sdk:
            await sdk.add_any_connection(f"udpout://127.0.0.1:{mock.port}")
            system = await sdk.first_autopilot(timeout_s=20.0)
            assert system is not None
            found = Drone(system)
            for name in ("position", "velocity_ned", "position_velocity_ned", "gps_info", "in_air", "health"):
                await getattr(found.telemetry, f"set_rate_{name}")(10.0)
            yield found


def fly(coroutine: Coroutine[Any, Any, None]) -> None:
    """Run one flight."""
    asyncio.run(coroutine)


@pytest.mark.parametrize("flavor", FLAVORS)
def test_mavsdk_finds_it_and_reads_and_sets_parameters(flavor: str) -> None:
    async def flight() -> None:
        async with drone(flavor) as found:
            assert await found.system.get_system_id() == 3
            await found.healthy()
            table = await found.params.get_all_params()
            names = {each.name for each in [*table.int_params, *table.float_params]}
            name = "MIS_TAKEOFF_ALT" if flavor == "px4" else "FENCE_RADIUS"
            assert name in names
            await found.params.set_param_float(name, 42.0)
            assert await found.params.get_param_float(name) == 42.0
            whole = "GF_ACTION" if flavor == "px4" else "FENCE_ACTION"
            assert await found.params.get_param_int(whole) in (0, 1)

    fly(flight())


@pytest.mark.parametrize("flavor", FLAVORS)
def test_mavsdk_takes_off_goes_somewhere_and_comes_home(flavor: str) -> None:
    async def flight() -> None:
        async with drone(flavor) as found:
            await found.healthy()
            await found.take_off(15.0)
            home = await found.telemetry.home()
            latitude = home.latitude_deg + 50.0 / A_DEGREE_M
            await found.action.goto_location(
                latitude, home.longitude_deg, home.absolute_altitude_m + 20.0, 0.0
            )
            await found.until(
                found.telemetry.subscribe_position(),
                lambda p: (
                    abs(p.latitude_deg - latitude) * A_DEGREE_M < 2.0
                    and abs(p.relative_altitude_m - 20.0) < 1.5
                ),
            )
            await found.action.hold()
            await found.action.return_to_launch()
            await found.until(found.telemetry.subscribe_in_air(), lambda in_air: not in_air)
            await found.until(found.telemetry.subscribe_armed(), lambda armed: not armed)
            position = await found.telemetry.position()
            assert abs(position.latitude_deg - home.latitude_deg) * A_DEGREE_M < 3.0

    fly(flight())


@pytest.mark.parametrize("flavor", ["px4"])  # where it is a mode of its own
def test_mavsdk_flies_offboard_positions_and_lands(flavor: str) -> None:
    async def flight() -> None:
        async with drone(flavor) as found:
            await found.healthy()
            await found.take_off(10.0)
            await found.offboard.set_position_ned(PositionNedYaw(20.0, 10.0, -15.0, 90.0))
            await found.offboard.start()
            await found.until(
                found.telemetry.subscribe_position_velocity_ned(),
                lambda p: (
                    math.hypot(p.position.north_m - 20.0, p.position.east_m - 10.0) < 2.0
                    and abs(p.position.down_m + 15.0) < 1.5
                ),
            )
            await found.offboard.stop()
            await found.action.land()
            await found.until(found.telemetry.subscribe_armed(), lambda armed: not armed)

    fly(flight())


def waypoint(seq: int, frame: int, latitude: float, longitude: float, height: float) -> MissionItem:
    """A raw mission item."""
    x, y = round(latitude * 1e7), round(longitude * 1e7)
    return MissionItem(seq, frame, WAYPOINT, int(seq == 0), 1, 0.0, 1.0, 0.0, math.nan, x, y, height, 0)


@pytest.mark.parametrize("flavor", ["ardupilot"])  # whose home is its first item
def test_mavsdk_uploads_reads_back_and_flies_a_mission_inside_a_fence(flavor: str) -> None:
    async def flight() -> None:
        async with drone(flavor) as found:
            await found.healthy()
            home = await found.telemetry.home()
            latitude, longitude, d = home.latitude_deg, home.longitude_deg, 0.002
            corners = [
                Point(latitude + a * d, longitude + b * d) for a, b in ((-1, -1), (-1, 1), (1, 1), (1, -1))
            ]
            await found.geofence.upload_geofence(GeofenceData([Polygon(corners, FenceType.INCLUSION)], []))
            items = [waypoint(0, GLOBAL, latitude, longitude, home.absolute_altitude_m + 15.0)]
            for k in (1, 2, 3):
                items.append(waypoint(k, RELATIVE, latitude + k * 2e-4, longitude + k * 1e-4, 15.0))
            await found.mission.upload_mission(items)
            back = await found.mission.download_mission()
            assert [item.x for item in back[1:]] == [item.x for item in items[1:]]
            await found.take_off(15.0)
            await found.mission.start_mission()
            last = items[-1].x * 1e-7
            await found.until(
                found.telemetry.subscribe_position(), lambda p: abs(p.latitude_deg - last) * A_DEGREE_M < 3.0
            )
            progress = await found.until(
                found.mission.subscribe_mission_progress(), lambda p: p.current >= p.total - 1
            )
            assert progress.total == 4
            await found.action.land()
            await found.until(found.telemetry.subscribe_armed(), lambda armed: not armed)

    fly(flight())
