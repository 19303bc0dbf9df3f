"""A whole search that tells: a webhook hears of suspect and find, and a TAK team sees both and the aircraft."""

from __future__ import annotations

import json
import socket
import threading
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from tests.integration.flight import only_report, running, service_words, write_area

pytestmark = pytest.mark.timeout(600)


@contextmanager
def receiver() -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """A web server that refuses the first of each piece of news and takes the second."""
    told: list[dict[str, Any]] = []
    refused: set[str] = set()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            first = body["id"] not in refused
            refused.add(body["id"])
            if not first:
                told.append(body)
            self.send_response(503 if first else 204)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/hook", told
    finally:
        server.shutdown()
        thread.join()


def test_a_suspect_and_the_find_are_told_while_the_search_flies(tmp_path: Path) -> None:
    with receiver() as (url, told), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as team:
        team.bind(("127.0.0.1", 0))
        settings = tmp_path / "service.toml"
        settings.write_text(
            f'[sensor]\ncell_m = 20\np_tn = 0.99\n[run]\ncoordinates = "mgrs"\n[telling]\nwebhook = "{url}"\n'
            f'tak = "udp://127.0.0.1:{team.getsockname()[1]}"\n'
        )
        words = service_words(
            write_area(tmp_path), tmp_path / "runs", "--config", str(settings), "--seed", "3"
        )
        with running(*words) as service:
            assert service.exit_code() == 0, service.said
        team.settimeout(0.2)
        seen = set()
        try:
            while True:
                seen.add(ET.fromstring(team.recv(9000)).attrib["type"])
        except TimeoutError:
            pass
    report = only_report(tmp_path / "runs")
    kinds = [body["kind"] for body in told]
    assert "suspect" in kinds
    (find,) = [body for body in told if body["kind"] == "found"]
    assert (find["lat"], find["lon"]) == (report["position"]["lat"], report["position"]["lon"])
    assert find["written"] == report["best_place_written"]
    assert find["written"].startswith("32T ")
    assert f"FOUND at {find['written']}" in service.said
    assert {"a-f-A-M-H-Q", "b-m-p-s-m"} <= seen
