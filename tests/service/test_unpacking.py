"""A packed run may come from anywhere: what its file says beyond its search does nothing here."""

from __future__ import annotations

import contextlib
import json
import logging
import sqlite3
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from service.config import Settings
from service.errors import BadInput
from service.packing import pack
from service.resume import stored_settings
from service.survey import JOURNAL
from service.unpacking import LINK, given_again, not_taken_over, unpack
from tests.service.export.recorded import record

Change = Callable[[dict[str, Any]], Any]


def packed(
    folder: Path, change: Change = lambda settings: settings, sql: str = "", more: tuple[str, ...] = ()
) -> Path:
    """A packed run with other settings, whose journal was worked on, and with more files in it."""
    pack(record(folder / "here"), folder / "honest.zip")
    bent = folder / "slope.zip"
    with zipfile.ZipFile(folder / "honest.zip") as honest, zipfile.ZipFile(bent, "w") as lying:
        for name in honest.namelist():
            data = honest.read(name)
            if name == JOURNAL:
                (folder / "journal").write_bytes(data)
                with contextlib.closing(sqlite3.connect(folder / "journal")) as database:
                    ((text,),) = database.execute("SELECT value FROM meta WHERE key = 'settings'")
                    told = json.dumps(change(json.loads(text)))
                    database.execute("UPDATE meta SET value = ? WHERE key = 'settings'", (told,))
                    database.executescript(sql)
                    database.commit()
                data = (folder / "journal").read_bytes()
            lying.writestr(name, data)
        for name in more:
            lying.writestr(name, b"x")
    return bent


def with_(section: str, **values: Any) -> Change:
    """Settings with some of a section otherwise."""
    return lambda settings: {**settings, section: {**settings[section], **values}}


