"""The page of what one battery finds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.trials.battery import CUT, PLANNED, BatteryCampaign
from sim.trials.campaign import Job
from sim.trials.flight import HELD_OUT
from sim.trials.journal import write_whole
from sim.trials.summary import ratio

Results = Mapping[Job, dict[str, Any]]
MEASURES = ("pos", "with_home", "mean_s", "searched_s")
AIM = 0.05


def summarise(campaign: BatteryCampaign, results: Results) -> list[dict[str, Any]]:
    """One row for each scene and battery, over the seeds that both have flown."""
    rows = []
    for scene in campaign.scenes:
        told = {
            name: {
                job.trial: each["batteries"]
                for job, each in results.items()
                if (job.planner, job.fov) == (name, scene)
            }
            for name in (CUT, PLANNED)
        }  # fmt: skip
        seeds = sorted(set(told[CUT]) & set(told[PLANNED]))
        for number, minutes in enumerate(campaign.minutes):
            if seeds:
                pairs = {
                    name: np.array([[told[name][seed][number][m] for m in MEASURES] for seed in seeds])
                    for name in told
                }
                rows.append({"scene": scene, "minutes": minutes, "seeds": len(seeds), **_compared(pairs)})
    return rows


def _compared(pairs: Mapping[str, Any]) -> dict[str, Any]:
    cut, planned = pairs[CUT], pairs[PLANNED]
    more = {
        measure: ratio(planned[:, i], cut[:, i]) if cut[:, i].mean() > 0.0 else (math.nan, math.nan)
        for i, measure in enumerate(MEASURES)
    }
    return {
        "cut": dict(zip(MEASURES, cut.mean(axis=0).tolist(), strict=True)),
        "planned": dict(zip(MEASURES, planned.mean(axis=0).tolist(), strict=True)),
        "more": {
            measure: [None if math.isnan(each) else each for each in pair] for measure, pair in more.items()
        },
        "worse": int((planned[:, 0] < cut[:, 0] - 1e-9).sum()),
        "least": float((planned[:, 0] / np.maximum(cut[:, 0], 1e-12)).min() - 1.0),
    }


def write_battery_report(
    campaign: BatteryCampaign, results: Results, folder: Path, command: str
) -> list[dict[str, Any]]:
    """Write BATTERY.md and summary.json; the rows of the summary."""
    rows = summarise(campaign, results)
    write_whole(folder / "summary.json", json.dumps(rows, indent=1) + "\n")
    write_whole(folder / "BATTERY.md", page(campaign, rows, command))
    return rows


def page(campaign: BatteryCampaign, rows: Sequence[dict[str, Any]], command: str) -> str:
    """BATTERY.md."""
    head = ["scene", "battery, min", "seeds", "cut off: POS", "planned: POS", "more", "with looks on the way home",
            "more", "mean of min(T, battery), s", "searched until, s", "seeds worse (least)"]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += ["| " + " | ".join(_cells(row)) + " |" for row in rows]
    return "\n\n".join(
        ["# What one battery finds: its end planned, beside being cut off", f"    {command}", _about(campaign),
         "\n".join(lines), _verdict(rows)]
    ) + "\n"  # fmt: skip


def _cells(row: Mapping[str, Any]) -> list[str]:
    cut, planned, more = row["cut"], row["planned"], row["more"]
    return [
        row["scene"], f"{row['minutes']:g}", str(row["seeds"]), f"{cut['pos']:.3f}", f"{planned['pos']:.3f}",
        _more(more["pos"]), f"{cut['with_home']:.3f} → {planned['with_home']:.3f}", _more(more["with_home"]),
        f"{cut['mean_s']:.0f} → {planned['mean_s']:.0f}", f"{cut['searched_s']:.0f} → {planned['searched_s']:.0f}",
        f"{row['worse']} ({row['least']:+.1%})",
    ]  # fmt: skip


def _more(pair: Sequence[float | None]) -> str:
    value, error = pair
    if value is None:
        return "-"
    return f"{value:+.1%}" + ("" if error is None else f" ± {100 * error:.1f}")


def _about(campaign: BatteryCampaign) -> str:
    last, side = campaign.seed + campaign.trials - 1, campaign.side
    held_out = ", not used while developing" if campaign.seed >= HELD_OUT else ""
    return (
        f"Seeds {campaign.seed} to {last}{held_out}. Cells of 25 m, 8 m/s, 1.5 m/s2, p_tp = 0.9, p_tn = "
        f"{campaign.p_tn:g}, a point field of view; launch and landing at the start, {campaign.landing_s:g} s for the "
        f"landing. The paper's priors are on {side} x {side} cells. Both fly the same default until the search has to "
        f"be over within {campaign.horizon_s:g} s. *Cut off* then goes on with its plan and flies straight home when "
        "it must; *planned* flies the course that finds most before that. Both are home by the end of the battery, by "
        "the same rule: no cell is entered from which the way home would end later. *POS*: probability of the first "
        "true detection in the search, exact over all targets; *with looks on the way home*: what the straight way "
        "home shows counts as well, for both. *more*: the ratio of means less one, ± one standard error in percent "
        "points. *seeds worse*: in how many seeds planning found less than being cut off, and the least of the ratios "
        "less one."
    )


def _verdict(rows: Sequence[dict[str, Any]]) -> str:
    if not rows:
        return ""
    met = [row for row in rows if row["more"]["pos"][0] is not None and row["more"]["pos"][0] >= AIM]
    said = [
        f"{row['scene']} with {row['minutes']:g} minutes ({row['more']['pos'][0]:+.1%})"
        for row in rows
        if row not in met
    ]
    if not said:
        return f"At least {AIM:.0%} more is found in every row."
    return f"At least {AIM:.0%} more is found in {len(met)} of {len(rows)} rows; not in {', '.join(said)}."
