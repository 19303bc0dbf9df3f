"""Everything that is wrong with an area file, at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import ParamSpec, TypeVar, cast

from service.errors import BadInput

_P = ParamSpec("_P")
_T = TypeVar("_T")


class BadArea(BadInput):
    """Several things are wrong with one file: `faults` has a sentence for each, with its feature and the fix."""

    def __init__(self, source: str, faults: Sequence[str]) -> None:
        self.faults = tuple(faults)
        lines = "".join(f"\n  {fault}" for fault in faults)
        super().__init__(f"{source}: {len(faults)} things are wrong:{lines}")


def refuse(source: str, faults: Sequence[str]) -> None:
    """Raise what is wrong with a file, if anything is: one fault as a sentence, several as a list of them.

    Args:
        faults: sentences that begin with the part of the file they are about, without the file's name.

    Raises:
        BadInput: there is a fault.
    """
    if len(faults) == 1:
        raise BadInput(f"{source}: {faults[0]}")
    if faults:
        raise BadArea(source, faults)


class Together:
    """Calls whose refusals are told together, at the end of a `with` block.

    Until then a call that was refused returns None, which is no value of its type: it may be handed on, not looked at.
    `faults` are sentences as `refuse` takes them.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.faults: list[str] = []

    def __enter__(self) -> Together:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            refuse(self.source, self.faults)

    def __call__(self, call: Callable[_P, _T], *given: _P.args, **named: _P.kwargs) -> _T:
        """What the call returns; what it refuses is kept."""
        try:
            return call(*given, **named)
        except BadArea as error:
            self.faults += error.faults
        except BadInput as error:
            self.faults.append(str(error).removeprefix(f"{self.source}: "))
        return cast(_T, None)
