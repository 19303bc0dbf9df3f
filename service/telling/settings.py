"""Whom to tell: the settings, checked before anything starts."""

from __future__ import annotations

import ssl
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from service.doors.mqtt import Broker, read_broker
from service.errors import BadInput
from service.secret_file import read_secret

_TAK = {"tcp": 8087, "tls": 8089, "udp": 6969}
"""Schemes with the ports that TAK usually has; udp may be multicast, as 239.2.3.1 is TAK's own."""


class TellingSettings(Protocol):
    """The table [telling] of the settings."""

    webhook: str
    webhook_token_file: str
    mqtt: str
    mqtt_topic: str
    mqtt_credentials_file: str
    tak: str
    tak_callsign: str
    tak_ca_file: str
    tak_certificate_file: str


@dataclass(frozen=True)
class Hook:
    """A URL that is posted to, and what to show when it asks who we are. Both may be secrets."""

    url: str = field(repr=False)
    token: str | None = field(default=None, repr=False)

    @property
    def shown(self) -> str:
        """The URL as it may be shown: its path is often a secret."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.hostname}/…"


@dataclass(frozen=True)
class Tak:
    """A TAK server, or a group of clients that listen by multicast."""

    scheme: str
    host: str
    port: int
    callsign: str
    ca_file: str = ""
    certificate_file: str = ""

    @property
    def shown(self) -> str:
        """As in the settings."""
        return f"{self.scheme}://{self.host}:{self.port}"


@dataclass(frozen=True)
class TellingPlan:
    """Whom a run tells; nobody, by default."""

    run: str = ""
    hook: Hook | None = None
    mqtt: Broker | None = None
    tak: Tak | None = None

    @property
    def anybody(self) -> bool:
        """Whether there is anybody to tell."""
        return not (self.hook is None and self.mqtt is None and self.tak is None)


def read_plan(settings: TellingSettings) -> TellingPlan:
    """Whom the settings name. Raises BadInput when an address is none, or a file cannot be read."""
    hook = tak = mqtt = None
    if settings.webhook:
        hook = _hook(settings.webhook, settings.webhook_token_file)
    if settings.mqtt:
        mqtt = read_broker(
            settings.mqtt, settings.mqtt_topic, settings.mqtt_credentials_file, table="telling"
        )
    if settings.tak:
        tak = _tak(settings)
    return TellingPlan(hook=hook, mqtt=mqtt, tak=tak)


def _hook(url: str, token_file: str) -> Hook:
    try:
        parts = urlsplit(url)
        good = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        good = False
    if not good:
        raise BadInput("telling.webhook is no URL that can be posted to; give https://HOST/PATH")
    token = None
    if token_file:
        token = read_secret(token_file, "webhook token").decode("utf-8", "replace").strip()
        if not token.isprintable() or not token.isascii():
            raise BadInput(
                f"{token_file}: the webhook token holds what no header may; write one line of ASCII"
            )
    return Hook(url, token)


def _tak(settings: TellingSettings) -> Tak:
    try:
        parts = urlsplit(settings.tak)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if not host or parts.scheme not in _TAK or parts.path.strip("/"):
        raise BadInput(
            f"telling.tak = '{settings.tak[:80]}' is no TAK address; give tcp://HOST:8087, tls://HOST:8089, or "
            "udp://239.2.3.1:6969 for multicast"
        )
    callsign = settings.tak_callsign.strip()
    if not callsign or len(callsign) > 40 or not callsign.isprintable():
        raise BadInput("telling.tak_callsign must have 1 to 40 characters that can be printed")
    tak = Tak(
        parts.scheme,
        host,
        port or _TAK[parts.scheme],
        callsign,
        settings.tak_ca_file,
        settings.tak_certificate_file,
    )
    if tak.scheme == "tls":
        tls_context(tak)
    return tak


def tls_context(tak: Tak) -> ssl.SSLContext:
    """What a TLS connection to a TAK server is made with. Raises BadInput when a file is no good."""
    for file in (tak.ca_file, tak.certificate_file):
        if file and not Path(file).is_file():
            raise BadInput(f"{file}: there is no such file; give a PEM file")
    try:
        context = ssl.create_default_context(cafile=tak.ca_file or None)
        if tak.certificate_file:
            context.load_cert_chain(tak.certificate_file)
    except (ssl.SSLError, OSError) as error:
        raise BadInput(f"the certificates for telling.tak cannot be used ({error}); give PEM files") from None
    if tak.ca_file:
        context.check_hostname = (
            False  # TAK servers' certificates rarely name the host; their own CA is trusted
        )
    return context
