"""The words that `roisearch-service` takes instead of flying: one module each, imported when its word is given.

A module has `main(arguments: list[str]) -> int`, which returns the exit code, and may raise BadInput.
"""

COMMANDS = {
    "config": "check or show settings",
    "replay": "show a run that is over on the page",
}
"""Each word with what it does, for the help."""
