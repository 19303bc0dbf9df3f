"""States of a search, as those who are told see them."""

from __future__ import annotations

from typing import Any, cast

from service.view.state import RunState


def suspect(lat: float = 47.05, lon: float = 8.3, **more: Any) -> dict[str, Any]:
    return {
        "lat": lat,
        "lon": lon,
        "probability": 0.6,
        "thumbnail": None,
        "hits": 2,
        "written": f"{lat:.4f}, {lon:.4f}",
        **more,
    }


def found(lat: float = 47.05, lon: float = 8.3, probability: float = 0.99995) -> dict[str, Any]:
    ellipse = {"semi_major_m": 7.2, "semi_minor_m": 5.0, "bearing_deg": 30.0}
    about = {"sigma_m": 3.0, "ellipse": ellipse, "thumbnail": None}
    return {"lat": lat, "lon": lon, "probability": probability, "written": "32T MT 46916 11171", **about}


def state(**changed: Any) -> RunState:
    """The part of a state that tellers read."""
    pose = {
        "lat": 47.0501,
        "lon": 8.3001,
        "written": "47.0501, 8.3001",
        "height_m": 30.0,
        "heading_deg": 350.0,
    }
    return cast(
        RunState,
        {
            "state": "SEARCHING",
            "why": "",
            "area": "field <&>",
            "pos": 0.25,
            "outside": 0.0,
            "steps": 3,
            "flight_time_s": 4.2,
            "battery_percent": 91.0,
            "pose": pose,
            "place": {"lat": 47.05, "lon": 8.3, "probability": 0.1, "written": "47.0500, 8.3000"},
            "suspects": [],
            "found": None,
            "aircraft": [],
            **changed,
        },
    )


def two_aircraft(**changed: Any) -> RunState:
    """The same of a search that two aircraft fly, of which the second has been nowhere yet."""
    pose = state()["pose"]
    north = {"name": "north", "state": "SEARCHING", "why": "", "pose": pose, "battery": 81.0}
    south = {"name": "south", "state": "WAITING", "why": "", "pose": None, "battery": None}
    return state(aircraft=[north, south], **changed)
