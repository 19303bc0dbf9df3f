"""The paper's claims, each beside what a campaign measured.

A claim *holds* when what was measured is near what was printed (how near stands in each function), holds *in
part* when it at least points the same way, and does not hold otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.trials import published
from sim.trials.campaign import SEARCH, Campaign, Job

LITE, REGIONS, PUCT = "puct-regions-lite", "puct-regions", "puct"
DPS, GREEDY = "direct-policy-search", "greedy"
_RESAMPLES = 2000
HOLDS, FAILS, PARTLY = "holds", "does not hold", "holds in part"


@dataclass(frozen=True, slots=True)
class Claim:
    """What the paper says, what was measured, and whether it holds here."""

    said: str
    measured: str
    verdict: str


def weigh(campaign: Campaign, results: Mapping[Job, dict[str, Any]], summary: dict[str, Any]) -> list[Claim]:
    """Every claim that this campaign has the planners and fields of view for; none without the paper's preset."""
    if campaign.preset != "paper":
        return []
    evidence = _Evidence(campaign, results, summary)
    claims = [
        _lite_cheaper(evidence),
        _slower_than_puct(evidence),
        _lite_more_steps(evidence),
        _puct_best_baseline(evidence),
        _beat_best_quarter(evidence, REGIONS),
        _beat_best_quarter(evidence, LITE),
        _greedy_above_puct(evidence),
        _dps_over_limit(evidence),
        _seen(evidence, REGIONS),
        _seen(evidence, LITE),
        _tails_outside(evidence, REGIONS),
        _tails_outside(evidence, LITE),
        *_multi_cell(evidence),
        _donut_beats_wide(evidence),
        _wide_tighter(evidence),
    ]
    return [claim for claim in claims if claim is not None]


class _Evidence:
    """Sampled steps and the summary's rows, by planner and field of view."""

    def __init__(
        self, campaign: Campaign, results: Mapping[Job, dict[str, Any]], summary: dict[str, Any]
    ) -> None:
        self.campaign = campaign
        self._rows = {(row["planner"], row["fov"]): row for row in summary["scenarios"]}
        self._steps: dict[tuple[str, str], dict[int, int]] = {}
        for job, result in sorted(results.items(), key=lambda item: item[0].trial):
            if job.kind == SEARCH:
                self._steps.setdefault((job.planner, job.fov), {})[job.trial] = int(result["steps"])

    def has(self, *planners: str, fov: str = "point") -> bool:
        """Whether all of these were sampled."""
        return all((planner, fov) in self._steps for planner in planners)

    def steps(self, planner: str, fov: str = "point") -> np.ndarray[Any, np.dtype[np.int64]]:
        """Steps of every search, int [trials]."""
        return np.array(list(self._steps[planner, fov].values()))

    def median_ratio_interval(self, planner: str, to: str) -> tuple[float, float]:
        """95 % interval of the ratio of two medians, by resampling the trials that both have."""
        a, b = self._steps[planner, "point"], self._steps[to, "point"]
        pairs = np.array([(a[trial], b[trial]) for trial in a if trial in b])
        again = np.random.default_rng(0).integers(len(pairs), size=(_RESAMPLES, len(pairs)))
        medians = np.median(pairs[again], axis=1)
        low, high = np.percentile(medians[:, 0] / medians[:, 1], [2.5, 97.5])
        return float(low), float(high)

    def percentile(self, planner: str, level: float, fov: str = "point") -> float:
        """A percentile of the steps."""
        return float(np.percentile(self.steps(planner, fov), level))

    def sampled(self, planner: str, fov: str = "point") -> dict[str, Any]:
        """The summary's row of the sampled searches."""
        row: dict[str, Any] = self._rows[planner, fov]["sampled"]
        return row

    def step_ms(self, planner: str) -> float:
        """Median time per step."""
        return float(self._rows[planner, "point"]["time_per_step_ms"]["p50"])


def _lite_cheaper(e: _Evidence) -> Claim | None:
    if not e.has(LITE, REGIONS):
        return None
    lite, regions = e.step_ms(LITE), e.step_ms(REGIONS)
    less = 1.0 - lite / regions
    return Claim(
        "Lite takes 57 % less time per step than Regions (43 % by the paper's own table), on median",
        f"{less:.0%} less ({lite:.3f} against {regions:.3f} ms)",
        HOLDS if less >= 0.43 else (PARTLY if less > 0.1 else FAILS),
    )


def _slower_than_puct(e: _Evidence) -> Claim | None:
    if not e.has(LITE, REGIONS, PUCT):
        return None
    lite, regions = (e.step_ms(name) / e.step_ms(PUCT) for name in (LITE, REGIONS))
    return Claim(
        "Lite and Regions are nearly 2 and 3 times slower per step than PUCT (2.0 and 3.5 by the table)",
        f"{lite:.1f} and {regions:.1f} times",
        HOLDS if 1.5 <= lite <= 2.5 and 2.5 <= regions <= 4.0 else FAILS,
    )


