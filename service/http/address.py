"""Where the door listens, and by which names a request may call it."""

from __future__ import annotations

import ipaddress
import socket

from service.errors import BadInput

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})
_BACKLOG = 2048


def split_address(text: str) -> tuple[str, int]:
    """'HOST:PORT' as a pair; raises BadInput."""
    host, colon, port = text.rpartition(":")
    if not colon or not (port.isascii() and port.isdigit()) or len(port) > 5 or int(port) > 65535:
        raise BadInput(f"'{text}' is not an address to listen on; give HOST:PORT, such as 127.0.0.1:8080")
    return host.strip("[]") or "127.0.0.1", int(port)


def bind(host: str, port: int) -> socket.socket:
    """A listening socket, so that a busy port is known before anything else starts; raises BadInput."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio turns Nagle's algorithm off only where the protocol is named: else every answer waits 40 ms
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(_BACKLOG)  # two may be bound to a port, but only one can listen
    except (OSError, ValueError) as error:  # ValueError: a name that cannot be written in DNS
        listener.close()
        reason = getattr(error, "strerror", None) or error
        raise BadInput(f"cannot listen on {host}:{port} ({reason}); choose another with --http") from error
    return listener


def bound_address(listener: socket.socket) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """The address a socket is bound to, whatever name was given for it."""
    return ipaddress.ip_address(str(listener.getsockname()[0]).partition("%")[0])


def url_of(listener: socket.socket) -> str:
    """A URL by which this machine itself can reach the door."""
    address, port = bound_address(listener), listener.getsockname()[1]
    if address.is_unspecified:
        address = ipaddress.ip_address("127.0.0.1" if address.version == 4 else "::1")
    return f"http://[{address}]:{port}" if address.version == 6 else f"http://{address}:{port}"


def host_name(header: str) -> str | None:
    """The name in a Host header or in the authority of an Origin (RFC 9110, 7.2), in small letters, without its
    port and without the brackets of IPv6; None if it is not one."""
    text = header.strip().lower()
    if text.startswith("["):
        name, bracket, rest = text[1:].partition("]")
        if not bracket or (rest and not _is_port(rest)):
            return None
        return name or None
    name, colon, port = text.partition(":")
    if colon and not _is_port(":" + port):
        return None
    return name.rstrip(".") or None


def _is_port(text: str) -> bool:
    return text.startswith(":") and text[1:].isascii() and text[1:].isdigit()
