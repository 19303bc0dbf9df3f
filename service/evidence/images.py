"""Pictures that come with reports: small JPEGs, kept as files beside the journal and shown to people, never opened.

A file's name is the SHA-256 digest of what is in it, so that no sender chooses a name, nothing is written twice, and
what is served is what was sent. From then on the report has the picture's address in place of the picture.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import logging
import re
import tempfile
from pathlib import Path
from typing import TypeVar

from service.evidence.reports import KEPT_AT, MOST_IMAGE_BYTES, Detection, Report

log = logging.getLogger("roisearch")
FOLDER = "pictures"
MOST_FILES = 2000
"""Of one run; what comes later is not kept, and its report counts all the same."""
_Said = TypeVar("_Said", Report, Detection)
_NAME = re.compile(r"[0-9a-f]{64}\.jpg")


class Images:
    """The pictures of one run."""

    def __init__(self, run: Path) -> None:
        """`run`: the run's folder; nothing is made in it before a picture comes."""
        self.folder = run / FOLDER
        self._count: int | None = None

    def keep(self, report: Report) -> Report:
        """The report with the addresses of its pictures in place of them; it is the same when it brings none.

        A picture that cannot be kept (no room, a disk that is full) is left out and said: evidence does not wait.
        """
        if not brings(report):
            return report
        detections = tuple(self._kept(each) for each in report.detections)
        return self._kept(report.model_copy(update={"detections": detections}))

    def read(self, name: str) -> bytes | None:
        """A picture by its name; None when there is none of that name."""
        if not _NAME.fullmatch(name):
            return None
        try:
            with (self.folder / name).open("rb") as file:
                return file.read(MOST_IMAGE_BYTES)
        except OSError:
            return None

    def _kept(self, said: _Said) -> _Said:
        if not _brings(said):
            return said
        assert said.image is not None
        try:
            address = self._write(base64.b64decode(said.image, validate=True))
        except (OSError, binascii.Error) as error:
            log.warning("a picture of a report could not be kept: %s", error)
            address = None
        return said.model_copy(update={"image": address})

    def _write(self, data: bytes) -> str | None:
        name = f"{hashlib.sha256(data).hexdigest()}.jpg"
        if (self.folder / name).exists():
            return KEPT_AT + name
        self.folder.mkdir(exist_ok=True)
        if self._count is None:
            self._count = sum(1 for _ in self.folder.iterdir())
        if self._count >= MOST_FILES:
            log.warning("%d pictures are kept already; no more are", MOST_FILES)
            return None
        with tempfile.NamedTemporaryFile(dir=self.folder, prefix=".", delete=False) as file:
            file.write(data)
        Path(file.name).replace(self.folder / name)
        self._count += 1
        return KEPT_AT + name


def brings(report: Report) -> bool:
    """Whether a report comes with a picture that is to be kept."""
    return _brings(report) or any(map(_brings, report.detections))


def _brings(said: Report | Detection) -> bool:
    """Whether there is a picture to be kept, rather than an address."""
    return said.image is not None and not said.image.startswith(("http://", "https://", KEPT_AT))
