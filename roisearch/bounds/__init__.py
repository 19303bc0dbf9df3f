"""What no searcher can beat, so that a planner can be judged in 'x % above the bound'.

`counting` counts looks and when they can be made: teleport, release and multi-cell bounds of the whole detection
curve. `seconds` is the release bound over time, for a motion that turns and speeds up. `travelling` counts the ways
between hills too, for the expected time alone, and `flying` does so in seconds. `optimum` is the best there is, on tiny
maps. `together` is the release bound of several searchers. `pursuing` is about a target that walks: the bound, and the
best there is on tiny maps.
"""

from roisearch.bounds.counting import (
    Footprints,
    expected_time,
    multi_cell,
    new_cells,
    quantiles,
    release,
    teleport,
    teleport_reference,
)
from roisearch.bounds.flying import travel_seconds
from roisearch.bounds.optimum import least_expected_time
from roisearch.bounds.pursuing import BestFlight, Hunt, PursuitBound, best_flight, pursuit
from roisearch.bounds.seconds import expected_seconds, release_seconds
from roisearch.bounds.together import Start, release_together
from roisearch.bounds.travelling import TravelBound, travel

__all__ = [
    "BestFlight",
    "Footprints",
    "Hunt",
    "PursuitBound",
    "Start",
    "TravelBound",
    "best_flight",
    "expected_seconds",
    "expected_time",
    "least_expected_time",
    "multi_cell",
    "new_cells",
    "pursuit",
    "quantiles",
    "release",
    "release_seconds",
    "release_together",
    "teleport",
    "teleport_reference",
    "travel",
    "travel_seconds",
]
