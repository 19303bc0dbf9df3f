"""Reading a secret (a bearer token, a signing key) from a file, without ever showing it."""

from __future__ import annotations

import logging
import stat
from pathlib import Path

from service.errors import BadInput

log = logging.getLogger("roisearch")
_MOST_BYTES = 4096


def read_secret(path: str, what: str) -> bytes:
    """The content of a file that holds a secret; `what` names it in messages, which never show any of it.

    Warns when every user of the machine may read the file.

    Raises:
        BadInput: it cannot be read, or is empty or far too long to be a secret.
    """
    file = Path(path)
    try:
        with file.open("rb") as stream:
            mode = file.stat().st_mode
            content = stream.read(_MOST_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        reason = getattr(error, "strerror", None) or error
        raise BadInput(f"{path}: the {what} cannot be read ({reason}); give a readable file") from error
    if not content.strip():
        raise BadInput(f"{path}: the {what} is empty; write one into the file")
    if len(content) > _MOST_BYTES:
        raise BadInput(f"{path}: this is no {what}: it has more than {_MOST_BYTES} bytes")
    if mode & stat.S_IROTH:
        log.warning("%s: every user of this machine can read the %s; chmod 600 helps", path, what)
    return content
