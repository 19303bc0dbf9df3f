"""How long a campaign will take, told once, as soon as one job of each kind has shown how long it takes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from sim.progress import span
from sim.trials.campaign import Job

Kind = tuple[str, str, str]


class Forecast:
    """Reckons the time left from the campaign's own first jobs, each kind (ruler, planner, field of view) by itself."""

    def __init__(self, jobs: Sequence[Job], workers: int) -> None:
        self._left = Counter(_kind(job) for job in jobs)
        self._workers = workers
        self._took: dict[Kind, list[float]] = {}
        self._told = False

    def done(self, job: Job, results: Sequence[dict[str, Any]]) -> str | None:
        """Take what a job took; the sentence that says how long the campaign will take, the first time it is known."""
        kind = _kind(job)
        self._left[kind] -= 1
        self._took.setdefault(kind, []).append(max(result["timing"]["seconds"] for result in results))
        if self._told or not self._left.total() or self._took.keys() != self._left.keys():
            return None
        self._told = True
        means = {kind: sum(took) / len(took) for kind, took in self._took.items()}
        seconds = sum(means[kind] * count for kind, count in self._left.items()) / self._workers
        return (
            f"about {span(seconds)} to go, by the first jobs; Ctrl-C keeps what is done, "
            "and the same command goes on"
        )


def _kind(job: Job) -> Kind:
    return job.kind, job.planner, job.fov
