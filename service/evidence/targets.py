"""Which of a report's detections speak of the target, by their class."""

from __future__ import annotations

from collections.abc import Set

from service.evidence.observe import Unreadable
from service.evidence.reports import Report


def only_targets(report: Report, classes: Set[str]) -> tuple[Report, tuple[str, ...]]:
    """The report without the detections of other classes than these (all of them when none is named), and which
    classes those were.

    Raises:
        Unreadable: a class is a number that the settings do not name, so whether it is the target is not known.
    """
    if not classes:
        return report, ()
    ignored = []
    for seen in report.detections:
        if str(seen.kind) in classes:
            continue
        if not isinstance(seen.kind, str) or seen.kind.isdigit():
            raise Unreadable(
                f"class {seen.kind} is a number, and sensor.classes names {_listed(classes)}; name the target's "
                'numbers there too, such as "0", or send names'
            )
        ignored.append(seen.kind)
    if not ignored:
        return report, ()
    kept = tuple(seen for seen in report.detections if str(seen.kind) in classes)
    return report.model_copy(update={"detections": kept}), tuple(dict.fromkeys(ignored))


def not_the_target(ignored: tuple[str, ...], classes: Set[str]) -> str:
    """What a receipt says about detections that do not count as hits."""
    return f"{', '.join(ignored)}: no class of the target, which sensor.classes names ({_listed(classes)})"


def _listed(classes: Set[str]) -> str:
    return ", ".join(sorted(classes))
