"""Whether a link can be opened, asked before anything is prepared for it."""

from __future__ import annotations

import asyncio
import itertools
import logging
import os
import time
from pathlib import Path

from service.errors import BadInput
from service.mavlink.errors import LinkError
from service.mavlink.transports import Transport, make_transport, pyserial
from service.mavlink.url import LinkKind, LinkUrl, parse_url

log = logging.getLogger("roisearch")
AGAIN_S = 1.0
TOLD_EVERY = 10


def check_link(text: str, *, patient: bool = False) -> LinkUrl:
    """The address of a link that can be opened now, before anything has been prepared for it: nobody is spoken to.

    `patient`: wait for a link that cannot be opened, as long as that takes; it says so.

    Raises:
        BadInput: as `parse_url`; its port is taken, its host is not known, its device is not there or may not be used.
    """
    url = parse_url(text)
    for tried in itertools.count():
        try:
            _check(url)
        except LinkError as error:
            if not patient:
                raise BadInput(str(error)) from None
            if tried % TOLD_EVERY == 0:
                log.warning("%s; it is tried again, as an aircraft may be in the air", error)
            time.sleep(AGAIN_S)
        else:
            break
    return url


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
