"""The words that `roisearch-service` takes instead of flying: one module each, imported when its word is given.

A module has `main(arguments: list[str]) -> int`, which returns the exit code, and may raise BadInput.
"""

COMMANDS = {
    "preview": "what a search of an area will be like, before flying",
    "export": "a run as geojson, kml, gpx, geotiff, plan, csv or html",
    "config": "check or show settings",
    "replay": "show a run that is over on the page",
    "schema": "the JSON Schema of a detector report",
}
"""Each word with what it does, for the help."""
