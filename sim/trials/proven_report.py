"""The page of how near the default comes to what no walk can beat."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sim.trials.campaign import Job
from sim.trials.flight import HELD_OUT, P_TP
from sim.trials.journal import write_whole
from sim.trials.proven import ProvenCampaign

Results = Mapping[Job, dict[str, Any]]
AIMS = {(1, 2): 1.03, (3, 5): 1.07}
"""By the number of hills, from and to: how many times the proven bound the mean is to be at most."""


def summarise(results: Results) -> list[dict[str, Any]]:
    """The priors, those with the fewest hills first."""
    names = ("trial", "hills", "steps", "flown", "release", "proven", "pos")
    rows = [{name: result[name] for name in names} for result in results.values()]
    return sorted(rows, key=lambda row: (row["hills"], row["trial"]))


def write_proven_report(
    campaign: ProvenCampaign, results: Results, folder: Path, command: str
) -> list[dict[str, Any]]:
    """Write PROVEN.md and summary.json; the rows of the summary."""
    rows = summarise(results)
    write_whole(folder / "summary.json", json.dumps(rows, indent=1) + "\n")
    write_whole(folder / "PROVEN.md", page(campaign, rows, command))
    return rows


def page(campaign: ProvenCampaign, rows: Sequence[Mapping[str, Any]], command: str) -> str:
    """PROVEN.md."""
    head = ["hills", "seed", "steps", "POS in the end", "default: mean of min(T, steps)", "above release",
            "above proven, at most"]  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    lines += [
        f"| {row['hills']} | {row['trial']} | {row['steps']} | {row['pos']:.3f} | {row['flown']:.1f} "
        f"| {row['flown'] / row['release'] - 1.0:.1%} | {row['flown'] / row['proven'] - 1.0:.1%} |"
        for row in rows
    ]
    return "\n\n".join(
        ["# How near the default comes to what no walk can beat, in steps", f"    {command}",
         _about(campaign), "\n".join(lines), *_verdicts(rows)]
    ) + "\n"  # fmt: skip


def _about(campaign: ProvenCampaign) -> str:
    last, side = campaign.seed + campaign.trials - 1, campaign.side
    held_out = ", not used while developing" if campaign.seed >= HELD_OUT else ""
    return (
        f"The paper's priors on {side} x {side} cells, hills of equal {campaign.equal}, seeds {campaign.seed} to {last}"
        f"{held_out}; p_tp = {P_TP:g}, no false alarms, four neighbours, a second a step, turns free. *release*: the "
        "bound that lets the searcher jump to wherever it could be by now. *proven*: the bound that counts travel "
        f"(`roisearch.bounds.travel`, {campaign.divisions} divisions); what is above it is what the default loses at "
        "most, as the bound may be loose."
    )


def _verdicts(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    said = []
    for (least, most), aim in AIMS.items():
        ratios = [row["flown"] / row["proven"] for row in rows if least <= row["hills"] <= most]
        if ratios:
            mean = sum(ratios) / len(ratios)
            said.append(
                f"{least} to {most} hills, {len(ratios)} priors: {mean:.3f} of the proven bound on average, at worst "
                f"{max(ratios):.3f}; at most {aim:g} was aimed at: {'met' if mean <= aim else 'missed'}."
            )
    return said
