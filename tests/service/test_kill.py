"""`kill -9` at any instant, then the journal again: the same belief to the last bit, nothing lost, nothing twice."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from pathlib import Path

import numpy as np
import pytest

from service.entries import read_entries
from service.journal import read_rows
from service.resume import replay, retrace
from service.rows import ReportRow
from tests.service.reporting import Ground, intake, report, run

KILLS = 8


@pytest.fixture(scope="module")
def spawn() -> multiprocessing.context.ForkServerContext:
    """Starts processes that have everything imported already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tests.service.reporting"])
    return context


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_kill_at_any_instant_loses_nothing_and_counts_nothing_twice(
    seed: int, spawn: multiprocessing.context.ForkServerContext, tmp_path: Path
) -> None:
    path, rng = tmp_path / "journal.sqlite", np.random.default_rng(1000 + seed)
    ours, theirs = spawn.Pipe(duplex=False)
    process = spawn.Process(target=run, args=(str(path), seed, theirs), daemon=True)
    process.start()
    theirs.close()
    assert ours.poll(60.0), "nothing was ever acknowledged"
    time.sleep(float(rng.uniform(0.0, 0.12)))
    process.kill()
    process.join()
    told: list[tuple[list[str], int, str]] = []
    try:
        while True:
            told.append(ours.recv())
    except EOFError:
        pass

    again = intake(path, seed)  # opens the journal as a resumed run does
    ground = Ground()
    count = replay(path, ground, again)  # type: ignore[arg-type]
    acknowledged = {name for accepted, _, _ in told for name in accepted}
    ids = [row.body["report"]["id"] for row in read_rows(path, "report")]
    assert acknowledged <= set(ids)
    assert len(ids) == len(set(ids)) == count

    retraced, digests = Ground(), [Ground().belief.digest()]
    for entry in read_entries(path, ReportRow):
        retrace(entry, retraced)  # type: ignore[arg-type]
        digests.append(retraced.belief.digest())
    assert [digests[so_far] for _, so_far, _ in told] == [digest for _, _, digest in told]
    assert digests[-1] == ground.belief.digest()

    async def retry() -> list[str]:
        now = again.clock.now()
        receipts = await again.submit_all([report(int(name[1:]), now) for name in ids])
        return [receipt.status for receipt in receipts]

    again.search = ground  # type: ignore[assignment]
    assert set(asyncio.run(retry())) == {"duplicate"}
    assert ground.belief.digest() == digests[-1]
    again.journal.close()
