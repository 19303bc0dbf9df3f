"""A run that travels as one file."""

from __future__ import annotations

import json
import resource
import zipfile
from pathlib import Path

import pytest

from service.cli import main
from service.errors import BadInput
from service.evidence.images import Images
from service.export.run import read_run
from service.journal import Journal, read_meta, read_rows
from service.mark import read_mark
from service.packing import pack
from service.provenance import FINGERPRINTS, fingerprints, refuse_changed
from service.resume import stored_settings
from service.survey import JOURNAL
from service.unpacking import given_again, unpack
from tests.service.export.recorded import SETTINGS, record


def run_with_files(folder: Path) -> Path:
    """A run whose settings name a calibration, a terrain and a key."""
    record(folder)
    scores = folder.parent / "elsewhere.csv"
    scores.write_text("score,ratio\n")
    settings = SETTINGS.model_dump()
    settings["sensor"]["calibration_file"] = str(scores)
    settings["link"]["signing_key_file"] = "/etc/roisearch/key"
    settings["http"]["token_file"] = "/etc/roisearch/token"
    settings["telling"]["webhook"] = "https://hooks.example/etc/roisearch/hook"
    settings["telling"]["tak_certificate_file"] = "/etc/roisearch/tak.pem"
    journal = Journal(folder / JOURNAL)
    journal.set_meta("settings", settings)
    journal.set_meta(FINGERPRINTS, fingerprints(folder, stored_settings(folder / JOURNAL, {})))
    journal.close()
    return folder


def test_a_run_arrives_with_its_rows_its_ground_and_its_files_but_no_secrets(tmp_path: Path) -> None:
    folder = run_with_files(tmp_path / "here")
    rows = list(read_rows(folder / JOURNAL))
    assert pack(folder, tmp_path / "slope.zip") == len(rows)
    with zipfile.ZipFile(tmp_path / "slope.zip") as packed:
        assert not any(b"/etc/roisearch" in packed.read(name) for name in packed.namelist())
    there = unpack(tmp_path / "slope.zip", tmp_path / "other" / "runs", {})
    assert there == tmp_path / "other" / "runs" / "slope"
    assert list(read_rows(there / JOURNAL)) == rows
    assert read_mark(there / JOURNAL) == len(rows)
    settings = stored_settings(there / JOURNAL, {})
    assert Path(settings.sensor.calibration_file) == (there / "elsewhere.csv").resolve()
    assert (settings.link.signing_key_file, settings.http.token_file) == ("", "")
    assert (settings.telling.webhook, settings.telling.tak_certificate_file) == ("", "")
    refuse_changed(there, settings, read_meta(there / JOURNAL, FINGERPRINTS))
    assert read_run(there).belief.digest() == read_run(folder).belief.digest()


def test_a_run_that_is_being_flown_is_packed_with_all_that_is_on_disk(tmp_path: Path) -> None:
    folder = record(tmp_path / "here")
    journal = Journal(folder / JOURNAL)
    journal.write(9e9, "yielded", {"reason": "the pilot"}).result()  # in the -wal file
    count = pack(folder, tmp_path / "slope.zip")
    there = unpack(tmp_path / "slope.zip", tmp_path / "runs", {})
    assert [row.seq for row in read_rows(there / JOURNAL)] == list(range(1, count + 1))
    assert list(read_rows(there / JOURNAL))[-1].kind == "yielded"
    journal.close()


