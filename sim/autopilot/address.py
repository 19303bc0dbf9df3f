"""Addresses in MAVSDK's spelling (`udpin://host:port`); pymavlink's (`udpin:host:port`) is taken too."""

from __future__ import annotations

import re
from dataclasses import dataclass

KINDS = ("udpin", "udpout", "tcpin")
_PATTERN = re.compile(r"(?P<kind>[a-z]+):(?://)?(?P<host>[^:/]*):(?P<port>\d+)/?")


@dataclass(frozen=True, slots=True)
class Address:
    """Where a mock is reached: udpin and tcpin bind there, udpout sends there unasked."""

    kind: str
    host: str
    port: int

    @staticmethod
    def parse(text: str) -> Address:
        """Read an address; ValueError says what is wrong with it."""
        match = _PATTERN.fullmatch(text.strip())
        if match is None or match["kind"] not in KINDS:
            raise ValueError(
                f"'{text}' is no address: want one of {', '.join(k + '://HOST:PORT' for k in KINDS)}"
            )
        port = int(match["port"])
        if port > 65535 or (port == 0 and match["kind"] == "udpout"):
            raise ValueError(f"'{text}' has no usable port")
        return Address(match["kind"], match["host"] or "0.0.0.0", port)

    def __str__(self) -> str:
        return f"{self.kind}://{self.host}:{self.port}"
