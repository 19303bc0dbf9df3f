"""Whole tiny campaigns: the same on any number of workers and on Dask, and after being killed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim.trials.cli import main

WORDS = [
    "--planners", "index,puct-regions-lite@paper", "--fov", "point,donut", "--ruler", "both", "--trials", "3",
    "--curves", "2", "--size", "14,14", "--cap", "300", "--seed", "5",
]  # fmt: skip
SAME = ("results.csv", "curves.csv", "bounds.csv")


def contents(folder):
    return {name: (folder / name).read_bytes() for name in SAME}


def command(out, *words):
    return [sys.executable, "-m", "sim", "trials", *WORDS, *words, "--out", str(out)]


def workers_of(pid):
    """The pool's processes of a campaign."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    workers = [
        int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()
    ]
    assert workers
    return workers


def alive(pid):
    try:
        return ") Z" not in Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """The campaign, run on one worker."""
    folder = tmp_path_factory.mktemp("once")
    assert main([*WORDS, "--jobs", "1", "--out", str(folder)]) == 0
    return folder


def test_two_workers_give_the_bytes_of_one(once, tmp_path):
    assert main([*WORDS, "--jobs", "2", "--out", str(tmp_path)]) == 0
    assert contents(tmp_path) == contents(once)


def test_another_seed_gives_other_numbers(once, tmp_path):
    words = [word if word != "5" else "6" for word in WORDS]
    assert main([*words, "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert contents(tmp_path)["results.csv"] != contents(once)["results.csv"]


def test_a_killed_campaign_goes_on_where_it_was(once, tmp_path):
    journal = tmp_path / "journal.jsonl"
    process = subprocess.Popen(
        command(tmp_path, "--jobs", "1"), stdout=subprocess.DEVNULL, start_new_session=True
    )
    try:
        give_up = time.monotonic() + 120
        while not journal.exists() or journal.read_bytes().count(b"\n") < 3:
            assert process.poll() is None
            assert time.monotonic() < give_up
            time.sleep(0.005)
        workers = workers_of(process.pid)
    finally:
        process.kill()
        process.wait()
    while any(alive(worker) for worker in workers):  # they end with the campaign
        assert time.monotonic() < give_up
        time.sleep(0.02)
    before = journal.read_bytes()
    with journal.open("ab") as file:  # a line that was being written
        file.write(b'{"kind":"search","pla')
    assert main([*WORDS, "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert journal.read_bytes().startswith(before)
    assert contents(tmp_path) == contents(once)
    jobs = [(r["kind"], r["planner"], r["fov"], r["trial"]) for r in map(json.loads, journal.open())]
    assert len(jobs) == len(set(jobs))


def test_a_finished_campaign_does_nothing_again(once):
    before = (once / "journal.jsonl").read_bytes()
    assert main([*WORDS, "--jobs", "1", "--out", str(once)]) == 0
    assert (once / "journal.jsonl").read_bytes() == before


def test_other_settings_in_the_same_folder_are_refused_in_one_sentence(once, capsys):
    before = contents(once)
    assert main([*WORDS, "--found", "covered", "--out", str(once)]) == 2
    said = capsys.readouterr().err
    assert 'found = "hit", not "covered"' in said
    assert said.count("\n") == 1
    assert contents(once) == before


def test_the_report_has_every_table_and_figure(once):
    report = (once / "report.md").read_text()
    assert "above the bound" in report
    for name in ("steps-by-planner", "steps-by-fov", "time-per-step", "detection-curves"):
        assert f"({name}.png)" in report
        png = (once / f"{name}.png").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert len(png) > 10_000
    summary = json.loads((once / "summary.json").read_text())
    assert len(summary["scenarios"]) == 4
    for row in summary["scenarios"]:
        assert row["sampled"]["above_bound"] is not None
        assert row["curve"]["above_bound"] > 0.0
    rows = (once / "results.csv").read_text().splitlines()
    assert len(rows) == 1 + 2 * 2 * 3


def test_a_dask_cluster_gives_the_bytes_of_one_worker(once, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", scheduler_port=0, dashboard_address=None
    ) as cluster:
        assert main([*WORDS, "--scheduler", cluster.scheduler_address, "--out", str(tmp_path)]) == 0
    assert contents(tmp_path) == contents(once)


def test_a_scheduler_that_is_not_there_is_named(tmp_path, capsys, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("sim.trials.pool.CONNECT_TIMEOUT_S", 0.5)
    assert main([*WORDS, "--scheduler", "tcp://127.0.0.1:9", "--out", str(tmp_path)]) == 2
    assert "tcp://127.0.0.1:9" in capsys.readouterr().err


def test_an_interrupt_writes_what_there_is_and_says_how_to_go_on(tmp_path):
    process = subprocess.Popen(
        command(tmp_path, "--jobs", "1", "--cap", "20000", "--trials", "300"),
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(
            signal.SIGINT, signal.SIG_DFL
        ),  # a shell's background job ignores it
    )
    journal = tmp_path / "journal.jsonl"
    give_up = time.monotonic() + 120
    while not journal.exists() or journal.read_bytes().count(b"\n") < 3:
        assert process.poll() is None
        assert time.monotonic() < give_up
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)
    said, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "continues" in said
    assert re.search(r"\d+ of \d{3,} jobs done in \d+ s", said)
    assert "Not complete" in (tmp_path / "report.md").read_text()
