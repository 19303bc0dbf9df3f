"""The aircraft that fly one search, as each of them is to see the others."""

from __future__ import annotations

from collections.abc import Callable

from service.mission.apart import Other, same


class Formation:
    """Who flies the search. Each is asked where it is at the moment in which another wants to know."""

    def __init__(self) -> None:
        self._members: dict[str, Callable[[], Other]] = {}

    def join(self, name: str, told: Callable[[], Other]) -> None:
        """One more flies it; `told` says how the others are to see it."""
        self._members[name] = told

    @property
    def several(self) -> bool:
        """Whether there is more than one aircraft."""
        return len(self._members) > 1

    def others(self, name: str) -> tuple[Other, ...]:
        """All but the one of that name, and what is only a second link to it; those whose missions have ended among
        them."""
        own = self._members[name]()
        others = (told() for each, told in self._members.items() if each != name)
        return tuple(other for other in others if not same(own, other))
