"""The vehicle's time since boot, and what it says when it goes back."""

from __future__ import annotations

from service.mavlink.framing import Message

_REBOOT_BACK_S = 2.0
_WRAP_S = 2.0**32 / 1000.0
_AROUND_WRAP_S = 60.0


class BootClock:
    """The newest `time_boot_ms` of any message that has one."""

    def __init__(self) -> None:
        self.seconds: float | None = None

    def read(self, message: Message) -> bool:
        """Take a message's stamp; returns whether the vehicle must have rebooted.

        A little back is a datagram that was overtaken by another; back by all that 32 bits of milliseconds
        hold is the counter's wrap after 49.7 days.
        """
        stamp_ms = getattr(message, "time_boot_ms", 0)
        if not stamp_ms:
            return False
        seconds, last = stamp_ms / 1000.0, self.seconds
        back = 0.0 if last is None else last - seconds
        if 0.0 < back < _REBOOT_BACK_S:
            return False
        self.seconds = seconds
        return _REBOOT_BACK_S <= back < _WRAP_S - _AROUND_WRAP_S
