"""What has become of the reports so far: how many, why not, and whether they are refused one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from service.evidence.reports import Report

_LATELY = (
    6.0  # times as long as a detector may be silent: so fresh is a refusal that explains why nothing comes
)
IN_A_ROW = 3  # so many refusals one after the other, and the detector is to be looked at


@dataclass
class Counts:
    """Reports of all sources; times in the service's clock, 0 before there was one."""

    accepted: int = 0
    accepted_at: float = 0.0
    refused: int = 0
    refused_at: float = 0.0
    refused_in_a_row: int = 0
    last_refusal: str = ""
    without_look: str = ""

    def took_in(self, now: float, without_look: str) -> None:
        """A report has been believed; `without_look`: why it was no look, if it was none."""
        self.accepted += 1
        self.accepted_at, self.refused_in_a_row, self.without_look = now, 0, without_look

    def refuse(self, now: float, report: Report, reason: str) -> None:
        """A report has been refused."""
        self.refused += 1
        self.refused_in_a_row += 1
        self.refused_at = now
        self.last_refusal = f"{report.source}: {reason}"

    def silence(self, now: float, for_s: float) -> str:
        """Why there has been no evidence lately, for people: no report came, or those that came were refused."""
        if self.refused_in_a_row >= IN_A_ROW and now - self.refused_at <= _LATELY * for_s:
            return f"reports are refused: {self.last_refusal}"
        return "the detector is silent"


def together(counts: Sequence[Counts]) -> Counts:
    """What has become of the reports of several aircraft: sums, and of words and times the latest."""
    if len(counts) == 1:
        return counts[0]
    refused, took = (
        max(counts, key=lambda each: each.refused_at),
        max(counts, key=lambda each: each.accepted_at),
    )
    return replace(
        refused,
        accepted=sum(each.accepted for each in counts),
        accepted_at=took.accepted_at,
        refused=sum(each.refused for each in counts),
        refused_in_a_row=max(each.refused_in_a_row for each in counts),
        without_look=took.without_look,
    )
