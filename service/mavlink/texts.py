"""STATUSTEXT: 50 characters a message, longer texts in numbered chunks."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.mavlink.events import StatusText
from service.mavlink.framing import Message

_CHUNK = 50
_LONGEST = 4 * _CHUNK
_PATIENCE_S = 2.0
_MOST_OPEN = 8
_ASCII = str.maketrans({"°": "", "′": "'"})


class TextReader:
    """Puts chunked texts together; a text whose end never comes is given out as far as it got."""

    def __init__(self) -> None:
        self._open: dict[int, tuple[float, int, dict[int, str]]] = {}

    def read(self, message: Message, now: float) -> list[StatusText]:
        """Take one STATUSTEXT; returns the texts that it completed."""
        text = message.text.rstrip("\0")
        if message.id == 0:
            return _said(now, message.severity, text)
        _, severity, chunks = self._open.setdefault(message.id, (now, message.severity, {}))
        chunks[message.chunk_seq] = text
        last = max(chunks)
        whole = len(chunks[last]) < _CHUNK and len(chunks) == last + 1
        if whole:
            del self._open[message.id]
            return _said(now, severity, "".join(chunks[i] for i in sorted(chunks)))
        if len(self._open) > _MOST_OPEN:
            return self._close(min(self._open, key=lambda key: self._open[key][0]), now)
        return []

    def tick(self, now: float) -> list[StatusText]:
        """Give out the texts whose end has not come in time."""
        late = [key for key, (since, _, _) in self._open.items() if now - since > _PATIENCE_S]
        return [said for key in late for said in self._close(key, now)]

    def _close(self, key: int, now: float) -> list[StatusText]:
        _, severity, chunks = self._open.pop(key)
        return _said(now, severity, "".join(chunks[i] for i in sorted(chunks)))


def _said(now: float, severity: int, text: str) -> list[StatusText]:
    text = text.strip()
    return [StatusText(now, severity, text)] if text else []


def text_messages(text: str, severity: int, text_id: int) -> list[Message]:
    """STATUSTEXT messages for our own text: ASCII, one message up to 50 characters, else chunks of whole words.

    Args:
        text: what to say; degrees and minutes of arc become `47 03.115'`, other characters question marks.
        severity: MAV_SEVERITY, 0 (emergency) to 7 (debug).
        text_id: 1 to 65535, different from the last one; used only for a chunked text.
    """
    plain = " ".join(text.translate(_ASCII).split()).encode("ascii", "replace")[:_LONGEST]
    if len(plain) <= _CHUNK:
        return [mavlink.MAVLink_statustext_message(severity, plain, 0, 0)]
    chunks = _pieces(plain)
    if len(chunks[-1]) == _CHUNK:  # only a shorter chunk ends a text
        chunks.append(b"")
    return [mavlink.MAVLink_statustext_message(severity, c, text_id, i) for i, c in enumerate(chunks)]


def _pieces(plain: bytes) -> list[bytes]:
    """Whole words in pieces of 50 characters, filled up with spaces, for a shorter one would end the text; the last
    one is as long as it is. A word that is longer than a piece is cut."""
    pieces: list[bytes] = []
    while len(plain) > _CHUNK:
        cut = plain.rfind(b" ", 1, _CHUNK)
        cut = _CHUNK if cut < 0 else cut
        pieces.append(plain[:cut].ljust(_CHUNK))
        plain = plain[cut:].lstrip()
    return [*pieces, plain]
