"""Commands that the tests do not run to their end, each with the reason. What is not named here is run as typed.

A command of ours is parsed all the same, by its real parser, and any line must be good shell.
"""

from __future__ import annotations

LONG = "takes minutes to days: tests/sim runs each with less"
OTHERS = "another program"
INSTALLS = "installs: CI does it, in a new environment"
SYSTEM = "changes the machine: tests/service/test_systemd_unit.py and test_dockerfile.py read these files"
CAMERA = "needs a camera: tests/integration/test_rtsp_flight.py flies with one, tests/service/adapters plays the others"
SERIAL = "needs a serial port: tests/service/mavlink/test_transports.py plays one"
AGAIN = "the first page's line with this link is run, and tests/integration takes off"
TESTS = "the tests themselves: CI runs them"

NOT_TO_THE_END = {
    "python3 -m venv": INSTALLS,
    "pip install": INSTALLS,
    "apt-get install": INSTALLS,
    ". .venv/bin/activate": INSTALLS,
    "export PX4_HOME_LAT": OTHERS,
    "make px4_sitl": OTHERS,
    "sim_vehicle.py": OTHERS,
    "mavlink-routerd": OTHERS,
    "docker ": SYSTEM,
    "systemctl ": SYSTEM,
    "mkdir /etc": SYSTEM,
    "install -d": SYSTEM,
    "cp config/roisearch.service": SYSTEM,
    "openssl rand -hex 24 > /": SYSTEM,
    "curl -H": "asks a machine of that name: tests/service/http/test_access.py asks the same",
    "echo ": "needs that socket: tests/service/doors sends the same",
    "bash .ci/run": TESTS,
    ".venv/bin/ruff": TESTS,
    ".venv/bin/python -m pytest -n 3": TESTS,
    "ROISEARCH_PICTURES=": "makes the pictures anew",
    "ROISEARCH_TYPES=": "writes a file of the page's anew",
    "python -m tests.fuzz": "needs atheris: tests/fuzz/test_bad_bytes.py tries the same targets",
    "pytest tests/conformance": TESTS,
    "roisearch-sim ablation": LONG,
    "roisearch-sim climbing": LONG,
    "roisearch-sim bench": LONG,
    "roisearch-sim flights": LONG,
    ".venv/bin/roisearch-sim flights": LONG,
    "roisearch-sim soak": LONG,
    ".venv/bin/roisearch-sim soak": LONG,
    "roisearch-sim trials": LONG,
    "roisearch-service detector": CAMERA,
    "roisearch-service --area area.geojson --connect serial:": SERIAL,
    "roisearch-service --area area.geojson --connect udpin://127": AGAIN,
    "roisearch-service --area area.geojson --connect udpin://0.0.0.0:14540 --takeoff": AGAIN,
    "roisearch-service --area config/area.geojson --aircraft 3": "tests/integration/test_several.py flies it",
    "roisearch-service preview": "flies a whole search: tests/service/preview runs it over a small area",
}
"""How a line begins, and why it is not run."""

SERVING = {
    "roisearch-service --resume": "listening on|is over",
    "roisearch-service replay": "listening on|http://",
    "roisearch-service plan": "http://",
    "roisearch-service --area": "listening on",
}
"""How a line begins that serves until it is ended, and what it says once it does."""

MOCKS = {
    "udpin://": "roisearch-sim autopilot --flavor px4 --listen udpout://127.0.0.1:14540",
    "tcpout://127.0.0.1:5760": "roisearch-sim autopilot --flavor ardupilot --listen tcpin://127.0.0.1:5760",
}
"""The autopilot beside a line that calls for one."""

SERVICE = "roisearch-service --area area.geojson"
BESIDE = ("roisearch-sim detector --service", "curl -d")
"""How a line begins that talks to a service, and the service that all of them talk to."""


def reason(line: str) -> str | None:
    """Why a line is not run to its end; None if it is run."""
    return next((why for start, why in NOT_TO_THE_END.items() if line.startswith(start)), None)