def test_what_is_no_packed_run_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    folder = record(tmp_path / "here")
    pack(folder, tmp_path / "slope.zip")
    content = (tmp_path / "slope.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "tea.zip", "w") as other:
        other.writestr("tea", json.dumps({}))
    (tmp_path / "cut.zip").write_bytes(content[: len(content) // 2])
    middle = len(content) // 2
    (tmp_path / "bent.zip").write_bytes(content[:middle] + bytes(64) + content[middle + 64 :])
    for name in ("tea.zip", "cut.zip", "bent.zip"):
        with pytest.raises(BadInput, match=rf"{name}: is no packed run|journal is damaged"):
            unpack(tmp_path / name, tmp_path / "runs", {})
    assert not list((tmp_path / "runs").glob("*")) if (tmp_path / "runs").exists() else True


def test_neither_packing_nor_unpacking_overwrites(tmp_path: Path) -> None:
    folder = record(tmp_path / "here")
    pack(folder, tmp_path / "slope.zip")
    with pytest.raises(BadInput, match=r"slope\.zip: is there already; give another --out"):
        pack(folder, tmp_path / "slope.zip")
    unpack(tmp_path / "slope.zip", tmp_path, {})
    with pytest.raises(BadInput, match="slope: is there already; go on with it"):
        unpack(tmp_path / "slope.zip", tmp_path, {})


def test_the_command_names_the_file_after_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = run_with_files(tmp_path / "slope")
    monkeypatch.chdir(tmp_path)
    assert main(["pack", str(folder)]) == 0
    said = capsys.readouterr().out
    assert "slope.zip: " in said
    stay = "link.signing_key_file, http.token_file, telling.webhook, telling.tak_certificate_file"
    assert (
        f"to be given again there: {stay}, by variables such as ROISEARCH_LINK_SIGNING_KEY_FILE=...\n" in said
    )
    assert main(["--resume", "slope.zip", "--prior", "x.tif"]) == 2
    assert "--prior does nothing with --resume" in capsys.readouterr().err


@pytest.mark.parametrize("raster", ["cover", "mobility"])
def test_rasters_of_the_ground_come_along(tmp_path: Path, raster: str) -> None:
    folder = run_with_files(tmp_path / "here")
    given = tmp_path / "forest.tif"
    given.write_bytes(b"as it is")
    journal = Journal(folder / JOURNAL)
    settings = journal.meta("settings")
    ground = {**settings["ground"], f"{raster}_file": str(given)}
    journal.set_meta("settings", {**settings, "ground": ground})
    journal.close()
    pack(folder, tmp_path / "slope.zip")
    there = unpack(tmp_path / "slope.zip", tmp_path / "runs", {})
    carried = Path(getattr(stored_settings(there / JOURNAL, {}).ground, f"{raster}_file"))
    assert carried == (there / "forest.tif").resolve()
    assert carried.read_bytes() == b"as it is"


def test_files_of_one_name_and_the_calibration_of_each_aircraft_come_along(tmp_path: Path) -> None:
    folder = run_with_files(tmp_path / "here")
    given = [tmp_path / name / "elsewhere.csv" for name in ("kite", "lark")]
    for each in given:
        each.parent.mkdir()
        each.write_text(each.parent.name)
    journal = Journal(folder / JOURNAL)
    aircraft = [{"name": each.parent.name, "sensor": {"calibration_file": str(each)}} for each in given]
    journal.set_meta("settings", {**journal.meta("settings"), "aircraft": aircraft})
    journal.set_meta(FINGERPRINTS, fingerprints(folder, stored_settings(folder / JOURNAL, {})))
    journal.close()
    pack(folder, tmp_path / "slope.zip")
    for each in given:
        each.unlink()
    there = unpack(tmp_path / "slope.zip", tmp_path / "runs", {})
    settings = stored_settings(there / JOURNAL, {})
    refuse_changed(there, settings, read_meta(there / JOURNAL, FINGERPRINTS))
    carried = [Path(each.sensor.given["calibration_file"]) for each in settings.aircraft]
    assert [each.read_text() for each in carried] == ["kite", "lark"]
    assert {each.parent for each in carried} == {there.resolve()}


def test_what_does_not_travel_is_given_again_by_variables(tmp_path: Path) -> None:
    variables = {"ROISEARCH_LINK_SIGNING_KEY_FILE": "/there/key", "ROISEARCH_SENSOR_P_TP": "0.5"}
    assert given_again(variables) == {"link.signing_key_file": "/there/key"}  # and nothing that did


def test_pictures_and_the_area_as_it_was_given_come_along(tmp_path: Path) -> None:
    folder = record(tmp_path / "here")
    (folder / "area-as-given.kml").write_text("<kml/>")
    name = f"{'0a' * 32}.jpg"
    (folder / "pictures").mkdir()
    (folder / "pictures" / name).write_bytes(b"\xff\xd8\xff\xff\xd9")
    pack(folder, tmp_path / "slope.zip")
    with zipfile.ZipFile(tmp_path / "slope.zip", "a") as packed:
        packed.writestr("pictures/../../elsewhere.jpg", b"")
    there = unpack(tmp_path / "slope.zip", tmp_path / "runs", {})
    assert (there / "area-as-given.kml").read_text() == "<kml/>"
    assert Images(there).read(name) == b"\xff\xd8\xff\xff\xd9"
    assert not list(tmp_path.rglob("elsewhere.jpg"))


def test_a_disk_that_is_full_leaves_no_half_packed_run(tmp_path: Path) -> None:
    folder = record(tmp_path / "here")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(
        resource.RLIMIT_FSIZE, (33_000, hard)
    )  # room for what SQLite reads by, and for no copy
    try:
        with pytest.raises(BadInput, match="was not written"):
            pack(folder, tmp_path / "slope.zip")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not (tmp_path / "slope.zip").exists()
    pack(folder, tmp_path / "slope.zip")
