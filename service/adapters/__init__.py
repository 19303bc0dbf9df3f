"""Programs that stand between a detector and the service: `roisearch-service detector KIND ...`, one module a kind.

An adapter is a program of its own. It speaks to the public door alone (POST /api/reports, and GET /api/state for the
service's time), so that it may as well run on another computer, and imports nothing else of the service but the
wording of its errors. Each kind has a module with `main(arguments: list[str]) -> int`; what all share is here in
`frames` (what a frame shows), `door` (the client), `options` (flags), `serve` (from frames to reports).
"""

KINDS = {
    "onnx": "any ONNX detector over RTSP, HTTP, a video file or a camera device",
    "folder": "the same over pictures that a camera writes into a folder",
    "ultralytics": "an Ultralytics model over whatever it can watch",
    "frigate": "events of Frigate, from its MQTT broker",
    "deepstream": "messages of NVIDIA DeepStream, from an MQTT broker or as lines",
}
"""Each kind with what it watches, for the help."""
