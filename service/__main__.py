"""`roisearch-service`: see `service.cli`."""

import faulthandler
import sys


def main() -> int:
    """Run the command line and return its exit code."""
    from service.cli import main as run

    if sys.stderr is not None:
        faulthandler.enable()  # should a library end the process, its log says where

    return run()


if __name__ == "__main__":
    sys.exit(main())
