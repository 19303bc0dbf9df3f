"""What strangers do to a service that flies, each in a process of its own: `python -m sim.soak.attacks KIND ADDRESS`.

Nothing here is clever. It is what a wrong script, a page left open, or somebody with a laptop on the field's network
can do all day; every kind goes on until it is killed.
"""

from __future__ import annotations

import asyncio
import json
import random
import socket
import sys
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import httpx
from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

MQTT_BYTES = 54_000_000
HALF_OPEN = 400
WATCHERS = 16
_TOPIC = "roisearch/reports"


def _report(rng: random.Random, place: tuple[float, float], count: int) -> dict[str, Any]:
    """A frame of now with so many detections around a place."""
    detections = [
        {"lat": place[0] + rng.uniform(-1e-4, 1e-4), "lon": place[1] + rng.uniform(-1e-4, 1e-4), "score": 0.3}
        for _ in range(count)
    ]
    name = f"costly-{rng.getrandbits(64):x}"
    return {"id": name, "source": "costly", "captured_at": time.time(), "detections": detections}


def costly_reports(address: str) -> None:
    """Batches of frames with as many detections as a report may hold."""
    rng = random.Random(1)
    with httpx.Client(base_url=address, timeout=30.0) as client:
        while True:
            try:
                pose = client.get("/api/state").json().get("pose") or {"lat": 47.05, "lon": 8.3}
                batch = [_report(rng, (pose["lat"], pose["lon"]), 256) for _ in range(20)]
                client.post("/api/reports", json=batch)
            except (httpx.HTTPError, ValueError):
                time.sleep(0.05)


def maps(address: str) -> None:
    """The map, in both forms and as a picture, again and again."""
    with httpx.Client(base_url=address, timeout=60.0) as client:
        while True:
            for path in ("/api/map", "/api/map?format=geojson", "/api/map.png"):
                try:
                    client.get(path)
                except httpx.HTTPError:
                    time.sleep(0.05)


def decisions(address: str) -> None:
    """As many decisions as there may be in an answer, again and again."""
    with httpx.Client(base_url=address, timeout=60.0) as client:
        while True:
            try:
                client.get("/api/decisions?count=1000")
            except httpx.HTTPError:
                time.sleep(0.05)


def half_open(address: str) -> None:
    """Hundreds of connections with half a request each, renewed when they are ended."""
    where = urlsplit(address)
    held: list[socket.socket] = []
    while True:
        try:
            one = socket.create_connection((where.hostname or "", where.port or 0), timeout=5.0)
            one.sendall(b"POST /api/commands HTTP/1.1\r\nHost: 127.0.0.1\r\n")
            held.append(one)
        except OSError:
            time.sleep(0.05)
        if len(held) > HALF_OPEN:
            held.pop(0).close()
            time.sleep(0.002)


async def _wish(address: str) -> None:
    while True:
        try:
            async with connect(address.replace("http", "ws", 1) + "/api/events", max_size=None) as watcher:
                while True:
                    await watcher.send('{"at": 1.0}')
        except (WebSocketException, OSError):
            await asyncio.sleep(0.2)


def wishes(address: str) -> None:
    """Pages that wish for another time thousands of times a second, and read nothing."""

    async def all_of_them() -> None:
        await asyncio.gather(*(_wish(address) for _ in range(WATCHERS)))

    asyncio.run(all_of_them())


def datagrams(address: str) -> None:
    """Full datagrams of lines that are no reports, as fast as they go out."""
    where = urlsplit(address)
    data = (b'{"id": "x", "captured_at": "' + b"y" * 400 + b'"}\n') * 130
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect((where.hostname, where.port))
        while True:
            try:
                client.send(data)
            except OSError:
                time.sleep(0.01)


def published(address: str) -> None:
    """A message of 54 MB every few seconds, and thousands of small ones between."""
    import aiomqtt

    where = urlsplit(address)
    line = json.dumps(_report(random.Random(2), (47.05, 8.3), 40)).encode() + b"\n"

    async def publish() -> None:
        while True:
            try:
                async with aiomqtt.Client(where.hostname or "", where.port or 1883) as client:
                    while True:
                        await client.publish(_TOPIC, line * (MQTT_BYTES // len(line)), qos=0)
                        for _ in range(1000):
                            await client.publish(_TOPIC, line, qos=0)
                        await asyncio.sleep(3.0)
            except (aiomqtt.MqttError, OSError):
                await asyncio.sleep(0.2)

    asyncio.run(publish())


KINDS: dict[str, Callable[[str], None]] = {
    "costly reports": costly_reports,
    "maps": maps,
    "decisions": decisions,
    "half-open connections": half_open,
    "wishes": wishes,
    "datagrams": datagrams,
    "MQTT": published,
}

if __name__ == "__main__":
    KINDS[sys.argv[1]](sys.argv[2])
