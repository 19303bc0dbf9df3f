"""`roisearch-sim`: the command line of the simulated world. Each command lives in its own module."""

from __future__ import annotations

import importlib
import sys
from importlib.metadata import version

from service.errors import BadInput

COMMANDS: dict[str, tuple[str, str]] = {
    # command: (module with main(arguments) -> exit code, one line of help)
    "ablation": ("sim.ablation", "what each part of the default planner is worth, above the bound"),
    "autopilot": ("sim.autopilot.cli", "a mock PX4 or ArduPilot on a real socket"),
    "bench": (
        "sim.bench",
        "the planner against its plain twin; 'bench intake': reports; 'bench autopilot': many mocks; "
        "'bench strangers': what the flight feels of attacks",
    ),
    "climbing": ("sim.climbing", "what it is worth that a plan knows how long climbs take"),
    "detector": ("sim.detector", "a simulated detector that follows the aircraft"),
    "flights": ("sim.flights", "whole searches with the real service, counted"),
    "soak": ("sim.soak.cli", "flights under random faults, with everything judged that must never happen"),
    "trials": ("sim.trials.cli", "planners over many priors: steps, detection curves, figures, report"),
}


def usage() -> str:
    """The help text: every command with its line."""
    rows = "\n".join(f"  {name:12} {line}" for name, (_, line) in COMMANDS.items())
    return f"usage: roisearch-sim COMMAND [OPTIONS]\n\ncommands:\n{rows}\n\n'roisearch-sim COMMAND --help' tells more."


def main(arguments: list[str] | None = None) -> int:
    """Run one command; 2 if it is unknown, or its input is bad."""
    words = sys.argv[1:] if arguments is None else arguments
    if not words or words[0] in ("-h", "--help"):
        print(usage())
        return 0 if words else 2
    if words[0] == "--version":
        print(f"roisearch {version('roisearch')}")
        return 0
    if words[0] not in COMMANDS:
        print(f"roisearch-sim: no command '{words[0]}'; one of: {', '.join(COMMANDS)}", file=sys.stderr)
        return 2
    module = importlib.import_module(COMMANDS[words[0]][0])
    try:
        code: int = module.main(words[1:])
    except BadInput as error:
        print(f"roisearch-sim {words[0]}: {error}", file=sys.stderr)
        return 2
    return code


if __name__ == "__main__":
    sys.exit(main())
