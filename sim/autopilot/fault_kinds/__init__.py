"""Every kind of fault, by what it strikes: the radio, what is told, the vehicle, or who commands it."""

from __future__ import annotations

from sim.autopilot.fault_kinds.kind import Kind, Options
from sim.autopilot.fault_kinds.people import PEOPLE
from sim.autopilot.fault_kinds.radio import RADIO
from sim.autopilot.fault_kinds.told import TOLD
from sim.autopilot.fault_kinds.vehicle import VEHICLE

KINDS: dict[str, Kind] = {**RADIO, **TOLD, **VEHICLE, **PEOPLE}

__all__ = ["KINDS", "Kind", "Options"]
