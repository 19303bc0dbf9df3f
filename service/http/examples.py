"""Examples of what goes in and out of the door, for its description."""

from __future__ import annotations

from typing import Any

COMMANDS: dict[str, Any] = {
    "hold": {"summary": "Hover", "value": {"command": "hold"}},
    "resume": {"summary": "Go on with the search", "value": {"command": "resume"}},
    "return": {"summary": "Fly home and land", "value": {"command": "return"}},
    "replace": {
        "summary": "On the ground between two sorties: another aircraft flies the next one",
        "value": {"command": "replace", "system_id": 7},
    },
    "one of several": {
        "summary": "Hover, one of several aircraft",
        "value": {"command": "hold", "aircraft": "2"},
    },
    "reject": {
        "summary": "What was seen there is not the target",
        "value": {"command": "reject", "lat": 56.609142, "lon": -4.739255},
    },
}


Responses = dict[int | str, dict[str, Any]]
ANY = (401, 403, 421, 429, 500, 503)
POSTED = (400, 408, 409, 413, 415)
PAST = (404,)
WHY = {
    400: "the connection ended within the body, or Content-Length is no number",
    401: "a bearer token is needed, or this is none of ours",
    403: "this token does not open this, or a page of another site asks",
    404: "`at` of a run that is live, as only a replay has other times; or there is no such picture",
    408: "the body did not come in time (http.body_timeout_s)",
    409: "this is a replay: it takes neither reports nor orders",
    413: "the body is too long, or the batch (http.max_body_bytes, http.max_batch)",
    415: "a body is JSON: send Content-Type: application/json",
    421: "the Host is not a name of this service (http.allowed_hosts)",
    429: "more than allowed a second; Retry-After says how long to wait",
    500: "internal error",
    503: "the journal cannot be written, the flight does not answer, or too many such requests are under way",
}
"""What a refusal means, by its status. Its body is {"detail": "a sentence"}."""


def refusals(*codes: int) -> Responses:
    """What a route may refuse, as FastAPI's `responses` wants it."""
    detail = {"type": "object", "properties": {"detail": {"type": "string"}}, "required": ["detail"]}
    content = {"application/json": {"schema": detail}}
    return {code: {"description": WHY[code], "content": content} for code in sorted({*ANY, *codes})}


def answers(value: Any, *codes: int) -> Responses:
    """An example of a good answer, and what may be refused beside what every route may."""
    return {200: {"content": {"application/json": {"example": value}}}, **refusals(*codes)}


RECEIPTS = answers([{"id": "cam-000117", "status": "accepted", "reason": "", "looks": 1, "hits": 0}], *POSTED)
ORDERED = answers({"state": "HOLDING"}, *POSTED)
HEARD = answers({"id": "news-1", "status": "accepted", "cells": 37, "notes": []}, *POSTED)
STATE = answers(
    {
        "state": "SEARCHING",
        "words": "Searching",
        "next": {
            "words": "Next: the burn, 240 m, 12 %",
            "name": "the burn",
            "distance_m": 240.0,
            "probability": 0.12,
        },
        "area": "Rannoch Moor",
        "time": 1771236124.1,
        "pos": 0.312,
        "place": {"lat": 56.60914, "lon": -4.73925, "probability": 0.21, "written": "56.609140, -4.739250"},
        "outside": 0.071,
        "steps": 63,
        "flight_time_s": 268.4,
        "sorties": [],
        "news": [],
        "flight_left_s": 1820.0,
        "battery_percent": 91.0,
        "battery_doubt": None,
        "battery": {"voltage_v": 16.1, "current_a": 11.8, "consumed_mah": 420.0},
        "mode": "AUTO_LOITER",
        "reason": "ROI 3: 12 % of the mass, 240 m, best rate",
        "pose": {
            "lat": 56.60871,
            "lon": -4.74102,
            "written": "56.608710, -4.741020",
            "height_m": 30.0,
            "heading_deg": 12.0,
            "time": 1771236124.0,
        },
        "height_above_ground_m": 29.2,
        "wind": {"speed_mps": 4.1, "from_deg": 250.0},
        "footprint": {
            "counts": True,
            "covered": 1.0,
            "cells": [{"row": 4, "col": 9, "lat": 56.6087, "lon": -4.741}],
        },
        "reports": {
            "accepted": 531,
            "refused": 2,
            "refused_in_a_row": 0,
            "last_refusal": "cam0: a detection at 8.304710, 47.054120 lies 5664 km from what its frame shows; are lat "
            "and lon swapped?",
            "without_look": None,
            "doubt": None,
            "clock": None,
        },
        "link": {"up": True, "silent_s": 0.4, "received": 0.998, "round_trip_s": 0.12},
        "detector": {"silent_s": 0.3, "silent": False},
        "regions": [0.28, 0.17, 0.12],
        "drawn": {"number": 1, "words": "region 3 (open ground in the north) appeared"},
        "unseen": [],
        "suspects": [
            {
                "lat": 56.60914,
                "lon": -4.73925,
                "probability": 0.21,
                "written": "56.609140, -4.739250",
                "thumbnail": None,
                "hits": 1,
                "score": 0.83,
            }
        ],
        "found": None,
        "aircraft": [
            {
                "name": "1",
                "colour": 0,
                "state": "SEARCHING",
                "lat": 56.60871,
                "lon": -4.74102,
                "height": 30.0,
                "heading_deg": 12.0,
                "battery": 91.0,
                "mode": "AUTO_LOITER",
            }
        ],
    },
    *PAST,
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
    },
    *PAST,
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
    ],
    *PAST,
)
REPLAY = answers({"from": 1771235800.0, "to": 1771237310.5}, *PAST)
WRITTEN = answers({"written": "30U VF 33207 74023"})
JPEG: Responses = {200: {"content": {"image/jpeg": {}}}, **refusals(*PAST)}
PICTURE: Responses = {200: {"content": {"image/png": {}}}, **refusals(*PAST)}
