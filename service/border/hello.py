"""What the flying process tells a door process once, at its start: whom to let in, and where the search is.

It is pickled into a nameless file that the new process inherits, since it holds digests of tokens and a broker's
password, which a command line would show to every user of the machine. Nothing is ever unpickled the other way.
"""

from __future__ import annotations

import os
import pickle
import socket
from dataclasses import dataclass
from pathlib import Path

from service.config import HttpSettings
from service.doors import Doors
from service.doors.mqtt import Broker
from service.http import Access, Door
from service.telling import TellingPlan
from service.view.scene import SearchGround
from service.view.underlay import Underlay


@dataclass(frozen=True)
class Hello:
    """The start of a door process. Sockets and memory are file descriptors that it inherits."""

    http: HttpSettings
    access: Access
    underlay: Underlay
    broker: Broker | None
    path: str
    detections_per_s: float
    telling: TellingPlan
    ground: SearchGround
    journal: Path
    listener: int
    udp: int | None
    unix: int | None
    memory: int

    @classmethod
    def of(
        cls, door: Door, doors: Doors, telling: TellingPlan, ground: SearchGround, journal: Path, memory: int
    ) -> Hello:
        """What a process needs that is to serve these doors."""
        return cls(
            http=door.http,
            access=door.access,
            underlay=door.underlay,
            broker=doors.mqtt,
            path=doors.path,
            detections_per_s=doors.detections_per_s,
            telling=telling,
            ground=ground,
            journal=journal,
            listener=door.listener.fileno(),
            udp=None if doors.udp is None else doors.udp.fileno(),
            unix=None if doors.unix is None else doors.unix.fileno(),
            memory=memory,
        )

    @property
    def inherited(self) -> list[int]:
        """The file descriptors that the process must be given."""
        return [each for each in (self.listener, self.udp, self.unix, self.memory) if each is not None]

    def write(self) -> int:
        """A nameless file that holds this, for `read`; the caller closes it."""
        file = os.memfd_create("roisearch-hello", os.MFD_CLOEXEC)
        with open(file, "wb", closefd=False) as stream:
            pickle.dump(self, stream)
        os.lseek(file, 0, os.SEEK_SET)
        return file

    @classmethod
    def read(cls, file: int) -> Hello:
        """What `write` wrote; the file is closed."""
        with open(file, "rb") as stream:
            hello = pickle.load(stream)
        assert isinstance(hello, cls)
        return hello

    def doors(self) -> tuple[Door, Doors]:
        """The doors, around the inherited sockets."""
        door = Door(self.http, socket.socket(fileno=self.listener), self.access, self.underlay)
        udp = None if self.udp is None else socket.socket(fileno=self.udp)
        unix = None if self.unix is None else socket.socket(fileno=self.unix)
        return door, Doors(udp, unix, self.broker, self.path, self.detections_per_s)
