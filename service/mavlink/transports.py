"""The wires: sockets and serial ports that never block and never keep anything for later.

`receive` gives everything that is there, so that the last heartbeat is known before the next decision. `send`
hands a frame to the kernel now or not at all: a waypoint that waited in a queue until a broken link came back
would be a stale order. A stream that breaks is opened again by `run`, for ever; a UDP socket never breaks.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import select
import socket
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from typing import Any

from service.errors import BadInput
from service.mavlink.errors import LinkError
from service.mavlink.url import LinkKind, LinkUrl

Chunk = tuple[bytes, Hashable]
_MOST_READS = 2000
_READ_SIZE = 65536
_AGAIN_S = 1.0
_CONNECT_S = 5.0
_CLIENT_SILENT_S = 3.0


class Transport(ABC):
    """One wire. All its times are wall times."""

    speaks_first = False

    def __init__(self, url: LinkUrl) -> None:
        self.url = url

    @property
    def address(self) -> str:
        """The address in use, with the port the system has picked where 0 was asked for."""
        return str(self.url)

    @abstractmethod
    async def open(self) -> None:
        """Make ready to run; raises LinkError with a sentence if that can never work."""

    @abstractmethod
    async def run(self, on_readable: Callable[[], None]) -> None:
        """Keep the wire up until cancelled; calls `on_readable` when there may be something to receive."""

    @abstractmethod
    def receive(self) -> list[Chunk]:
        """Everything that has arrived, each piece with its source."""

    @abstractmethod
    def send(self, frame: bytes, to: Hashable) -> bool:
        """Send one frame now; False if it could not go out now (it is dropped)."""

    @abstractmethod
    def close(self) -> None:
        """Close the wire for good."""


class UdpTransport(Transport):
    """UDP, bound (answers whom the core names) or connected to one peer (speaks first)."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__(url)
        self.speaks_first = url.kind is LinkKind.UDP_OUT
        self._socket: socket.socket | None = None

    @property
    def address(self) -> str:
        if self._socket is None or self.speaks_first:
            return str(self.url)
        return str(LinkUrl(self.url.kind, self.url.address, self._socket.getsockname()[1]))

    async def open(self) -> None:
        family, address = await _resolve(self.url, socket.SOCK_DGRAM)
        udp = socket.socket(family, socket.SOCK_DGRAM)
        try:
            udp.setblocking(False)
            if self.speaks_first:
                udp.connect(address)
            else:
                udp.bind(address)
        except OSError as error:
            udp.close()
            raise LinkError(_cannot(self.url, error)) from error
        self._socket = udp

    async def run(self, on_readable: Callable[[], None]) -> None:
        assert self._socket is not None
        loop, fd = asyncio.get_running_loop(), self._socket.fileno()
        loop.add_reader(fd, on_readable)
        try:
            await asyncio.Event().wait()
        finally:
            loop.remove_reader(fd)

    def receive(self) -> list[Chunk]:
        chunks: list[Chunk] = []
        if self._socket is None:
            return chunks
        for _ in range(_MOST_READS):
            try:
                data, source = self._socket.recvfrom(_READ_SIZE)
            except BlockingIOError:
                break
            except OSError:
                continue  # an ICMP "nobody listens there yet" for something sent before
            chunks.append((data, None if self.speaks_first else source))
        return chunks

    def send(self, frame: bytes, to: Hashable) -> bool:
        if self._socket is None or (to is None and not self.speaks_first):
            return False
        try:
            if self.speaks_first:
                self._socket.send(frame)
            else:
                address: Any = to
                self._socket.sendto(frame, address)
        except OSError:
            return False
        return True

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class StreamTransport(Transport):
    """What tcp and serial have in common: a file descriptor that may break and is opened again."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__(url)
        self._fd: int | None = None
        self._rest = b""
        self._broken = asyncio.Event()
        self._last_read = 0.0

    @abstractmethod
    async def _connect(self) -> int:
        """Open a new stream; returns its file descriptor. Raises OSError if that does not work now."""

    @abstractmethod
    def _disconnect(self) -> None:
        """Close the stream."""

    async def run(self, on_readable: Callable[[], None]) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                fd = await self._connect()
            except OSError:
                await asyncio.sleep(_AGAIN_S)
                continue
            self._fd, self._rest, self._last_read = fd, b"", time.monotonic()
            self._broken.clear()
            loop.add_reader(fd, on_readable)
            try:
                await self._broken.wait()
            finally:
                loop.remove_reader(fd)
                self._fd = None
                self._disconnect()
            await asyncio.sleep(_AGAIN_S)

    def receive(self) -> list[Chunk]:
        chunks: list[Chunk] = []
        for _ in range(_MOST_READS):
            if self._fd is None or self._broken.is_set():
                break
            try:
                data = os.read(self._fd, _READ_SIZE)
            except BlockingIOError:
                break
            except OSError:
                self._broken.set()
                break
            if not data:
                if not self._only_empty():
                    self._broken.set()
                break
            self._last_read = time.monotonic()
            chunks.append((data, None))
        return chunks

    def send(self, frame: bytes, to: Hashable) -> bool:
        if self._fd is None or self._broken.is_set():
            return False
        try:
            if self._rest:  # the end of a frame that was cut must follow it, or the next one is lost as well
                self._rest = self._rest[os.write(self._fd, self._rest) :]
            if self._rest:
                return False
            self._rest = frame[os.write(self._fd, frame) :]
        except BlockingIOError:
            return False
        except OSError:
            self._broken.set()
            return False
        return True

    def _only_empty(self) -> bool:
        """Whether a read of nothing means that there is nothing now, and not the end of the stream."""
        return False

    def close(self) -> None:
        self._broken.set()
        self._fd = None
        self._disconnect()


class TcpClientTransport(StreamTransport):
    """Connects to a server, again and again."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__(url)
        self._socket: socket.socket | None = None

    async def open(self) -> None:
        await _resolve(self.url, socket.SOCK_STREAM)

    async def _connect(self) -> int:
        try:
            family, address = await _resolve(self.url, socket.SOCK_STREAM)
        except LinkError as error:
            raise OSError(errno.EHOSTUNREACH, str(error)) from error
        stream = socket.socket(family, socket.SOCK_STREAM)
        stream.setblocking(False)
        try:
            async with asyncio.timeout(_CONNECT_S):
                await asyncio.get_running_loop().sock_connect(stream, address)
            stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except BaseException:
            stream.close()
            raise
        self._socket = stream
        return stream.fileno()

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


