"""A mock inside the caller's own event loop, for demonstrations and tests that want no second process."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

from sim.autopilot.address import Address
from sim.autopilot.core import Autopilot
from sim.autopilot.settings import Settings
from sim.autopilot.transport import Driver, Mock


@asynccontextmanager
async def running(
    settings: Settings, listen: Sequence[str] = ("udpin://127.0.0.1:0",)
) -> AsyncIterator[Mock]:
    """Run a mock on some addresses; `Mock.addresses` are the bound ones, ports resolved.

    Raises ValueError for an address that cannot be read and OSError for one that cannot be had. An error of
    the mock itself ends the body and is raised, in an ExceptionGroup.
    """
    mock = Mock(Autopilot(settings))
    try:
        for url in listen:
            await mock.listen(Address.parse(url))
        async with asyncio.TaskGroup() as group:
            driver = group.create_task(Driver([mock], settings.speedup).run())
            try:
                yield mock
            finally:
                driver.cancel()
    finally:
        mock.close()