def _lite_more_steps(e: _Evidence) -> Claim | None:
    if not e.has(LITE, REGIONS):
        return None
    lite, regions = e.percentile(LITE, 50), e.percentile(REGIONS, 50)
    more = lite / regions - 1.0
    low, high = (ratio - 1.0 for ratio in e.median_ratio_interval(LITE, REGIONS))
    said = published.LITE_MORE_STEPS
    return Claim(
        "Lite takes 61 % more steps than Regions, on median",
        f"{more:+.0%} ({lite:.0f} against {regions:.0f}; 95 % interval {low:+.0%} to {high:+.0%})",
        HOLDS if low - 0.005 <= said <= high + 0.005 else (PARTLY if low > 0.0 else FAILS),
    )


def _puct_best_baseline(e: _Evidence) -> Claim | None:
    if not e.has(PUCT, DPS, GREEDY):
        return None
    medians = {name: e.percentile(name, 50) for name in (PUCT, DPS, GREEDY)}
    best = min(medians, key=lambda name: medians[name])
    return Claim(
        "Of the three baselines PUCT has the best search times",
        "medians " + ", ".join(f"{published.shown(name)} {value:.0f}" for name, value in medians.items()),
        HOLDS if best == PUCT else FAILS,
    )


def _beat_best_quarter(e: _Evidence, planner: str) -> Claim | None:
    if not e.has(planner, PUCT):
        return None
    limit = e.percentile(PUCT, 25)
    share = float(np.mean(e.steps(planner) < limit))
    half = float(np.mean(e.steps(planner) < e.percentile(PUCT, 50)))
    return Claim(
        f"About 75 % of the {published.shown(planner)} trials take fewer steps than the best 25 % of PUCT",
        f"{share:.0%} are below PUCT's 25th percentile ({limit:.0f} steps), {half:.0%} below its median",
        HOLDS if share >= 0.65 else (PARTLY if share >= 0.4 else FAILS),
    )


def _greedy_above_puct(e: _Evidence) -> Claim | None:
    if not e.has(GREEDY, PUCT):
        return None
    apart = e.percentile(GREEDY, 50) - e.percentile(PUCT, 50)
    return Claim(
        "Greedy's median is about 6934 steps above PUCT's",
        f"{apart:+.0f} steps",
        HOLDS if 0.5 <= apart / published.GREEDY_ABOVE_PUCT <= 1.5 else (PARTLY if apart > 0 else FAILS),
    )


def _dps_over_limit(e: _Evidence) -> Claim | None:
    if not e.has(DPS):
        return None
    row = e.sampled(DPS)
    share = 1.0 - row["found"] / row["trials"]
    return Claim(
        "Over half of the DPS trials hit the step limit",
        f"{share:.0%} at {e.campaign.cap} steps; median {e.percentile(DPS, 50):.0f}",
        HOLDS if share > 0.5 else (PARTLY if share > 0.25 else FAILS),
    )


def _seen(e: _Evidence, planner: str) -> Claim | None:
    if not e.has(planner):
        return None
    said, seen = published.SEEN[planner], float(e.sampled(planner)["seen_median"])
    return Claim(
        f"{published.shown(planner)} covers {said:.2%} of the area, on median",
        f"{seen:.2%}",
        HOLDS if 0.5 <= seen / said <= 1.5 else FAILS,
    )


def _tails_outside(e: _Evidence, planner: str) -> Claim | None:
    if not e.has(planner):
        return None
    row = e.sampled(planner)
    slow, all_ = row["outside_regions_slowest"], row["outside_regions"]
    return Claim(
        f"The long tail of {published.shown(planner)} is of targets outside the ROIs (conjectured)",
        f"{slow:.0%} of the slowest 5 % lie outside, {all_:.1%} of all targets",
        HOLDS if slow >= 0.5 else (PARTLY if slow > 2 * all_ and slow > 0.0 else FAILS),
    )


def _multi_cell(e: _Evidence) -> list[Claim]:
    claims = []
    for fov in ("donut", "wide-angle"):
        if not (e.has(LITE) and e.has(LITE, fov=fov)):
            continue
        share = e.percentile(LITE, 95, fov) / e.percentile(LITE, 95)
        claims.append(
            Claim(
                f"Lite with the {fov} FOV has a 95th percentile of about 25 % of the point's",
                f"{share:.0%} ({e.percentile(LITE, 95, fov):.0f} against {e.percentile(LITE, 95):.0f} steps)",
                HOLDS if share <= 0.35 else (PARTLY if share < 0.6 else FAILS),
            )
        )
    return claims


def _donut_beats_wide(e: _Evidence) -> Claim | None:
    if not (e.has(LITE, fov="donut") and e.has(LITE, fov="wide-angle")):
        return None
    donut, wide = e.percentile(LITE, 50, "donut"), e.percentile(LITE, 50, "wide-angle")
    return Claim(
        "Lite is slightly better with the donut than with the wide-angle FOV",
        f"medians {donut:.0f} and {wide:.0f} steps",
        HOLDS if donut < wide else FAILS,
    )


def _wide_tighter(e: _Evidence) -> Claim | None:
    if not (e.has(LITE, fov="donut") and e.has(LITE, fov="wide-angle")):
        return None
    spreads = {
        fov: e.percentile(LITE, 95, fov) - e.percentile(LITE, 5, fov) for fov in ("donut", "wide-angle")
    }
    return Claim(
        "The wide-angle FOV gives a tighter distribution than the donut",
        f"5th to 95th percentile: {spreads['wide-angle']:.0f} steps against {spreads['donut']:.0f}",
        HOLDS if spreads["wide-angle"] < spreads["donut"] else FAILS,
    )
