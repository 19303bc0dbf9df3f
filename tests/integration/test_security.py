"""The door of the real service, locked: who may do what, and that no file or line ever holds a token."""

from __future__ import annotations

import hashlib
from pathlib import Path

import httpx
import pytest

from tests.integration.flight import running, service_words, write_area

pytestmark = pytest.mark.timeout(300)
COMMAND, REPORT = "command-token-0123456789", "report-token-0123456789"


def test_a_locked_door_lets_the_own_detector_report_and_leaves_no_token_behind(tmp_path: Path) -> None:
    for name, token in (("command", COMMAND), ("report", REPORT)):
        (tmp_path / name).write_text(token + "\n")
        (tmp_path / name).chmod(0o600)
    config = tmp_path / "settings.toml"
    config.write_text(
        f'[http]\ntoken_file = "{tmp_path}/command"\nreport_token_file = "{tmp_path}/report"\n',
        encoding="utf-8",
    )
    runs = tmp_path / "runs"
    words = service_words(write_area(tmp_path), runs, "--config", str(config), "--speedup", "10")
    with running(*words) as service:
        url = service.wait_for(r"listening on (http://\S+)").group(1)
        service.wait_for("SEARCHING")
        anybody = httpx.Client(base_url=url)
        detector = httpx.Client(base_url=url, headers={"authorization": f"Bearer {REPORT}"})
        operator = httpx.Client(base_url=url, headers={"authorization": f"Bearer {COMMAND}"})
        assert [who.get("/api/state").status_code for who in (anybody, detector, operator)] == [401, 200, 200]
        hold = {"command": "hold"}
        codes = [who.post("/api/commands", json=hold).status_code for who in (anybody, detector)]
        assert codes == [401, 403]
        frame = {"id": "mine", "captured_at": detector.get("/api/state").json()["pose"]["time"]}
        assert detector.post("/api/reports", json=frame).json()[0]["status"] == "accepted"
        assert operator.get("/", headers={"host": "evil.example"}).status_code == 421
        assert operator.post("/api/commands", json={"command": "abort"}).json() == {"state": "ABORTED"}
        assert service.exit_code() == 4
    (folder,) = runs.iterdir()
    rows = (folder / "journal.sqlite").read_bytes()
    assert b'"source": "simulated"' in rows  # the service's own detector got in by a token of its own
    left_behind = [(file.name, file.read_bytes()) for file in folder.iterdir()] + [
        ("log", service.said.encode())
    ]
    for token in (COMMAND, REPORT):
        for secret in (token, hashlib.sha256(token.encode()).hexdigest()):
            assert [name for name, content in left_behind if secret.encode() in content] == []
