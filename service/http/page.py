"""The page and its parts, as they lie in `service/page`, and what they may do in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from starlette.responses import Response
from starlette.staticfiles import StaticFiles

FOLDER = Path(__file__).parents[1] / "page"


PICTURE_HEADERS = {
    "content-security-policy": "default-src 'none'; sandbox",
    "content-disposition": "inline",
    "cache-control": "private, max-age=86400, immutable",
}
"""A stranger's picture is shown and nothing else: whatever is in it, no browser runs it."""


class PageFiles(StaticFiles):
    """The page's files; a browser keeps them, and asks each time whether they are still the same."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        """A file, or 304."""
        response = super().file_response(*args, **kwargs)
        response.headers["cache-control"] = "no-cache"
        return response


def policy(tiles_from: str = "") -> str:
    """A Content-Security-Policy (level 3): the page runs its own scripts and nobody else's, inline neither."""
    return "; ".join(
        (
            "default-src 'none'",
            "script-src 'self'",
            "style-src 'self'",
            f"img-src 'self' blob: data: {tiles_from}".rstrip(),
            "connect-src 'self'",
            "frame-ancestors 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
