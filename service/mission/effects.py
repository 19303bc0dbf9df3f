"""What the mission's core wants done, as values: the shell carries them out and judges nothing.

Some are done at once, in their order. An `Action` takes time: one is under way at a time, and it ends with a `Done`,
`Failed` or `NotSent` that the core is told (see `news`), unless a `DropAction` breaks it off. Whatever moves the
aircraft is an action: all rows before it are on disk before it is sent, and the core is asked once more in between.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from roisearch.motion_fit import Flown
from service.geometry import Cell, LatLon
from service.mission.energy import Left
from service.motion import MotionLimits
from service.rows import CommandRow, KnownRow

# ---- done at once


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop the aircraft here, and at this altitude above the sea at the lowest (NaN: at any). It goes out first and is
    journalled after."""

    least_amsl_m: float = math.nan


@dataclass(frozen=True, slots=True)
class Brake:
    """Stop the aircraft by its autopilot's own means, which needs no position of ours."""


@dataclass(frozen=True, slots=True)
class Rest:
    """Nothing that was sent is wanted any more: neither a waypoint nor a command that moves is repeated."""


@dataclass(frozen=True, slots=True)
class LetGo:
    """The aircraft is not ours any more, and why."""

    reason: str


@dataclass(frozen=True, slots=True)
class Tell:
    """Something for the pilot (STATUSTEXT); severity as in MAV_SEVERITY."""

    text: str
    severity: int = 6


@dataclass(frozen=True, slots=True)
class Note:
    """Something for whoever reads the console; `level` as in logging."""

    text: str
    level: int = 20


@dataclass(frozen=True, slots=True)
class WriteRow:
    """A row for the journal. Rows keep their order, that of an action among them."""

    row: KnownRow


@dataclass(frozen=True, slots=True)
class Think:
    """Decide where to go from `cell`, flown over in the direction `heading` at `speed_mps`, as if the looks from the
    cells `ahead` will have been in vain. `left`: what the battery leaves from there on; None: not known."""

    cell: Cell
    heading: str
    ahead: tuple[Cell, ...]
    speed_mps: float = 0.0
    left: Left | None = None


@dataclass(frozen=True, slots=True)
class Passed:
    """The aircraft has entered this cell for a look, going in this direction."""

    cell: Cell
    heading: str


@dataclass(frozen=True, slots=True)
class Learn:
    """Learn from these flown paths how the aircraft moves."""

    flights: tuple[Flown, ...]


@dataclass(frozen=True, slots=True)
class Reckon:
    """Plan with what the aircraft's parameters say of how it may move."""

    limits: MotionLimits


@dataclass(frozen=True, slots=True)
class PlanAnew:
    """What a flight has left is planned from the launch point again, before the next one decides."""


@dataclass(frozen=True, slots=True)
class DropThought:
    """What is being thought about is out of date."""


@dataclass(frozen=True, slots=True)
class DropAction:
    """The action under way is not wanted any more."""


@dataclass(frozen=True, slots=True)
class ForgetAircraft:
    """What is known of the aircraft is not of the next one, which is the first that is heard now, or the one with this
    MAVLink system id."""

    system_id: int | None


@dataclass(frozen=True, slots=True)
class Answer:
    """An operator's order has been carried out, or was in vain, or is refused, and why."""

    ticket: int
    refused: str = ""


# ---- what takes time


@dataclass(frozen=True, slots=True)
class SendWaypoint:
    """Send the aircraft to a point; `on_way`: it is one of the way to the area or home, and not of the search.

    `hit_at` is the time (perf_counter) at which the report arrived that asked for it, if one did.
    """

    point: LatLon
    altitude_m: float
    on_way: bool = False
    hit_at: float | None = None


@dataclass(frozen=True, slots=True)
class Connect:
    """Wait for a vehicle and its first position."""


@dataclass(frozen=True, slots=True)
class WaitReady:
    """Wait until it can be armed."""


@dataclass(frozen=True, slots=True)
class EnterGuided:
    """Enter the guided mode, if need be, and take control; `there`: of an aircraft that is in it already, not of one
    whose pilot has just selected another mode; `out_of`: of one that is in this mode still, not of one whose pilot has
    just selected another. An operator's order alone goes without either."""

    there: bool = field(default=False, compare=False)
    out_of: str | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Arm:
    """Arm."""


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Climb to a height above home."""

    height_m: float


@dataclass(frozen=True, slots=True)
class SetSpeed:
    """Fly at this speed over ground from now on."""

    speed_mps: float


@dataclass(frozen=True, slots=True)
class ReturnToLaunch:
    """The autopilot is to fly home and land."""


@dataclass(frozen=True, slots=True)
class Land:
    """The autopilot is to land where it is."""


Action = SendWaypoint | Connect | WaitReady | EnterGuided | Arm | TakeOff | SetSpeed | ReturnToLaunch | Land
Effect = (
    Stop
    | Brake
    | Rest
    | LetGo
    | Tell
    | Note
    | WriteRow
    | Think
    | Passed
    | Learn
    | Reckon
    | PlanAnew
    | DropThought
    | DropAction
    | ForgetAircraft
    | Answer
    | Action
)
ACTIONS = (SendWaypoint, Connect, WaitReady, EnterGuided, Arm, TakeOff, SetSpeed, ReturnToLaunch, Land)
UNWRITTEN = (ReturnToLaunch, Land)
"""Actions that wait for no disk."""


def row(effect: Effect) -> WriteRow | None:
    """What the journal keeps of an effect that moves or stops the aircraft, if it has a row of its own."""
    match effect:
        case SendWaypoint(point=(lat, lon), altitude_m=altitude):
            return WriteRow(CommandRow("reposition", lat, lon, altitude))
        case SetSpeed() | ReturnToLaunch() | Land() | Stop() | Brake():
            return WriteRow(CommandRow(_NAMES[type(effect)]))
        case _:
            return None


_NAMES = {SetSpeed: "speed", ReturnToLaunch: "return to launch", Land: "land", Stop: "hold", Brake: "brake"}
