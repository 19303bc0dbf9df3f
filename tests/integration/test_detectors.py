"""Detectors beside a real service: the client that the README shows, every door, and answers that get lost."""

from __future__ import annotations

import json
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx

from service.journal import read_rows
from tests.integration.flight import REPOSITORY, running, service_words, write_area

YOURS = """
import time
frames = iter({frames})
def look_at_next_frame():
    time.sleep(0.2)
    try:
        ago = next(frames)
        return time.time() - ago, [(47.0508, 8.3017, 0.9)] if ago > 100.0 else []
    except StopIteration:
        raise SystemExit(0)
"""


def readme_client(address: str, frames: list[float]) -> str:
    """The README's example, with frames that were taken so many seconds ago and then an end."""
    blocks = re.findall(r"```python\n(.*?)```", (REPOSITORY / "README.md").read_text(encoding="utf-8"), re.S)
    (example,) = (block for block in blocks if "look_at_next_frame()" in block)
    assert len(example.splitlines()) <= 30
    assert "http://127.0.0.1:8080" in example
    return YOURS.format(frames=frames) + example.replace("http://127.0.0.1:8080", address)


@contextmanager
def losing_answers(address: str, lost: int) -> Iterator[str]:
    """A way to the service on which the first so many answers to reports get lost: the connection ends instead."""
    host, port = address.removeprefix("http://").split(":")
    listener = socket.create_server(("127.0.0.1", 0))
    left = lost

    def carry(client: socket.socket) -> None:
        nonlocal left
        with client, socket.create_connection((host, int(port))) as server:
            while request := client.recv(1 << 16):
                server.sendall(request)
                while b"\r\n\r\n" in request and not whole(request):
                    more = client.recv(1 << 16)
                    request += more
                    server.sendall(more)
                answer = server.recv(1 << 20)
                while answer and not whole(answer):  # head and body may come apart
                    answer += server.recv(1 << 20)
                if request.startswith(b"POST /api/reports") and left:
                    left -= 1
                    return
                client.sendall(answer)

    def accept() -> None:
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=carry, args=(client,), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def whole(request: bytes) -> bool:
    head, _, body = request.partition(b"\r\n\r\n")
    length = re.search(rb"content-length: (\d+)", head.lower())
    return length is None or len(body) >= int(length.group(1))


def test_the_readmes_client_and_every_door_report_to_a_real_service(tmp_path: Path) -> None:
    settings, unix = tmp_path / "s.toml", tmp_path / "reports.sock"
    settings.write_text(
        f'[flight]\naltitude_m = 10\n[sensor]\ncell_m = 20\n[doors]\nudp = "127.0.0.1:0"\nunix = "{unix}"\n'
    )
    words = service_words(
        write_area(tmp_path), tmp_path / "runs", "--speedup", "1", "--config", str(settings)
    )
    with running(*words) as service:
        address = service.wait_for(r"listening on (http://\S+)").group(1)
        udp = int(service.wait_for(r"udp://127\.0\.0\.1:(\d+)").group(1))
        service.wait_for("→ SEARCHING")

        with losing_answers(address, lost=2) as way:
            code = readme_client(way, [0.1, 0.1, 3.0, 500.0, 0.1])
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        assert done.stdout.count("sending again") == 2
        assert "the telemetry is kept for 120 s" in done.stdout, "the sender sees why the fourth was refused"

        frame = {"captured_at": httpx.get(f"{address}/api/state").json()["pose"]["time"], "source": "lines"}
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
            client.settimeout(60)
            client.connect(("127.0.0.1", udp))
            client.send(json.dumps({**frame, "id": "by UDP"}).encode())
            assert json.loads(client.recv(1 << 16))["status"] == "accepted"
        with socket.socket(socket.AF_UNIX) as client:
            client.settimeout(60)
            client.connect(str(unix))
            client.sendall(
                "".join(json.dumps({**frame, "id": f"by {door}"}) + "\n" for door in ("Unix", "UDP")).encode()
            )
            client.shutdown(socket.SHUT_WR)
            answers = b"".join(iter(lambda: client.recv(1 << 16), b""))
            assert [json.loads(line)["status"] for line in answers.splitlines()] == ["accepted", "duplicate"]

        httpx.post(f"{address}/api/commands", json={"command": "abort"})
        assert service.exit_code() == 4
    assert not unix.exists()
    (journal,) = (tmp_path / "runs").glob("*/journal.sqlite")
    taken = [row.body["report"] for row in read_rows(journal, "report")]
    numbers = [int(each["id"].split("-")[-1]) for each in taken if each.get("source") == "cam0"]
    assert sorted(numbers) == [0, 1, 2, 4], "each once, whatever became of the answers"
    assert [each["id"] for each in taken if each.get("source") == "lines"] == ["by UDP", "by Unix"]
