"""Whether links can be opened, asked before anything is prepared for it."""

from __future__ import annotations

import asyncio
import logging
import os
import time
from collections.abc import Mapping
from pathlib import Path

from service.errors import BadInput
from service.mavlink.errors import LinkError
from service.mavlink.transports import Transport, make_transport, pyserial
from service.mavlink.url import LinkKind, LinkUrl

log = logging.getLogger("roisearch")
AGAIN_S = 1.0
TOLD_EVERY = 10


def check_links(urls: Mapping[str, LinkUrl], *, resumed: bool, patient: bool) -> frozenset[str]:
    """Whether the links of aircraft, by their names, can be opened now, before anything has been prepared for it:
    nobody is spoken to. Returns whose cannot.

    There are such only on a resumption (`resumed`) of several: one that is in the air is not left there for the link of
    another one. `patient`: wait for the first link that can be opened, as long as that takes; it says so.

    Raises:
        BadInput: a port is taken, a host is not known, a device is not there or may not be used.
    """
    tried = 0
    while True:
        shut = {name: why for name, url in urls.items() if (why := _why_shut(url))}
        some = len(shut) < len(urls)
        if shut and not (patient or (resumed and some)):
            name, why = next(iter(shut.items()))
            raise BadInput(f"{_called(name)}{why}")
        if tried % TOLD_EVERY == 0:
            for name, why in shut.items():
                goes_on = "; the others go on" if some else ""
                log.warning(
                    "%s%s; it is tried again, as an aircraft may be in the air%s", _called(name), why, goes_on
                )
        if some:
            return frozenset(shut)
        time.sleep(AGAIN_S)
        tried += 1


def _called(name: str) -> str:
    return f"aircraft '{name}': " if name else ""


def _why_shut(url: LinkUrl) -> str:
    """Why a link cannot be opened, or nothing."""
    try:
        _check(url)
    except LinkError as error:
        return str(error)
    return ""


def _check(url: LinkUrl) -> None:
    if url.kind is LinkKind.SERIAL:
        _check_device(url)  # to open it would set its lines, which starts some boards anew
    else:
        asyncio.run(_open_once(make_transport(url)))


async def _open_once(transport: Transport) -> None:
    try:
        await transport.open()
    finally:
        transport.close()


def _check_device(url: LinkUrl) -> None:
    """Raises LinkError when a serial device is not there or may not be used, BadInput without pyserial."""
    pyserial(url)
    from serial.tools.list_ports import comports

    device = Path(url.address)
    if not device.exists():
        ports = ", ".join(sorted(port.device for port in comports()))
        others = f"there is {ports}" if ports else "none is to be seen: is the cable in?"
        raise LinkError(f"cannot open the link {url}: there is no such device; {others}")
    if not device.is_char_device():
        raise LinkError(f"cannot open the link {url}: this is no serial device")
    if not os.access(device, os.R_OK | os.W_OK):
        group = device.group()
        raise LinkError(
            f"cannot open the link {url}: this user may not use it; add the user to the group {group}, and log in again"
        )
