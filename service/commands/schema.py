"""`roisearch-service schema`: the JSON Schema of a detector report, for who writes a detector."""

from __future__ import annotations

import argparse


def main(arguments: list[str]) -> int:
    """Print it."""
    argparse.ArgumentParser(prog="roisearch-service schema", description=__doc__).parse_args(arguments)
    from service.evidence.reports import schema_text

    print(schema_text(), end="")
    return 0
