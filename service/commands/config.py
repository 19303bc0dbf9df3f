"""`roisearch-service config`: is a settings file right, and which settings would a run have, from where?"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from pathlib import Path

from service.config import (
    KNOWN_KEYS,
    Settings,
    each_aircraft,
    file_problems,
    name_of,
    nearest_key,
    read_settings,
    read_toml,
    variable_name,
)
from service.errors import Parser
from service.toml_lines import key_lines

SECRETS = frozenset({"ROISEARCH_HTTP_TOKEN", "ROISEARCH_HTTP_REPORT_TOKEN", "ROISEARCH_TOKEN"})
"""Variables that are no settings: what they hold is in no file."""


def parser() -> argparse.ArgumentParser:
    """The words and flags."""
    p = Parser(
        prog="roisearch-service config",
        description="Check a settings file, or show what a run would be set to and where each value is from.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="examples:\n  roisearch-service config check service.toml\n  roisearch-service config show\n\n"
        "Flags of the search override environment variables, such as ROISEARCH_FLIGHT_ALTITUDE_M=40,\n"
        "and those override the file. exit codes: 0 right, 2 wrong",
    )
    words = p.add_subparsers(dest="word", required=True, metavar="check|show")
    check = words.add_parser("check", help="say what is wrong with a file, with line and key")
    check.add_argument("file", metavar="FILE", type=Path)
    show = words.add_parser("show", help="every setting with its value and source")
    show.add_argument("file", metavar="FILE", type=Path, nargs="?")
    return p


def main(arguments: list[str]) -> int:
    """Check or show; returns 0 when everything is right, else 2."""
    options = parser().parse_args(arguments)
    if options.file is not None and (wrong := file_problems(options.file)):
        for sentence in wrong:
            print(sentence, file=sys.stderr)
        return 2
    settings = read_settings(options.file)
    origin = sources(options.file, os.environ)
    changed = [key for key in KNOWN_KEYS if key in origin]
    if options.word == "check":
        from service.beforehand import refused

        wrong = [f"{origin.get(key, options.file)}: {sentence}" for key, sentence in refused(settings)]
        for sentence in wrong:
            print(sentence, file=sys.stderr)
        if wrong:
            return 2
    if options.word == "check":
        print(f"{options.file}: nothing is wrong; {len(changed)} of {len(KNOWN_KEYS)} settings are given")
    for key in KNOWN_KEYS if options.word == "show" else changed:
        print(f"  {key + ' = ' + _value(settings, key):44} {origin.get(key, 'default')}")
    for name, alone in each_aircraft(settings).items() if settings.aircraft else ():
        link, flight = alone.link.connect or "the built-in mock", alone.flight
        own = next(table for number, table in enumerate(settings.aircraft) if name_of(table, number) == name)
        sensor = "".join(f", {key} = {value!r}" for key, value in own.sensor.given.items())
        print(f"  aircraft '{name}': {link}, {flight.altitude_m:g} m high, {flight.speed_mps:g} m/s{sensor}")
    for name in unknown_variables(os.environ):
        near = nearest_key(name.removeprefix("ROISEARCH_").lower().replace("_", ".", 1))
        hint = f"; did you mean {variable_name(near)}?" if near else ""
        print(f"note: the environment variable {name} is no setting and does nothing{hint}", file=sys.stderr)
    return 0


def sources(file: Path | None, environment: Mapping[str, str]) -> dict[str, str]:
    """Where each setting that is not at its default comes from, in words."""
    origin: dict[str, str] = {}
    if file is not None:
        lines = key_lines(read_toml(file)[1])
        origin = {key: f"{file}:{lines[key]}" for key in KNOWN_KEYS if key in lines}
    for key in KNOWN_KEYS:
        if variable_name(key) in environment:
            origin[key] = f"environment variable {variable_name(key)}"
    return origin


def unknown_variables(environment: Mapping[str, str]) -> list[str]:
    """Variables that look like settings and are none."""
    known = {variable_name(key) for key in KNOWN_KEYS} | SECRETS
    return sorted(name for name in environment if name.startswith("ROISEARCH_") and name not in known)


def _value(settings: Settings, key: str) -> str:
    section, name = key.split(".")
    value = getattr(getattr(settings, section), name)
    return "not given" if value is None else repr(value)
