"""Examples of what goes in and out of the door, for its description."""

from __future__ import annotations

from typing import Any

COMMANDS: dict[str, Any] = {
    "hold": {"summary": "Hover", "value": {"command": "hold"}},
    "resume": {"summary": "Go on with the search", "value": {"command": "resume"}},
    "return": {"summary": "Fly home and land", "value": {"command": "return"}},
    "reject": {
        "summary": "What was seen there is not the target",
        "value": {"command": "reject", "lat": 56.609142, "lon": -4.739255},
    },
}


def answers(value: Any) -> dict[int | str, dict[str, Any]]:
    """An example of a good answer, as FastAPI's `responses` wants it."""
    return {200: {"content": {"application/json": {"example": value}}}}


RECEIPTS = answers([{"id": "cam-000117", "status": "accepted", "reason": "", "looks": 1, "hits": 0}])
ORDERED = answers({"state": "HOLDING"})
STATE = answers(
    {
        "state": "SEARCHING",
        "area": "Rannoch Moor",
        "time": 1771236124.1,
        "pos": 0.312,
        "place": {"lat": 56.60914, "lon": -4.73925, "probability": 0.21},
        "outside": 0.071,
        "steps": 63,
        "flight_time_s": 268.4,
        "flight_left_s": 1820.0,
        "battery_percent": 91.0,
        "mode": "AUTO_LOITER",
        "reason": "ROI 3: 12 % of the mass, 240 m, best rate",
        "pose": {
            "lat": 56.60871,
            "lon": -4.74102,
            "height_m": 30.0,
            "heading_deg": 12.0,
            "time": 1771236124.0,
        },
        "footprint": {
            "counts": True,
            "covered": 1.0,
            "cells": [{"row": 4, "col": 9, "lat": 56.6087, "lon": -4.741}],
        },
        "reports": {"accepted": 531, "refused": 0},
        "link": {"up": True, "silent_s": 0.4, "received": 0.998},
        "detector": {"silent_s": 0.3, "silent": False},
        "regions": [0.28, 0.17, 0.12],
        "suspects": [{"lat": 56.60914, "lon": -4.73925, "probability": 0.21, "thumbnail": None, "hits": 1}],
        "found": None,
    }
)
MAP = answers(
    {
        "frame": {"rows": 2, "cols": 2, "cell_m": 25.0, "bearing_deg": 12.0},
        "corners": [[56.6105, -4.7453], [56.6101, -4.7375], [56.6066, -4.7383], [56.6071, -4.7462]],
        "probability": [[0.31, None], [0.22, 0.40]],
        "pod": [[0.9, None], [0.0, 0.99]],
        "regions": [[1, 0], [0, 0]],
        "outside": 0.07,
        "reports": 531,
    }
)
DECISIONS = answers(
    [
        {
            "time": 1771236121.0,
            "action": "region 3",
            "path": [[4, 9], [4, 10]],
            "reason": "ROI 3: 12 % of the mass, 240 m, best rate",
            "options": [
                {
                    "action": "region 3",
                    "region": 3,
                    "visits": 41,
                    "value": -118.2,
                    "mass": 0.12,
                    "distance_m": 240.0,
                    "chosen": True,
                    "words": "ROI 3: 12 % of the mass, 240 m, best rate",
                }
            ],
        }
    ]
)
REPLAY = answers({"from": 1771235800.0, "to": 1771237310.5})
