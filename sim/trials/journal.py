"""The folder of a campaign: what it is, and one line for every job that is done.

`campaign.json` holds the settings. `journal.jsonl` gets one line per finished job, in one write, so that whatever
ends the program, every line but the last is whole; a cut last line is dropped when the folder is opened again.
Everything else in the folder is made from these two.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from sim.trials.campaign import Campaign, Job

FORMAT = 1


class Described(Protocol):
    """A campaign, as far as its folder is concerned."""

    def to_dict(self) -> dict[str, Any]:
        """The settings as plain JSON values."""
        ...

    def search_of(self, job: Job) -> Job | None:
        """The job whose result comes with that of `job`."""
        ...


class Refused(ValueError):
    """The folder cannot be used for this campaign; the message says why."""


def write_whole(path: Path, text: str) -> None:
    """Write a file so that it is there whole or not at all."""
    scratch = path.with_name(path.name + ".part")
    scratch.write_text(text, encoding="utf-8")
    scratch.replace(path)


def job_of(result: dict[str, Any]) -> Job:
    """The job that a result is of."""
    return Job(result["kind"], result["planner"], result["fov"], result["trial"])


class Journal:
    """The results of a campaign, in a folder.

    Args:
        folder: made if it is not there; if it holds a campaign, that is continued.

    Raises:
        Refused: when the folder holds another campaign, or is no folder.
    """

    def __init__(self, folder: Path, campaign: Described) -> None:
        self.folder = folder
        settings = {"format": FORMAT, **campaign.to_dict()}
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise Refused(f"{folder} cannot hold the results: {error.strerror}") from None
        described = folder / "campaign.json"
        there = json.loads(described.read_text(encoding="utf-8")) if described.exists() else None
        if there is not None:
            _compare(folder, there, settings)
        if there is None or there["planners"] != settings["planners"]:
            write_whole(described, json.dumps(settings, indent=2) + "\n")
        self._path = folder / "journal.jsonl"
        self.results: dict[Job, dict[str, Any]] = {}
        self._read()
        self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

    def _read(self) -> None:
        """Take in what is there, and drop a line that was cut."""
        if not self._path.exists():
            return
        data = self._path.read_bytes()
        whole = data.rfind(b"\n") + 1
        if whole < len(data):
            os.truncate(self._path, whole)
        for number, line in enumerate(data[:whole].splitlines(), 1):
            try:
                result = json.loads(line)
                self.results[job_of(result)] = result
            except (ValueError, KeyError, TypeError):
                raise Refused(
                    f"line {number} of {self._path} is damaged; delete it to redo its job"
                ) from None

    def left(self, jobs: Sequence[Job], campaign: Described) -> list[Job]:
        """The jobs that are to be done, without those whose results come with another's."""
        pending = [job for job in jobs if job not in self.results]
        given = {campaign.search_of(job) for job in pending}
        return [job for job in pending if job not in given]

    def add(self, results: Sequence[dict[str, Any]]) -> None:
        """Write down the results of one job."""
        lines = [json.dumps(result, separators=(",", ":")) + "\n" for result in results]
        os.write(self._file, "".join(lines).encode())
        self.results.update((job_of(result), result) for result in results)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.fsync(self._file)
        os.close(self._file)


def with_earlier_planners(folder: Path, campaign: Campaign) -> Campaign:
    """The campaign with the planners that its folder has already before its own: one may be added at any time, and
    flies over the maps that the others flew over."""
    try:
        there = json.loads((folder / "campaign.json").read_text(encoding="utf-8"))["planners"]
    except (OSError, ValueError, KeyError, TypeError):
        return campaign  # there is none, or `Journal` says what is wrong with it
    earlier = [name for name in there if isinstance(name, str)]
    added = [name for name in campaign.planners if name not in earlier]
    return replace(campaign, planners=(*earlier, *added))


def _compare(folder: Path, there: dict[str, Any], here: dict[str, Any]) -> None:
    """Raise when the settings differ, naming the first that does."""
    plain = json.loads(json.dumps(here))
    if plain["planners"][: len(there["planners"])] == there["planners"]:
        there = {**there, "planners": plain["planners"]}  # others came to them
    for key in [*plain, *there]:
        if there.get(key) != plain.get(key):
            raise Refused(
                f"{folder} holds a campaign with {key} = {_shown(there.get(key))}, not {_shown(plain.get(key))}; "
                "give another --out, or the settings in its campaign.json"
            )


def _shown(value: Any) -> str:
    return json.dumps(value)
