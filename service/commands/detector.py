"""`roisearch-service detector KIND ...`: watch a camera or another detector, and report to the service."""

from __future__ import annotations

import difflib
import importlib

from service.adapters import KINDS
from service.errors import BadInput
from service.outlet import nobody_waits


def main(arguments: list[str]) -> int:
    """Run the adapter of a kind; returns its exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print("usage: roisearch-service detector KIND ...      KIND --help tells more\nkinds:")
        print("\n".join(f"  {kind:17} {what}" for kind, what in KINDS.items()))
        return 0
    kind, *more = arguments
    if kind not in KINDS:
        near = difflib.get_close_matches(kind, KINDS, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"there is {', '.join(KINDS)}"
        raise BadInput(f"there is no detector '{kind}'; {hint}")
    with nobody_waits():  # a detector that cannot tell how many frames it has reported still reports
        code: int = importlib.import_module(f"service.adapters.{kind}").main(more)
    return code