TRIGGER = "CREATE TRIGGER t AFTER INSERT ON meta BEGIN DELETE FROM meta WHERE key = new.key; END;"
LIES: dict[str, tuple[Change, str, str]] = {
    "settings null": (lambda _: None, "", "its journal has no settings"),
    "settings a list": (lambda _: [], "", "its journal has no settings"),
    "no settings": (lambda _: 1, "DELETE FROM meta WHERE key = 'settings'", "its journal has no settings"),
    "a section null": (lambda settings: {**settings, "sensor": None}, "", "'sensor' = None is not possible"),
    "a number for a file": (with_("sensor", calibration_file=5), "", "'sensor.calibration_file' = 5"),
    "a number for files": (with_("ground", file=5), "", "'ground.file' = 5"),
    "numbers for files": (with_("ground", file=[5]), "", "'ground.file.0' = 5"),
    "aircraft null": (lambda settings: {**settings, "aircraft": None}, "", "'aircraft' = None"),
    "its journal as ground": (with_("ground", file=["journal.sqlite-wal"]), "", "the run's own journal"),
    "code": (with_("search", planner="runs.slope.evil:P"), "", "its planner 'runs.slope.evil:P' is code"),
    "a trigger": (lambda settings: settings, TRIGGER, "its journal has a trigger 't'"),
    "a view": (lambda settings: settings, "CREATE VIEW v AS SELECT 1", "its journal has a view 'v'"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_packed_run_that_lies_is_refused_in_one_sentence_and_leaves_nothing(
    lie: str, tmp_path: Path
) -> None:
    change, sql, words = LIES[lie]
    file = packed(tmp_path, change, sql)
    with pytest.raises(BadInput) as refused:
        unpack(file, tmp_path / "runs", {})
    assert words in str(refused.value)
    assert str(refused.value).startswith(str(file))
    assert "\n" not in str(refused.value)
    assert list((tmp_path / "runs").iterdir()) == []


def flagged(data: bytes, local: int, central: int, value: int) -> bytes:
    """A zip with a byte of each of its entries' two headers otherwise."""
    bent = bytearray(data)
    for signature, offset in ((b"PK\x03\x04", local), (b"PK\x01\x02", central)):
        at = -1
        while (at := data.find(signature, at + 1)) >= 0:
            bent[at + offset] = value
    return bytes(bent)


@pytest.mark.parametrize(
    ("local", "central", "value", "words"), [(6, 8, 1, "encrypted"), (8, 10, 99, "compression")]
)
def test_what_cannot_be_taken_out_is_one_sentence(
    local: int, central: int, value: int, words: str, tmp_path: Path
) -> None:
    file = packed(tmp_path)
    file.write_bytes(flagged(file.read_bytes(), local, central, value))
    with pytest.raises(BadInput, match=rf"is no packed run, or is damaged .*{words}"):
        unpack(file, tmp_path / "runs", {})
    assert list((tmp_path / "runs").iterdir()) == []


def test_only_the_files_of_a_run_are_taken_out(tmp_path: Path) -> None:
    more = (
        "evil.py",
        "token",
        "pictures",
        "pictures/evil.py",
        "pictures/../x.jpg",
        "journal.sqlite-wal",
        "../out",
    )
    change = with_("ground", file=["elsewhere/heights.tif"])
    file = packed(tmp_path, change, more=(*more, "heights.tif", "pictures/a0.jpg"))
    there = unpack(file, tmp_path / "runs", {})
    lies = {str(each.relative_to(there)) for each in there.rglob("*") if each.is_file()}
    assert lies >= {"area.geojson", "journal.sqlite", "heights.tif", "pictures/a0.jpg"}
    assert all(name.startswith(("area.", "journal.", "heights.", "pictures/a0.")) for name in lies)
    assert not list(tmp_path.rglob("out"))
    assert stored_settings(there / JOURNAL, {}).ground.file == [str((there / "heights.tif").resolve())]


def test_what_reaches_out_of_the_search_is_not_taken_over_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    def change(settings: dict[str, Any]) -> dict[str, Any]:
        reaching: dict[str, dict[str, Any]] = {
            "flight": {"takeoff": True}, "http": {"listen": "0.0.0.0:8080", "token_file": "runs/slope/token"},
            "telling": {"webhook": "http://attacker/x"}, "doors": {"udp": "0.0.0.0:9000"},
            "page": {"tiles_url": "http://attacker/{z}"}, "run": {"folder": "/elsewhere"},
            "link": {"connect": "udpout://attacker:1", "lockstep": "/dev/shm/x", "signing_key_file": "runs/key"},
        }  # fmt: skip
        return {
            name: {**table, **reaching.get(name, {})} if name != "aircraft" else table
            for name, table in settings.items()
        }

    with caplog.at_level(logging.WARNING, logger="roisearch"):
        there = unpack(packed(tmp_path, change), tmp_path / "runs", {})
    settings, unset = stored_settings(there / JOURNAL, {}), Settings()
    assert (settings.http, settings.doors, settings.telling, settings.page) == (
        unset.http, unset.doors, unset.telling, unset.page,
    )  # fmt: skip
    assert (settings.link.connect, settings.link.lockstep, settings.link.signing_key_file) == (LINK, "", "")
    assert not settings.flight.takeoff
    assert not settings.mock  # a flight of a real aircraft does not go on with a simulated one
    assert settings.run.folder == str(tmp_path / "runs")
    assert "give --takeoff" in caplog.text
    for key in (
        "http.listen",
        "http.token_file",
        "telling.webhook",
        "doors.udp",
        "page.tiles_url",
        "link.connect",
    ):
        assert key in caplog.text
    again = stored_settings(
        there / JOURNAL, {"link.connect": "udpin://0.0.0.0:14540", "flight.takeoff": True}
    )
    assert (again.link.connect, again.flight.takeoff) == ("udpin://0.0.0.0:14540", True)


def test_the_links_of_several_are_not_taken_over_either(tmp_path: Path) -> None:
    tables = [{"connect": f"udpout://attacker:{port}"} for port in (1, 2)]
    there = unpack(packed(tmp_path, lambda settings: {**settings, "aircraft": tables}), tmp_path / "runs", {})
    connects = [each.connect for each in stored_settings(there / JOURNAL, {}).aircraft]
    assert all(connect.startswith(LINK) for connect in connects)
    given = [{"connect": f"udpin://0.0.0.0:{port}"} for port in (14540, 14541)]
    again = stored_settings(there / JOURNAL, {"aircraft": given})
    assert [each.connect for each in again.aircraft] == [each["connect"] for each in given]


def test_a_planner_of_ones_own_is_given_again_by_its_name(tmp_path: Path) -> None:
    file = packed(tmp_path, with_("search", planner="my.own:Planner"))
    there = unpack(file, tmp_path / "runs", {"search.planner": "my.own:Planner"})
    assert stored_settings(there / JOURNAL, {}).search.planner == Settings().search.planner
    again = stored_settings(there / JOURNAL, {"search.planner": "my.own:Planner"})
    assert again.search.planner == "my.own:Planner"


def test_all_that_is_not_taken_over_has_a_variable() -> None:
    settings = Settings.model_validate({"http": {"max_batch": 7}, "telling": {"tak": "udp://239.2.3.1:6969"}})
    assert not_taken_over(settings) == ["http.max_batch", "telling.tak"]
    assert given_again({"ROISEARCH_HTTP_MAX_BATCH": "9"}) == {"http.max_batch": "9"}
