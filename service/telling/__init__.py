"""Telling others what a search sees: a webhook, MQTT topics, and the map of a TAK team.

All of it runs in the door process (`service.border`), asks the flight for nothing but its state (and, for a TAK team,
its map), at a price that the flight bounds, and sends what is new in that. A receiver that is slow, away or hostile can
keep only its own queue waiting; the flight does not know that it exists. What is told has an id, the same after a
restart of that process, so that a receiver can drop what it knows already.
"""

from service.telling.settings import TellingPlan, read_plan
from service.telling.telling import Telling

__all__ = ["Telling", "TellingPlan", "read_plan"]
