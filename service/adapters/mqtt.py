"""Messages of an MQTT broker, for adapters of programs that publish what they see."""

from __future__ import annotations

import argparse
import importlib.util
import queue
import ssl
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from service.errors import BadInput

if TYPE_CHECKING:
    from paho.mqtt.client import Client, MQTTMessage
    from paho.mqtt.reasoncodes import ReasonCode

PORTS = {"mqtt": 1883, "mqtts": 8883}
_MOST_WAITING = 1000


def add_broker(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """The flags of a broker."""
    parser.add_argument(
        "--mqtt", metavar="URL", required=required, help="the broker: mqtt://HOST[:PORT], or mqtts:// for TLS"
    )
    parser.add_argument("--mqtt-credentials", metavar="FILE", help="file with NAME:PASSWORD for the broker")


@dataclass(frozen=True)
class Broker:
    """Where the broker is, and who we are to it."""

    host: str
    port: int
    tls: bool
    name: str = ""
    password: str = field(default="", repr=False)


def read_broker(url: str, credentials: str | None) -> Broker:
    """The broker of the flags. Raises BadInput when it is none, or the client library is missing."""
    if importlib.util.find_spec("paho") is None:
        raise BadInput("MQTT needs its client: pip install 'roisearch[mqtt]'")
    parts = urlsplit(url)
    if parts.scheme not in PORTS or not parts.hostname or parts.username is not None:
        raise BadInput(
            "--mqtt is no broker; give mqtt://HOST:PORT, or mqtts:// for TLS, and its password in --mqtt-credentials"
        )
    name = password = ""
    if credentials is not None:
        try:
            name, _, password = Path(credentials).read_text(encoding="utf-8").strip().partition(":")
        except (OSError, UnicodeDecodeError) as error:
            raise BadInput(f"{credentials}: the credentials cannot be read ({error})") from error
    return Broker(parts.hostname, parts.port or PORTS[parts.scheme], parts.scheme == "mqtts", name, password)


def messages(broker: Broker, topics: list[str], wait_s: float = 1.0) -> Iterator[tuple[str, bytes] | None]:
    """Topic and payload of each message, and None whenever none has come for `wait_s`. A lost broker is called again.

    Raises:
        BadInput: it cannot be reached, or does not let us in.
    """
    inbox: queue.Queue[tuple[str, bytes] | str] = queue.Queue(_MOST_WAITING)
    client = _client(broker, topics, inbox)
    try:
        client.connect(broker.host, broker.port)
    except OSError as error:
        raise BadInput(f"the broker {broker.host}:{broker.port} cannot be reached ({error})") from error
    client.loop_start()
    try:
        while True:
            try:
                said = inbox.get(timeout=wait_s)
            except queue.Empty:
                yield None
                continue
            if isinstance(said, str):
                raise BadInput(said)
            yield said
    finally:
        client.loop_stop()
        client.disconnect()


def _client(broker: Broker, topics: list[str], inbox: queue.Queue[tuple[str, bytes] | str]) -> Client:
    """A client that subscribes at each connection, and puts what it hears into the inbox, or why it hears nothing."""
    from paho.mqtt.client import Client
    from paho.mqtt.enums import CallbackAPIVersion

    def connected(client: Client, _data: object, _flags: object, code: ReasonCode, _more: object) -> None:
        if code.is_failure:
            inbox.put(f"the broker {broker.host} does not let us in ({code})")
        else:
            client.subscribe([(topic, 1) for topic in topics])

    def heard(_client: Client, _data: object, message: MQTTMessage) -> None:
        if inbox.full():
            inbox.get_nowait()  # the oldest is the least worth
        inbox.put((message.topic, bytes(message.payload)))

    client = Client(CallbackAPIVersion.VERSION2)
    client.on_connect, client.on_message = connected, heard
    if broker.name:
        client.username_pw_set(broker.name, broker.password)
    if broker.tls:
        client.tls_set_context(ssl.create_default_context())
    return client
