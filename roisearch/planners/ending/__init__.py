"""The end of a battery: what can be found before the way home must begin, and on it."""

from roisearch.planners.ending.planner import EndingPlanner

__all__ = ["EndingPlanner"]
