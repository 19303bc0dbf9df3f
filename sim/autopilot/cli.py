"""`roisearch-sim autopilot`: one mock autopilot as a process of its own."""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sim.autopilot import control
from sim.autopilot.address import Address
from sim.autopilot.core import FIRMWARES, Autopilot
from sim.autopilot.faults import Fault, describe, read_faults
from sim.autopilot.geo import LocalFrame
from sim.autopilot.ground import Flat, read_ground
from sim.autopilot.lockstep import Lockstep
from sim.autopilot.settings import Settings
from sim.autopilot.transport import Driver, Mock

_DEFAULTS = Settings()
_APART_M = 5.0  # aircraft that start in a row


def _numbers(count: int) -> Callable[[str], tuple[float, ...]]:
    def read(text: str) -> tuple[float, ...]:
        parts = text.split(",")
        if len(parts) != count:
            raise argparse.ArgumentTypeError(f"'{text}' should be {count} numbers separated by commas")
        try:
            return tuple(float(each) for each in parts)
        except ValueError:
            raise argparse.ArgumentTypeError(f"'{text}' should be {count} numbers") from None

    return read


def _address(text: str) -> Address:
    try:
        return Address.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _lockstep(text: str) -> Lockstep:
    try:
        return Lockstep(Path(text))
    except OSError as error:
        raise argparse.ArgumentTypeError(f"no time can be kept in '{text}': {error.strerror}") from None


