"""Who may do what: bearer tokens and their scopes.

A token is kept as its SHA-256 digest from the moment it is read, so nothing that prints, logs or stores one of
these objects can give a token away, and comparing digests in constant time says nothing about its length.
"""

from __future__ import annotations

import enum
import hashlib
import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass

from service.config import HttpSettings
from service.errors import BadInput
from service.secret_file import read_secret

COMMAND_VARIABLE = "ROISEARCH_HTTP_TOKEN"
REPORT_VARIABLE = "ROISEARCH_HTTP_REPORT_TOKEN"
VIEW_VARIABLE = "ROISEARCH_HTTP_VIEW_TOKEN"
LEAST_CHARACTERS = 16


class Scope(enum.Enum):
    """What a token opens."""

    REPORT = "report"
    """POST /api/reports, and everything that VIEW opens."""
    VIEW = "view"
    """All there is to see: the page without its orders."""
    COMMAND = "command"
    """Everything."""


@dataclass(frozen=True)
class Access:
    """The tokens of a door, as pairs of SHA-256 digest and scope; none: everybody on this machine is trusted."""

    keys: tuple[tuple[bytes, Scope], ...] = ()

    @property
    def needed(self) -> bool:
        """Whether a request needs a token."""
        return bool(self.keys)

    def scope_of(self, authorization: str) -> Scope | None:
        """The scope that the value of an Authorization header opens (RFC 6750, 2.1), or None.

        Takes the same time whichever token it is compared with, and wherever it differs.
        """
        scheme, _, token = authorization.partition(" ")
        given = _digest(token.strip().encode("utf-8", "surrogateescape"))
        found: Scope | None = None
        for digest, scope in self.keys:
            if hmac.compare_digest(digest, given):
                found = scope
        return found if scheme.lower() == "bearer" else None

    def with_guest(self) -> tuple[Access, str]:
        """This access and one more report token, for a detector that the service starts itself.

        The token is empty where none is needed.
        """
        if not self.needed:
            return self, ""
        token = secrets.token_urlsafe(32)
        return Access((*self.keys, (_digest(token.encode()), Scope.REPORT))), token


def read_access(http: HttpSettings, environment: Mapping[str, str], *, loopback: bool) -> Access:
    """The tokens that the settings and the environment give; a file comes before a variable.

    Args:
        environment: ROISEARCH_HTTP_TOKEN, ROISEARCH_HTTP_REPORT_TOKEN and ROISEARCH_HTTP_VIEW_TOKEN may hold tokens.
        loopback: whether only this machine can reach the door.

    Raises:
        BadInput: a token cannot be read or is too weak, or none is given and the door is not on loopback.
    """
    command = _read(http.token_file, COMMAND_VARIABLE, environment)
    report = _read(http.report_token_file, REPORT_VARIABLE, environment)
    if not command and not loopback:
        raise BadInput(
            f"listening on {http.listen} needs a token: name a file with one as http.token_file, "
            f"or set {COMMAND_VARIABLE}"
        )
    view = _read(http.view_token_file, VIEW_VARIABLE, environment)
    named = {Scope.COMMAND: command, Scope.REPORT: report, Scope.VIEW: view}
    keys = [(digest, scope) for scope, digest in named.items() if digest]
    if keys and not command:
        raise BadInput(
            f"a {keys[0][1].value} token alone leaves nobody to give commands; name a file with a command token "
            f"as http.token_file, or set {COMMAND_VARIABLE}"
        )
    for number, (digest, scope) in enumerate(keys):
        for other, same in keys[:number]:
            if other == digest:
                raise BadInput(f"the {scope.value} token and the {same.value} token are the same; make two")
    return Access(tuple(keys))


def _read(path: str, variable: str, environment: Mapping[str, str]) -> bytes:
    """The digest of the token in a file or else in a variable; empty when there is neither."""
    if path:
        return _checked(read_secret(path, "token").strip(), path)
    if environment.get(variable, ""):
        return _checked(environment[variable].strip().encode("utf-8", "surrogateescape"), variable)
    return b""


def _checked(token: bytes, source: str) -> bytes:
    if len(token) < LEAST_CHARACTERS:
        raise BadInput(f"{source}: a token has at least {LEAST_CHARACTERS} characters")
    if any(not 0x21 <= character <= 0x7E for character in token):
        raise BadInput(f"{source}: a token is one line of ASCII letters, digits and signs, without spaces")
    return _digest(token)


def _digest(token: bytes) -> bytes:
    return hashlib.sha256(token).digest()
