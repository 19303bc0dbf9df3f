"""A second service on one aircraft, behind a router that carries everything to everybody: both say so."""

from __future__ import annotations

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from sim.autopilot.process import AutopilotProcess
from tests.integration.flight import running, service_words, write_area

pytestmark = pytest.mark.timeout(300)
TWO = "this aircraft has two masters: another program (sends heartbeats|commands) as this service"


@contextmanager
def router(autopilot_port: int, guests: int) -> Iterator[list[str]]:
    """The addresses for so many programs, each of which hears the autopilot and all the others."""
    ends = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(guests + 1)]
    for end in ends:
        end.bind(("127.0.0.1", 0))
    peers: list[tuple[str, int] | None] = [("127.0.0.1", autopilot_port), *[None] * guests]
    over = threading.Event()

    def carry() -> None:
        while not over.is_set():
            for end in select.select(ends, [], [], 0.05)[0]:
                here = ends.index(end)
                try:
                    data, peer = end.recvfrom(4096)
                except ConnectionError:  # whoever was there is gone
                    continue
                if here:
                    peers[here] = peer
                for there, other in enumerate(peers):
                    if there != here and other is not None:
                        ends[there].sendto(data, other)

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield [f"udpout://127.0.0.1:{end.getsockname()[1]}" for end in ends[1:]]
    finally:
        over.set()
        thread.join()
        for end in ends:
            end.close()


def test_a_second_instance_on_one_aircraft_is_noticed_and_said_by_both(tmp_path: Path) -> None:
    with ExitStack() as stack:
        home = ("--home=47.0501,8.3001,400", "--ready-after", "3")
        autopilot = stack.enter_context(AutopilotProcess("ardupilot", speedup=1.0, options=home))
        links = stack.enter_context(router(autopilot.port, 2))
        area = write_area(tmp_path)
        services = [
            stack.enter_context(
                running(
                    *service_words(
                        area, tmp_path / f"runs {i}", "--speedup", "1", "--flat", "--connect", link
                    )
                )
            )
            for i, link in enumerate(links)
        ]
        for service in services:
            service.wait_for(TWO)
            assert service.process.poll() is None
