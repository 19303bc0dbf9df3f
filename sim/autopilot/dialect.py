"""The MAVLink dialect codec, imported once. The only MAVLink code shared with anybody is pymavlink's."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

M: Any = ardupilotmega
NAN = float("nan")
INT32_MAX = 2**31 - 1
