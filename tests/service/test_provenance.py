"""A run goes on with what it was begun with, and says what it flies otherwise."""

from __future__ import annotations

import contextlib
import logging
from pathlib import Path

import pytest

from service.cli import main
from service.config import KNOWN_KEYS, Settings
from service.entries import read_entries
from service.errors import BadInput
from service.journal import Journal, read_meta
from service.provenance import (
    FINGERPRINTS,
    SECRET,
    VERSION,
    changes,
    fingerprints,
    note_resumption,
    refuse_changed,
    tell_changes,
)
from service.resume import stored_settings
from service.rows import ResumedRow
from service.survey import AREA, JOURNAL, PRIOR


def begun(folder: Path) -> tuple[Settings, dict[str, str]]:
    """A run's folder with a calibration beside it, and its fingerprints as the journal keeps them."""
    (folder / AREA).write_text("{}")
    (folder / "scores.csv").write_text("score,ratio\n")
    settings = Settings.model_validate({"sensor": {"calibration_file": str(folder / "scores.csv")}})
    journal = Journal(folder / JOURNAL)
    journal.set_meta(FINGERPRINTS, fingerprints(folder, settings))
    journal.close()
    return settings, read_meta(folder / JOURNAL, FINGERPRINTS)


def test_an_unchanged_run_goes_on_and_one_of_an_early_version_too(tmp_path: Path) -> None:
    settings, prints = begun(tmp_path)
    refuse_changed(tmp_path, settings, prints)
    (tmp_path / AREA).write_text("{ }")
    refuse_changed(tmp_path, settings, None)


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        (AREA, "{ }", r"area\.geojson is not what this run was begun with"),
        (AREA, None, r"area\.geojson is not what"),
        (PRIOR, "a prior", r"prior\.tif is not what"),
        ("scores.csv", "score,ratio\n0.5,9\n", r"sensor\.calibration_file is not what"),
    ],
)
def test_a_file_that_was_changed_since_is_refused(
    file: str, content: str | None, words: str, tmp_path: Path
) -> None:
    settings, prints = begun(tmp_path)
    if content is None:
        (tmp_path / file).unlink()
    else:
        (tmp_path / file).write_text(content)
    with pytest.raises(BadInput, match=words + r".*; put that back, or begin a new run$"):
        refuse_changed(tmp_path, settings, prints)


def test_what_is_flown_otherwise_is_told(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    after = Settings.model_validate({"search": {"found_at": 0.9}, "flight": {"takeoff": True}})
    changed = changes(Settings(), after)
    assert changed == {"search.found_at": 0.9, "flight.takeoff": True}
    monkeypatch.setattr(logging.getLogger("roisearch"), "propagate", True)
    with caplog.at_level(logging.INFO, "roisearch"):
        tell_changes(changed)
    assert "from here on, search.found_at = 0.9" in caplog.text


@pytest.mark.parametrize(
    "option", [["--prior", "prior.tif"], ["--config", "service.toml"], ["--runs", "elsewhere"]]
)
def test_an_option_that_does_nothing_in_a_resume_is_refused(
    option: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun(tmp_path)
    assert main(["--resume", str(tmp_path), *option]) == 2
    assert f"{option[0]} does nothing with --resume: a run goes on with what is in its folder" in (
        capsys.readouterr().err
    )


def test_a_resumption_is_journalled_with_what_it_changes(tmp_path: Path) -> None:
    settings, _ = begun(tmp_path)
    with contextlib.closing(Journal(tmp_path / JOURNAL)) as journal:
        journal.set_meta("settings", settings.model_dump())
        changed = settings.model_copy(update={"flight": settings.flight.model_copy(update={"takeoff": True})})
        note_resumption(journal, tmp_path, changed)
    (entry,) = read_entries(tmp_path / JOURNAL)
    assert isinstance(entry.said, ResumedRow)
    assert entry.said.changed == {"flight.takeoff": True}


def test_a_run_of_another_version_says_so_and_leaves_out_what_is_no_setting_now(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    settings, _ = begun(tmp_path)
    caplog.set_level(logging.INFO)
    with contextlib.closing(Journal(tmp_path / JOURNAL)) as journal:
        stored = settings.model_dump()
        stored["demo"]["speedup"] = 20.0
        journal.set_meta("settings", stored)
        journal.set_meta(VERSION, "0.2.0")
        note_resumption(journal, tmp_path, settings)
    assert "begun by roisearch 0.2.0 and goes on with" in caplog.text
    assert caplog.text.count("its setting demo.speedup is none of this version, and left out") == 1
    assert stored_settings(tmp_path / JOURNAL, {}) == settings


def covered(folder: Path, content: bytes, key: str) -> Settings:
    """Settings with a raster of the ground in a file."""
    (folder / "forest.tif").write_bytes(content)
    return Settings.model_validate({"ground": {key: str(folder / "forest.tif")}})


@pytest.mark.parametrize("key", ["cover_file", "mobility_file"])
def test_another_raster_of_the_ground_is_another_search(tmp_path: Path, key: str) -> None:
    settings = covered(tmp_path, b"dense", key)
    prints = fingerprints(tmp_path, settings)
    refuse_changed(tmp_path, settings, prints)
    with pytest.raises(BadInput, match=rf"ground\.{key} is not what this run was begun with"):
        refuse_changed(tmp_path, covered(tmp_path, b"sparse", key), prints)
    with pytest.raises(BadInput, match=rf"ground\.{key} is not what"):
        refuse_changed(tmp_path, Settings(), prints)
    with pytest.raises(BadInput, match=rf"ground\.{key} is not what"):
        refuse_changed(tmp_path, settings, fingerprints(tmp_path, Settings()))
    del prints[f"ground.{key}"]  # as early runs, which did not know of it
    refuse_changed(tmp_path, settings, prints)


def test_secrets_that_are_changed_are_not_told(tmp_path: Path) -> None:
    settings, _ = begun(tmp_path)
    telling = settings.telling.model_copy(update={"webhook": "https://hooks.example/T0/secret"})
    with contextlib.closing(Journal(tmp_path / JOURNAL)) as journal:
        journal.set_meta("settings", settings.model_dump())
        note_resumption(journal, tmp_path, settings.model_copy(update={"telling": telling}))
    (entry,) = read_entries(tmp_path / JOURNAL)
    assert isinstance(entry.said, ResumedRow)
    assert entry.said.changed == {"telling.webhook": "(not told)"}


def test_every_setting_that_names_a_secret_is_known_as_one() -> None:
    known = {f"{section}.{key}" for section, key in SECRET}
    words = ("key_file", "token_file", "credentials_file", "certificate_file", "webhook", "tiles_url")
    assert known == {key for key in KNOWN_KEYS if key.endswith(words)}
