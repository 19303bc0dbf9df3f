"""Our events before CloudTAK's library, which holds each against its schema of Cursor on Target and draws what it says.

It is installed in `.ci/tak` when it is missing, for which npm has to be there.
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from service.telling.cot import AIRCRAFT, FOUND, GONE, SEARCHED, SUSPECT
from tests.service.telling.test_tak import all_events, parsed

CLIENT = Path(__file__).parents[3] / ".ci" / "tak"
INSTALL = ["npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", "--silent"]


@pytest.fixture(scope="module")
def judge() -> Path:
    """The script, with the library that it asks."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip(
            "NO NODE, NO NPM: NO EVENT HAS BEEN JUDGED BY CLOUDTAK'S LIBRARY (apt-get install nodejs npm)"
        )
    library = CLIENT / "node_modules" / "@tak-ps" / "node-cot" / "dist" / "index.js"
    if not library.exists():
        done = subprocess.run(INSTALL, cwd=CLIENT, capture_output=True, text=True, timeout=300.0)
        if done.returncode or not library.exists():
            pytest.skip(
                f"NO CLOUDTAK: NO EVENT HAS BEEN JUDGED BY ITS LIBRARY (npm ci: {done.stderr[-300:]})"
            )
    return CLIENT / "judge.mjs"


def judged(judge: Path, events: list[bytes]) -> list[dict[str, Any]]:
    """What the library makes of events."""
    asked = json.dumps([each.decode() for each in events])
    done = subprocess.run(
        ["node", str(judge)], input=asked, capture_output=True, text=True, check=True, timeout=120.0
    )
    told: list[dict[str, Any]] = json.loads(done.stdout)
    return told


def test_every_event_is_one_by_the_librarys_schema_and_means_to_it_what_we_say(judge: Path) -> None:
    events = all_events()
    told = judged(judge, events)
    assert {each.get("type") for each in told} == {AIRCRAFT, SUSPECT, FOUND, SEARCHED, GONE}, told
    for data, seen in zip(events, told, strict=True):
        event = parsed(data)
        assert (seen["id"], seen["type"], seen["how"]) == tuple(
            event.attrib[key] for key in ("uid", "type", "how")
        )
        lat, lon = (float(event[0].attrib[key]) for key in ("lat", "lon"))
        assert seen["center"][:2] == pytest.approx([lon, lat])
        contact = event.find("detail/contact")
        assert contact is None or seen["callsign"] == contact.attrib["callsign"]
        assert seen.get("remarks", "") == (event.findtext("detail/remarks") or "")
    (ring,) = {
        json.dumps(each["geometry"])
        for each in told
        if each["id"].endswith("-1") and each["type"] == SEARCHED
    }
    assert json.loads(ring)["type"] == "Polygon"


@pytest.mark.parametrize("missing", [b' lat="', b' ce="', b' hae="'])
def test_the_library_refuses_what_is_no_event(judge: Path, missing: bytes) -> None:
    event = all_events()[0]
    start = event.index(missing)
    broken = event[:start] + event[event.index(b'"', start + len(missing)) + 1 :]
    (seen,) = judged(judge, [broken])
    assert "must have required property" in seen["refused"]
