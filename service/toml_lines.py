"""On which line of a TOML file a key stands, whatever the spelling: tables, dotted keys, inline tables.

The parser of the standard library tells values and no lines. So the file is parsed again and again, a line longer
each time: a key stands on the lines by which it first appears. A settings file has some hundred lines.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from typing import Any

MOST_LINES = 2000


def key_lines(text: str) -> dict[str, int]:
    """The line of every key and table of a TOML text, by dotted name; raises nothing for what is no TOML."""
    found: dict[str, int] = {}
    lines = text.splitlines(keepends=True)
    if len(lines) > MOST_LINES:
        return {}
    begun = 1  # where the statement that is not whole yet began
    for number in range(1, len(lines) + 1):
        try:
            values = tomllib.loads("".join(lines[:number]))
        except tomllib.TOMLDecodeError:
            continue  # inside a value of several lines
        for name in _names(values):
            found.setdefault(name, begun)
        begun = number + 1
    return found


def _names(values: dict[str, Any], before: str = "") -> Iterator[str]:
    for key, value in values.items():
        yield before + key
        if isinstance(value, dict):
            yield from _names(value, f"{before}{key}.")
