"""The words that `roisearch-service` takes instead of flying: one module each, imported when its word is given.

A module has `main(arguments: list[str]) -> int`, which returns the exit code, and may raise BadInput.
"""

COMMANDS = {
    "area": "what is understood of an area file of any kind",
    "plan": "draw an area on the page, save it, start its search",
    "preview": "what a search of an area will be like, before flying",
    "export": "a run as geojson, kml, gpx, geotiff, plan, csv or html",
    "config": "check or show settings",
    "pack": "a run as one file, for --resume on another computer",
    "replay": "show a run that is over on the page",
    "schema": "the JSON Schema of a detector report",
    "calibrate": "what a detector is worth, from scored frames",
    "detector": "watch a camera, and report what it shows",
}
"""Each word with what it does, for the help."""
