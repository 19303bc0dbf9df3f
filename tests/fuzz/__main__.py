"""Coverage-guided fuzzing with atheris, for as long as one likes; not part of the tests.

    pip install atheris
    python -m tests.fuzz area -max_total_time=600

The first word names a target, the rest goes to libFuzzer. A crash leaves its input in a file crash-*.
"""

from __future__ import annotations

import sys

import atheris

with atheris.instrument_imports(include=["service", "pymavlink"]):
    from tests.fuzz.targets import TARGETS


def main() -> None:
    """Fuzz one target until something breaks."""
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f"usage: python -m tests.fuzz {{{','.join(TARGETS)}}} [libFuzzer options]")
    target = TARGETS[sys.argv.pop(1)]

    def once(data: bytes) -> None:
        target(data)

    atheris.Setup(sys.argv, once)
    atheris.Fuzz()


main()
