"""Errors that a person can act on."""

from __future__ import annotations

import argparse
from typing import NoReturn


class BadInput(ValueError):
    """What the operator gave cannot be used.

    The message is one sentence: what is wrong, where (file, feature, value), and what
    would be right. The command line prints it as it is and exits with code 2.
    """


class Parser(argparse.ArgumentParser):
    """The flags of a command: what is wrong with them is one sentence, as every refusal is."""

    def error(self, message: str) -> NoReturn:
        """Say it, and end with exit code 2."""
        self.exit(2, f"{self.prog}: {message}; {self.prog} --help tells more\n")


def shown(value: object, most: int = 120) -> str:
    """A value as a sentence can hold it: a wrong one may be a whole file, as after an open quotation mark."""
    text = repr(value)
    return text if len(text) <= most else f"{text[: most - 1]}…"
