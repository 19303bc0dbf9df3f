"""Where jobs run: a `concurrent.futures.Executor`, of processes here or of a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.synchronize import Event
from typing import Any

from rich.console import Console

from sim.trials.campaign import Job

CONNECT_TIMEOUT_S = 15.0
"""How long a Dask scheduler may take to answer."""

_AHEAD = 64
"""Jobs handed in and not done yet, per worker: enough to keep every worker busy, few enough to stop at once."""


@contextmanager
def executor(jobs: int, scheduler: str = "") -> Iterator[tuple[Executor, int]]:
    """An executor and how many workers it has: `jobs` processes here, or the cluster at `scheduler`.

    Raises:
        ValueError: when the cluster does not answer, or its client is not installed.
    """
    if scheduler:
        with _cluster(scheduler) as answer:
            yield answer
        return
    spawn = multiprocessing.get_context("spawn")
    stop = spawn.Event()
    pool = ProcessPoolExecutor(jobs, mp_context=spawn, initializer=_end_with_the_campaign, initargs=(stop,))
    try:
        yield pool, jobs
    except BaseException:
        stop.set()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_with_the_campaign(stop: Event) -> None:
    """Let the end of the campaign, told by `stop` or by the end of its process, end a worker at once.

    Ctrl-C reaches every process of a terminal: a worker that died of it before the campaign has noticed would look
    like one that broke.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch(wait: Callable[[], object]) -> None:
        wait()
        os._exit(1)

    for wait in (parent.join, stop.wait):
        threading.Thread(target=watch, args=(wait,), daemon=True).start()


@contextmanager
def _cluster(scheduler: str) -> Iterator[tuple[Executor, int]]:
    try:
        import distributed
    except ImportError:
        raise ValueError("--scheduler needs Dask: pip install 'roisearch[cluster]'") from None
    library: Any = distributed
    try:
        client = library.Client(scheduler, timeout=CONNECT_TIMEOUT_S)
    except OSError:
        raise ValueError(f"no Dask scheduler answers at {scheduler}") from None
    with client:
        workers = sum(client.nthreads().values())
        if workers == 0:
            raise ValueError(f"the Dask scheduler at {scheduler} has no workers")
        pool = client.get_executor(pure=False, retries=1)
        try:
            yield pool, workers
        finally:
            pool.shutdown(wait=False)


def run(
    pool: Executor,
    workers: int,
    work: Callable[[Job], list[dict[str, Any]]],
    jobs: Sequence[Job],
    done: Callable[[Job, list[dict[str, Any]]], None],
) -> None:
    """Run `work` on the jobs in any order; `done` is called here, in this thread, for each as it ends.

    Raises:
        Whatever `work` raises; what was handed in and not begun is then cancelled.
    """
    left = iter(jobs)
    waiting: dict[Future[list[dict[str, Any]]], Job] = {}

    def hand_in(count: int) -> None:
        for _, job in zip(range(count), left, strict=False):
            waiting[pool.submit(work, job)] = job

    hand_in(_AHEAD * workers)
    try:
        while waiting:
            for future in as_completed(list(waiting)):
                done(waiting.pop(future), future.result())
                if len(waiting) < _AHEAD * workers // 2:
                    break
            hand_in(_AHEAD * workers - len(waiting))
    finally:
        for future in waiting:
            future.cancel()


def exit_code(work: Callable[[], None], console: Console) -> int:
    """Do the work of a campaign; what a shell is told of it: 0 done, 130 interrupted, 1 a worker died."""
    try:
        work()
    except KeyboardInterrupt:
        console.print("interrupted; the same command continues")
        return 130
    except BrokenProcessPool:
        print("roisearch-sim trials: a worker died; the same command continues", file=sys.stderr)
        return 1
    return 0
