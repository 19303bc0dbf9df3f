"""Who is connected: so many in all, so many from one address, and the idle make room for those who come.

A connection is idle while no whole request has come on it. Four hundred of those that never say anything cost an
attacker nothing; if newcomers were refused because of them, nobody could give an order any more. So it is the one that
has been silent longest, of the address that is connected most, that has to go; and one on which nothing was ever asked
goes before one that is kept open between two orders.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Protocol

MOST_CONNECTIONS = 256
MOST_OF_ONE = 96


class Connection(Protocol):
    """A connection, as its crowd sees it."""

    def idle(self) -> bool:
        """True while no request is being answered on it."""
        ...

    def asked(self) -> bool:
        """True once a request has come on it."""
        ...

    def hang_up(self) -> None:
        """End it at once; `Crowd.leave` has been called."""
        ...


class Crowd:
    """The connections of one door, by address, the longest silent first."""

    def __init__(self, most: int = MOST_CONNECTIONS, most_of_one: int = MOST_OF_ONE) -> None:
        self._most, self._most_of_one = most, most_of_one
        self._by_address: dict[str, OrderedDict[Connection, None]] = {}
        self.count = 0

    def enter(self, connection: Connection, address: str) -> None:
        """Take a connection in, and let another go where there are too many: the newcomer itself if none is idle."""
        here = self._by_address.setdefault(address, OrderedDict())
        here[connection] = None
        self.count += 1
        if len(here) > self._most_of_one:
            self._let_go(address)
        elif self.count > self._most:
            self._let_go(max(self._by_address, key=lambda each: len(self._by_address[each])))

    def heard(self, connection: Connection, address: str) -> None:
        """Something has come on a connection."""
        here = self._by_address.get(address)
        if here is not None and connection in here:
            here.move_to_end(connection)

    def leave(self, connection: Connection, address: str) -> None:
        """A connection has ended, or is no longer one of ours."""
        here = self._by_address.get(address)
        if here is None or connection not in here:
            return
        del here[connection]
        self.count -= 1
        if not here:
            del self._by_address[address]

    def _let_go(self, address: str) -> None:
        here = self._by_address[address]
        idle = [each for each in here if each.idle()] or [next(reversed(here))]
        gone = next((each for each in idle if not each.asked()), idle[0])
        self.leave(gone, address)
        gone.hang_up()
