"""Addresses of MAVLink links, in MAVSDK's spelling and in pymavlink's.

| spelling | meaning |
| --- | --- |
| `udpin://0.0.0.0:14540`, `udpin:0.0.0.0:14540` | bind, and answer the vehicle that speaks |
| `udpout://192.168.1.7:14550`, `udpout:...` | send first, so that the peer learns our address |
| `tcpout://127.0.0.1:5760`, `tcp:127.0.0.1:5760` | connect to a server |
| `tcpin://0.0.0.0:5790`, `tcpin:...` | listen for one client |
| `serial:///dev/ttyACM0:921600`, `serial://COM3:57600` | a serial port and its baud rate |
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from service.errors import BadInput, shown

_EXAMPLES = (
    "udpin://0.0.0.0:14540, udpout://HOST:PORT, tcpin://HOST:PORT, tcpout://HOST:PORT "
    "or serial:///dev/ttyACM0:921600"
)


class LinkKind(StrEnum):
    """How the bytes travel."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP_IN = "tcpin"
    TCP_OUT = "tcpout"
    SERIAL = "serial"


_SCHEMES = {kind.value: kind for kind in LinkKind} | {"tcp": LinkKind.TCP_OUT}


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A checked address: `address` is a host (or a serial device), `number` its port (or the baud rate)."""

    kind: LinkKind
    address: str
    number: int

    def __str__(self) -> str:
        host = (
            f"[{self.address}]" if ":" in self.address and self.kind is not LinkKind.SERIAL else self.address
        )
        return f"{self.kind.value}://{host}:{self.number}"


def parse_url(text: str) -> LinkUrl:
    """Read the address of a link.

    Raises:
        BadInput: unknown kind, no port or baud rate, or a number out of range.
    """

    def bad(why: str) -> BadInput:
        return BadInput(f"cannot use the link address {shown(text)}: {why}; right would be {_EXAMPLES}")

    scheme, colon, rest = text.strip().partition(":")
    if not colon:
        raise bad("it has no kind of link in front")
    kind = _SCHEMES.get(scheme.lower())
    if kind is None:
        hint = ", say udpin or udpout" if scheme.lower() == "udp" else ""
        raise bad(f"{shown(scheme)} is not a kind of link{hint}")
    rest = rest.removeprefix("//")
    address, colon, number_text = rest.rpartition(":")
    what = "baud rate" if kind is LinkKind.SERIAL else "port"
    if not colon or not number_text:
        raise bad(f"it has no {what} at the end")
    if not (number_text.isascii() and number_text.isdigit() and len(number_text) <= 9):
        raise bad(f"{shown(number_text)} is not a {what}")
    number = int(number_text)
    if kind is not LinkKind.SERIAL:
        address = address.removeprefix("[").removesuffix("]")
        lowest = 0 if kind in (LinkKind.UDP_IN, LinkKind.TCP_IN) else 1
        if not lowest <= number <= 65535:
            raise bad(f"the port {number} is not between {lowest} and 65535")
    elif number < 300:
        raise bad(f"the baud rate {number} is too low")
    if not address:
        raise bad("it names no device" if kind is LinkKind.SERIAL else "it names no host")
    if any(c.isspace() or c == "\0" for c in address):
        raise bad("there is a space in it")
    return LinkUrl(kind, address, number)
