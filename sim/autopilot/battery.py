"""The battery: charge drawn by hovering, moving and climbing; the voltage falls with it."""

from __future__ import annotations

_HOVER_A = 28.0
_IDLE_SHARE = 0.02  # of the hover current, motors off


class Battery:
    """Remaining charge as a share of full. `endurance_s` is how long it hovers from full to empty."""

    __slots__ = ("cells", "charge", "current_a", "endurance_s", "used_mah")

    def __init__(self, endurance_s: float, cells: int) -> None:
        self.endurance_s, self.cells = endurance_s, cells
        self.charge, self.current_a, self.used_mah = 1.0, 0.0, 0.0

    def draw(self, seconds: float, *, flying: bool, speed: float, climb: float) -> None:
        """Use charge for some seconds of flight at a ground speed and a climb rate (m/s)."""
        load = _IDLE_SHARE
        if flying:
            load = 1.0 + 0.003 * speed * speed + 0.12 * max(climb, 0.0)
        self.current_a = _HOVER_A * load
        self.charge = max(0.0, self.charge - load * seconds / self.endurance_s)
        self.used_mah += self.current_a * seconds / 3.6

    @property
    def percent(self) -> int:
        """Remaining charge in percent, 0 to 100."""
        return round(100.0 * self.charge)

    @property
    def voltage(self) -> float:
        """Volts of the whole pack under its present current."""
        return self.cells * (3.5 + 0.7 * self.charge - 0.001 * self.current_a)
