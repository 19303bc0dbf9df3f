"""What a run leaves behind, and where."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest

from service.cli import main
from service.errors import BadInput
from service.journal import Journal
from service.mavlink import check_links
from service.mavlink.url import parse_url
from service.report import REPORT
from service.run import _new_folder  # a whole run for each name would take a minute
from service.survey import JOURNAL
from tests.service.export.recorded import record


@pytest.mark.parametrize("name", ["a" * 5000, "ä" * 300 + "b", "-" * 5000])
def test_an_area_with_a_long_name_has_a_folder(name: str, tmp_path: Path) -> None:
    folder = _new_folder(tmp_path, name)
    assert folder.is_dir()
    assert len(folder.name) < 150


def interrupted(parent: Path) -> Path:
    """The folder of a run that was interrupted before it flew, and whose next process waits a second for its link."""
    folder = record(parent / "slope", part=0.0)
    with contextlib.closing(Journal(folder / JOURNAL)) as journal:
        settings = journal.meta("settings")
        journal.set_meta("settings", {**settings, "link": {**settings["link"], "connect_timeout_s": 1.0}})
    return folder


def test_going_on_without_flying_overwrites_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nobody is heard on the link: what the flight before has left stays."""
    folder = interrupted(tmp_path)
    for name in (REPORT, "track.geojson", "map.png"):
        (folder / name).write_text("as it was")
    words = ["--resume", str(folder), "--connect", "udpin://127.0.0.1:0", "--http", "127.0.0.1:0", "--flat"]
    assert main(words) == 4
    assert f"nothing was flown: {folder / REPORT} is left as it was" in capsys.readouterr().out
    assert {(folder / name).read_text() for name in (REPORT, "track.geojson", "map.png")} == {"as it was"}


def test_one_link_that_is_missing_keeps_no_other_from_being_gone_on_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = interrupted(tmp_path)
    gone = f"serial://{tmp_path / 'gone'}:57600"
    links = ["--connect", "udpin://127.0.0.1:0", "--connect", gone]
    assert main(["--resume", str(folder), *links, "--http", "127.0.0.1:0", "--flat"]) == 4
    said = capsys.readouterr().out
    assert f"aircraft '2': cannot open the link {gone}: there is no such device" in " ".join(said.split())
    assert "the others go on" in said
    assert "nothing was heard on udpin" in said  # it was opened, and listened to


@pytest.mark.parametrize(
    ("gone", "resumed", "shut"), [({"2"}, True, {"2"}), ({"1", "2"}, True, None), ({"2"}, False, None)]
)
def test_a_start_and_a_resumption_without_any_link_are_refused(
    gone: set[str], resumed: bool, shut: set[str] | None, tmp_path: Path
) -> None:
    urls = {
        name: parse_url(f"serial://{tmp_path}/{name}:57600" if name in gone else "udpin://127.0.0.1:0")
        for name in ("1", "2")
    }
    if shut is None:
        with pytest.raises(BadInput, match=f"aircraft '{min(gone)}': cannot open the link .*no such device"):
            check_links(urls, resumed=resumed, patient=False)
    else:
        assert check_links(urls, resumed=resumed, patient=False) == shut
