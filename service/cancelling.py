"""A task that is cancelled ends, also where the library that it waits in has not passed that on."""

from __future__ import annotations

import asyncio


def end_if_cancelled() -> None:
    """Raise CancelledError when the current task has been asked to end, and has not heard of it.

    `asyncio.wait_for` of Python 3.11 forgets a cancellation that comes in the moment when what it waits for is done,
    and a task group that a broken connection and a cancellation reach together raises the former only. A loop around
    such a call asks here, or it goes on for ever.
    """
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError
