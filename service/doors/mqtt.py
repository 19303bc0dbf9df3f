"""MQTT: reports as messages on a topic, receipts on the topic below it, `<topic>/receipts`.

A message holds one or more lines. The broker decides who may publish; the service gives it the name and password of
`doors.mqtt_credentials_file`. A message counts when its receipt is out: a sender that gets none sends it again.
"""

from __future__ import annotations

import asyncio
import importlib.util
import logging
import socket
import ssl
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from service.cancelling import end_if_cancelled
from service.doors.lines import SubmitAll, answer, as_line, refusal
from service.errors import BadInput
from service.secret_file import read_secret

if TYPE_CHECKING:
    from aiomqtt import Client
    from paho.mqtt.reasoncodes import ReasonCode

log = logging.getLogger("roisearch")
PORTS = {"mqtt": 1883, "mqtts": 8883}
RETRY_S = 2.0
_QOS = 1
_READ_BYTES = 1 << 16
"""Of the kernel's memory for what the broker sends: the client library reads all that is there before anything else has
its turn."""
MOST_BYTES = 1 << 20
"""Of a message; a longer one is not read."""
_NEVER_SENT = 8 << 20
"""Bytes of a message that a broker of MQTT 5 does not even send us (Maximum Packet Size, section 3.1.2.11.4): the
client library copies what it gets several times over, and with 54 MB an order waited half a second for that."""
_SPEAKS_NO_5 = 0x84
"""What a broker that speaks only older versions is taken to say (Unsupported Protocol Version)."""
MOST_GATHERED = 4 << 20
"""Bytes of messages that wait while others are answered; what comes then is refused."""
_RETAINED = "the broker had retained it, so it may be of another day; publish reports without retain"
_MOST_QUEUED = 1000  # messages between the client library and us


@dataclass(frozen=True)
class Broker:
    """Where the broker is, and who we are to it."""

    url: str
    host: str
    port: int
    tls: bool
    topic: str
    user: str | None = None
    password: str | None = field(default=None, repr=False)

    def client(self, **options: Any) -> Client:
        """A client of it, to be entered, with more `options` of aiomqtt.Client."""
        import aiomqtt

        return aiomqtt.Client(
            self.host,
            self.port,
            username=self.user,
            password=self.password,
            tls_context=ssl.create_default_context() if self.tls else None,
            socket_options=[(socket.SOL_SOCKET, socket.SO_RCVBUF, _READ_BYTES)],
            **options,
        )


def read_broker(url: str, topic: str, credentials_file: str, *, table: str = "doors") -> Broker:
    """The broker of a table of the settings. Raises BadInput when the URL, the topic or the credentials are none, or
    the client library is missing."""
    if importlib.util.find_spec("aiomqtt") is None:
        raise BadInput(f"{table}.mqtt needs the extra 'mqtt': pip install 'roisearch[mqtt]'")
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or parts.scheme not in PORTS or parts.path.strip("/") or parts.username is not None:
        raise BadInput(
            f"{table}.mqtt = '{_without_password(url)}' is not a broker; give mqtt://HOST:PORT, or mqtts:// for "
            f"TLS, and credentials in {table}.mqtt_credentials_file"
        )
    if not topic or any(sign in topic for sign in "+#\0"):
        raise BadInput(f"{table}.mqtt_topic = '{topic}' is not a topic; wildcards are not allowed")
    user = password = None
    if credentials_file:
        text = read_secret(credentials_file, "name and password of the MQTT broker").decode(
            "utf-8", "replace"
        )
        user, colon, password = text.strip().partition(":")
        if not colon:
            raise BadInput(f"{credentials_file}: the credentials are one line, NAME:PASSWORD")
    tls = parts.scheme == "mqtts"
    return Broker(url, host, port or PORTS[parts.scheme], tls, topic, user, password)


def _without_password(url: str) -> str:
    """The URL as it may be shown: nothing of what stands before an @, the last if there are several."""
    before, at, rest = url.rpartition("@")
    return (
        f"{before.partition('://')[0]}://…@{rest}" if at and "://" in before else f"…@{rest}" if at else url
    )


async def serve_mqtt(broker: Broker, submit: SubmitAll) -> None:
    """Take in what is published, until cancelled; a broker that is away is called again and again."""
    import aiomqtt

    told = ""
    speaks_5 = True
    while True:
        try:
            options = _short_messages() if speaks_5 else {}
            async with broker.client(max_queued_incoming_messages=_MOST_QUEUED, **options) as client:
                granted = await client.subscribe(broker.topic, qos=_QOS)
                if any(_refused(code) for code in granted):
                    raise aiomqtt.MqttError(f"it refuses the subscription to {broker.topic}; see its rights")
                log.info("reports are taken from %s at %s", broker.topic, broker.url)
                told = ""
                await _listen(client, broker, submit)
        except* (aiomqtt.MqttError, OSError) as group:
            reason = str(group.exceptions[0])
            if speaks_5 and _said_code(group.exceptions[0]) == _SPEAKS_NO_5:
                speaks_5 = False
            elif reason != told:
                log.warning("the MQTT broker %s cannot be used (%s): trying again", broker.url, reason)
            told = reason
            end_if_cancelled()
        await asyncio.sleep(RETRY_S)


def _short_messages() -> dict[str, Any]:
    """Options of a client of MQTT 5 that is sent no message longer than that."""
    from aiomqtt import ProtocolVersion
    from paho.mqtt.packettypes import PacketTypes
    from paho.mqtt.properties import Properties

    properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
    properties.MaximumPacketSize = _NEVER_SENT
    return {"protocol": ProtocolVersion.V5, "properties": properties}


def _said_code(error: BaseException) -> int | None:
    """The code with which a broker refuses a connection."""
    code = getattr(error, "rc", None)
    return code if isinstance(code, int) or code is None else int(code.value)


def _refused(code: int | ReasonCode) -> bool:
    """Whether a SUBACK's code is a failure (MQTT 3.1.1, 3.9.3)."""
    return (code if isinstance(code, int) else code.value) >= 0x80


async def _listen(client: Client, broker: Broker, submit: SubmitAll) -> None:
    """Answer messages until the connection ends: all that have come while the last were answered, at once."""
    gathered: list[bytes] = []
    refused: list[bytes] = []
    more = asyncio.Event()

    async def reply() -> None:
        while True:
            end_if_cancelled()
            await more.wait()
            more.clear()
            data, receipts = b"\n".join(gathered), b"".join(refused)
            gathered.clear()
            refused.clear()
            receipts += await answer(data, submit)
            if receipts:
                await client.publish(f"{broker.topic}/receipts", receipts, qos=_QOS)

    def take(message: bytes) -> None:
        if len(message) > MOST_BYTES:
            refused.append(as_line(refusal("", f"a message has at most {MOST_BYTES} bytes")))
        elif sum(map(len, gathered)) + len(message) > MOST_GATHERED:
            if len(refused) < _MOST_QUEUED:
                why = "more is published than can be taken in; send it again, and more slowly"
                refused.append(as_line(refusal("", why)))
        else:
            gathered.append(message)

    async with asyncio.TaskGroup() as group:
        group.create_task(reply())
        async for message in client.messages:
            if message.retain:  # the broker has kept it, and a frame's time since boot may be of another day
                refused.append(as_line(refusal("", _RETAINED)))
                more.set()
                continue
            payload = message.payload
            take(payload if isinstance(payload, bytes) else str(payload).encode())
            more.set()