class TcpServerTransport(StreamTransport):
    """Listens for one client; a second one is taken only when the first has been silent for some seconds."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__(url)
        self._listener: socket.socket | None = None
        self._socket: socket.socket | None = None
        self._accepted: asyncio.Queue[socket.socket] = asyncio.Queue(maxsize=1)

    @property
    def address(self) -> str:
        if self._listener is None:
            return str(self.url)
        return str(LinkUrl(self.url.kind, self.url.address, self._listener.getsockname()[1]))

    async def open(self) -> None:
        family, address = await _resolve(self.url, socket.SOCK_STREAM)
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setblocking(False)
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(4)
        except OSError as error:
            listener.close()
            raise LinkError(_cannot(self.url, error)) from error
        self._listener = listener

    async def run(self, on_readable: Callable[[], None]) -> None:
        assert self._listener is not None
        loop, fd = asyncio.get_running_loop(), self._listener.fileno()
        loop.add_reader(fd, self._accept)
        try:
            await super().run(on_readable)
        finally:
            loop.remove_reader(fd)

    def _accept(self) -> None:
        assert self._listener is not None
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        client.setblocking(False)
        silent_s = time.monotonic() - self._last_read
        busy = self._fd is not None and silent_s < _CLIENT_SILENT_S and not self._client_has_gone()
        if busy or self._accepted.full():
            client.close()
            return
        self._accepted.put_nowait(client)
        if self._fd is not None:
            self._broken.set()

    def _client_has_gone(self) -> bool:
        """Whether the client has closed its end, though that was not read yet."""
        assert self._socket is not None
        try:
            return not self._socket.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            return False
        except OSError:
            return True

    async def _connect(self) -> int:
        client = await self._accepted.get()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = client
        return client.fileno()

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def close(self) -> None:
        super().close()
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        while not self._accepted.empty():
            self._accepted.get_nowait().close()


class SerialTransport(StreamTransport):
    """A serial port, opened again when its cable was pulled."""

    def __init__(self, url: LinkUrl) -> None:
        super().__init__(url)
        self._port: Any = None

    async def open(self) -> None:
        try:
            self._port = self._open_port()
        except OSError as error:
            raise LinkError(_cannot(self.url, error)) from error

    async def _connect(self) -> int:
        if self._port is None:
            self._port = self._open_port()
        os.set_blocking(self._port.fileno(), False)
        return int(self._port.fileno())

    def _open_port(self) -> Any:
        serial = pyserial(self.url)
        return serial.Serial(self.url.address, self.url.number, timeout=0, exclusive=True)

    def _only_empty(self) -> bool:
        """A port that has been pulled out keeps on saying that it can be read."""
        poll = select.poll()
        poll.register(self._port.fileno(), select.POLLIN)
        return not poll.poll(0)

    def _disconnect(self) -> None:
        if self._port is not None:
            with contextlib.suppress(OSError):
                self._port.close()
            self._port = None


def make_transport(url: LinkUrl) -> Transport:
    """The wire for an address; nothing is opened yet."""
    kinds: dict[LinkKind, Callable[[LinkUrl], Transport]] = {
        LinkKind.UDP_IN: UdpTransport,
        LinkKind.UDP_OUT: UdpTransport,
        LinkKind.TCP_IN: TcpServerTransport,
        LinkKind.TCP_OUT: TcpClientTransport,
        LinkKind.SERIAL: SerialTransport,
    }
    return kinds[url.kind](url)


def pyserial(url: LinkUrl) -> Any:
    """The library for serial ports. Raises BadInput when it is not installed."""
    try:
        import serial
    except ImportError as error:
        raise BadInput(
            f"the link {url} needs pyserial, which is not installed: pip install 'roisearch[serial]'"
        ) from error
    return serial


async def _resolve(url: LinkUrl, kind: socket.SocketKind) -> tuple[int, Any]:
    try:
        found = await asyncio.get_running_loop().getaddrinfo(url.address, url.number, type=kind)
    except OSError as error:
        raise LinkError(f"cannot open the link {url}: the host {url.address!r} is not known") from error
    family, _, _, _, address = found[0]
    return family, address


def _cannot(url: LinkUrl, error: OSError) -> str:
    return f"cannot open the link {url}: {error.strerror or error}"
