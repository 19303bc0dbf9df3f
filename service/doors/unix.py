"""A Unix socket: a stream of lines each way. Who may write to it, the file's permissions say (owner and group)."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import stat
from pathlib import Path

from service.doors.lines import LONGEST_LINE, SubmitAll, answer, as_line, refusal
from service.errors import BadInput

_MODE = 0o660
_CHUNK = 1 << 16
_MOST_CONNECTIONS = 64


def bind_unix(path: str) -> socket.socket:
    """A listening socket at a path; a socket that nobody listens on any more is replaced. Raises BadInput."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _clear(path)
        before = os.umask(0o777 & ~_MODE)
        try:
            listener.bind(path)
        finally:
            os.umask(before)
        listener.listen(64)
        listener.setblocking(False)
    except (OSError, ValueError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or error
        raise BadInput(
            f"doors.unix = '{path}' cannot be listened on ({reason}); give another path"
        ) from error
    return listener


def _clear(path: str) -> None:
    """Remove what a killed service has left; raises OSError when something else is there."""
    with contextlib.suppress(FileNotFoundError):
        if not stat.S_ISSOCK(Path(path).stat().st_mode):
            raise OSError(0, "there is a file that is no socket")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            try:
                probe.connect(path)
            except ConnectionRefusedError:
                Path(path).unlink()
                return
        raise OSError(0, "another process listens there")


async def serve_unix(listener: socket.socket, submit: SubmitAll) -> None:
    """Answer connections until cancelled."""
    async with asyncio.TaskGroup() as group:

        def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            talks.difference_update([talk for talk in talks if talk.done()])
            if len(talks) >= _MOST_CONNECTIONS:
                writer.write(as_line(refusal("", f"{_MOST_CONNECTIONS} senders are connected already")))
                writer.close()
                return
            talks.add(group.create_task(_talk(reader, writer, submit)))

        talks: set[asyncio.Task[None]] = set()
        server = await asyncio.start_unix_server(connected, sock=listener)
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            server.close()


async def _talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, submit: SubmitAll) -> None:
    """One connection: whole lines are taken in as they come, what is left of the last waits for its end.

    The next are read when the receipts of these are out, so a sender that is too fast waits, and nothing piles up.
    """
    rest = b""
    try:
        while chunk := await reader.read(_CHUNK):
            whole, newline, rest = (rest + chunk).rpartition(b"\n")
            if newline:
                writer.write(await answer(whole, submit))
                await writer.drain()
            if len(rest) > LONGEST_LINE:
                writer.write(as_line(refusal("", f"a line has at most {LONGEST_LINE} bytes")))
                break
        else:
            writer.write(await answer(rest, submit))  # the last line may lack its end
        await writer.drain()
    except ConnectionError:
        return  # the sender is gone; what was taken in stays
    finally:
        writer.close()
