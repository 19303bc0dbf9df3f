"""The client of an adapter: a report goes out until there is an answer, and its id is never counted twice."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import httpx

from service.adapters.frames import Frame, as_report
from service.errors import BadInput

AGAIN_S = 0.2
"""Between two trials of one report."""
_TIMEOUT_S = 5.0


class Gone(Exception):
    """The service has not answered for longer than the adapter has patience."""


class Door:
    """The service's public door, as a detector sees it."""

    def __init__(
        self,
        url: str,
        *,
        source: str,
        token: str = "",
        threshold: float | None = None,
        patience_s: float = 30.0,
        tell: Callable[[str], None] = print,
    ) -> None:
        """`threshold` is the score from which on the detector reports; `tell` is told of refusals, each reason once."""
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._client = httpx.Client(base_url=url, headers=headers, timeout=_TIMEOUT_S)
        self._url, self._source, self._threshold = url, source, threshold
        self._patience_s, self._tell = patience_s, tell
        self._prefix, self._count = uuid.uuid4().hex[:12], 0
        self._told: set[str] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close()

    def at(self, taken: float) -> float:
        """The service's own time when it was `taken` by this computer's clock, a moment ago; raises Gone, BadInput."""
        state = self._asked(lambda: self._client.get("/api/state")).json()
        return float(state["time"]) - (time.time() - taken) * float(state["speedup"])

    def send(self, frame: Frame) -> dict[str, Any]:
        """Report a frame, and return its receipt.

        Raises:
            Gone: no answer for `patience_s`.
            BadInput: the token is not right, or this is no service of ours.
        """
        self._count += 1
        report = as_report(frame, f"{self._prefix}-{self._count}", self._source, self._threshold)
        answer = self._asked(lambda: self._client.post("/api/reports", json=report))
        receipt = self._receipt(answer, report["id"])
        if receipt["status"] == "refused":
            self._tell_once(f"refused: {receipt['reason']}")
        return receipt

    def _receipt(self, answer: httpx.Response, name: str) -> dict[str, Any]:
        if answer.status_code == httpx.codes.UNPROCESSABLE_ENTITY:
            return {"id": name, "status": "refused", "reason": answer.text[:500], "looks": 0, "hits": 0}
        receipt: dict[str, Any] = answer.json()[0]
        return receipt

    def _asked(self, ask: Callable[[], httpx.Response]) -> httpx.Response:
        """An answer that means something; asked again while the service is away or busy."""
        deadline = time.monotonic() + self._patience_s
        while True:
            try:
                answer = ask()
                reason = f"it answers {answer.status_code}"
                if answer.status_code < 500 and answer.status_code != httpx.codes.TOO_MANY_REQUESTS:
                    return self._understood(answer)
            except httpx.TransportError as error:
                reason = str(error)
            if time.monotonic() > deadline:
                raise Gone(f"the service at {self._url} is gone ({reason})")
            time.sleep(AGAIN_S)

    def _understood(self, answer: httpx.Response) -> httpx.Response:
        if answer.status_code in (httpx.codes.UNAUTHORIZED, httpx.codes.FORBIDDEN):
            raise BadInput(f"{self._url} does not let us report; give its report token with --token-file")
        if answer.is_success or answer.status_code == httpx.codes.UNPROCESSABLE_ENTITY:
            return answer
        raise BadInput(
            f"{self._url} answers {answer.status_code} {answer.text[:120]!r}; give where roisearch-service listens"
        )

    def _tell_once(self, words: str) -> None:
        if words not in self._told and len(self._told) < 1000:
            self._told.add(words)
            self._tell(words)
