"""Everything that is wrong with an area file, at once."""

from __future__ import annotations

from collections.abc import Sequence

from service.errors import BadInput


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