def _host_port(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if host not in ("127.0.0.1", "localhost") or not port.isdecimal() or int(port) > 65535:
        raise argparse.ArgumentTypeError(f"'{text}' should be 127.0.0.1:PORT")
    return host, int(port)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    p = argparse.ArgumentParser(
        prog="roisearch-sim autopilot", description="A mock PX4 or ArduPilot multicopter on a real socket."
    )
    p.add_argument("--flavor", choices=sorted(FIRMWARES), default="px4")
    p.add_argument(
        "--listen",
        action="append",
        type=_address,
        metavar="URL",
        help="udpin://HOST:PORT or tcpin://HOST:PORT (port 0: a free one), udpout://HOST:PORT; repeatable",
    )
    p.add_argument("--home", type=_numbers(3), default=_DEFAULTS.home, metavar="LAT,LON,ALT")
    p.add_argument("--heading", type=float, default=0.0, help="degrees at boot")
    p.add_argument("--speedup", type=float, default=1.0, help="times faster than the wall clock, up to 100")
    p.add_argument("--sysid", type=int, default=1)
    p.add_argument(
        "--aircraft",
        type=int,
        default=1,
        metavar="N",
        help="so many on the same addresses, with the next system ids, 5 m east of one another; faults and control "
        "are the first one's",
    )
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--ready-after", type=float, default=_DEFAULTS.ready_after_s, help="seconds from boot")
    p.add_argument(
        "--endurance", type=float, default=_DEFAULTS.endurance_s / 60.0, help="minutes of hovering"
    )
    p.add_argument(
        "--wind", type=_numbers(2), default=(0.0, 0.0), metavar="NORTH,EAST", help="m/s of the air"
    )
    p.add_argument("--gust", type=float, default=0.0, help="m/s, standard deviation of the gusts")
    p.add_argument(
        "--ground", type=Path, metavar="FILE", help="heights of the ground: a raster; default flat"
    )
    p.add_argument("--rangefinder", action="store_true", help="it has a distance sensor that looks down")
    p.add_argument(
        "--swap-battery", type=float, metavar="SECONDS", help="disarmed for so long it gets a full battery"
    )
    p.add_argument("--epoch", type=float, help="time of day at boot, seconds since 1970; default now")
    p.add_argument("--attached", action="store_true", help="end when standard input closes")
    p.add_argument("--faults", type=Path, metavar="FILE", help="TOML file of faults")
    p.add_argument(
        "--list-faults", action="store_true", help="say what a file of faults can ask for, and end"
    )
    p.add_argument(
        "--lockstep",
        type=_lockstep,
        metavar="FILE",
        help="keep the time there, and wait for who follows it (256 bytes, zero; made if missing)",
    )
    p.add_argument("--control", type=_host_port, metavar="HOST:PORT", help="control socket (loopback only)")
    return p


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings the command line asks for."""
    return Settings(
        flavor=args.flavor,
        home=args.home,
        sysid=args.sysid,
        seed=args.seed,
        heading_deg=args.heading,
        speedup=args.speedup,
        ready_after_s=args.ready_after,
        endurance_s=args.endurance * 60.0,
        wind_mps=args.wind,
        gust_mps=args.gust,
        ground=Flat() if args.ground is None else read_ground(args.ground, args.home),
        rangefinder=args.rangefinder or args.ground is not None,
        swap_battery_s=args.swap_battery,
        epoch_s=time.time() if args.epoch is None else args.epoch,
    )


def beside_one_another(settings: Settings, count: int) -> list[Settings]:
    """Settings for so many vehicles in a row."""
    frame, altitude = LocalFrame(settings.home[0], settings.home[1]), settings.home[2]
    every = [settings]
    for k in range(1, count):
        latitude, longitude = frame.to_e7(0.0, _APART_M * k)
        ground = settings.ground.from_home(0.0, _APART_M * k)
        home = (latitude * 1e-7, longitude * 1e-7, altitude)
        every.append(
            replace(settings, sysid=settings.sysid + k, seed=settings.seed + k, home=home, ground=ground)
        )
    return every


def _stop_with_standard_input(stop: asyncio.Event) -> None:
    """Set `stop` when whoever started us is gone, however it went."""
    loop, pipe = asyncio.get_running_loop(), sys.stdin.fileno()

    def read() -> None:
        if not os.read(pipe, 4096):
            loop.remove_reader(pipe)
            stop.set()

    loop.add_reader(pipe, read)


async def _serve(
    settings: Settings,
    listen: list[Address],
    faults: list[Fault],
    control_at: tuple[str, int] | None,
    attached: bool,
    aircraft: int,
    lockstep: Lockstep | None,
) -> int:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    if attached:
        _stop_with_standard_input(stop)
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    mock = Mock(*(Autopilot(each) for each in beside_one_another(settings, aircraft)))
    for fault in faults:
        mock.autopilot.faults.add(fault)
    driver = Driver([mock], settings.speedup, lockstep)
    server: asyncio.Server | None = None
    try:
        for address in listen:
            try:
                bound = await mock.listen(address)
            except OSError as error:
                print(
                    f"roisearch-sim autopilot: cannot listen on {address}: {error.strerror}", file=sys.stderr
                )
                return 2
            print(f"listening on {bound}", flush=True)
        if control_at is not None:
            server = await control.serve(mock.autopilot, *control_at, driver, mock.flush)
            host, port = server.sockets[0].getsockname()[:2]
            print(f"control on tcp://{host}:{port}", flush=True)
        async with asyncio.TaskGroup() as group:
            running = group.create_task(driver.run())
            await stop.wait()
            running.cancel()
    finally:
        if server is not None:
            server.close()
        mock.close()
    return 0


def main(arguments: list[str]) -> int:
    """Run until SIGTERM or SIGINT; 0 then, 2 for bad input."""
    p = parser()
    args = p.parse_args(arguments)
    if args.list_faults:
        print(describe())
        return 0
    if not 0.01 <= args.speedup <= 100:
        p.error("--speedup is from 0.01 to 100")
    if not 1 <= args.sysid <= 255:
        p.error("--sysid is from 1 to 255")
    if not 1 <= args.aircraft <= 256 - args.sysid:
        p.error(f"--aircraft is from 1 to {256 - args.sysid} with --sysid {args.sysid}")
    try:
        faults = [] if args.faults is None else read_faults(args.faults)
        settings = settings_of(args)
    except ValueError as error:
        print(f"roisearch-sim autopilot: {error}", file=sys.stderr)
        return 2
    listen = args.listen or [Address("udpin", "127.0.0.1", 14540)]
    return asyncio.run(
        _serve(settings, listen, faults, args.control, args.attached, args.aircraft, args.lockstep)
    )
