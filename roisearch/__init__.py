"""The search itself: belief, regions, planners. Pure: arrays in, decisions out.

from roisearch import Belief, FieldOfView, SearchState, make_planner

belief = Belief(prior, outside=0.05)
planner = make_planner("puct-regions-lite", fov=FieldOfView.point())
decision = planner.plan(belief, SearchState(cell=(5, 5)), numpy.random.default_rng(1))
belief.observe([decision.path[0]], [False], p_tp=0.9, p_tn=0.9)
"""

from roisearch.belief import Belief
from roisearch.decision import Alternative, Decision, Effort, SearchState
from roisearch.fleet import Fleet
from roisearch.fov import FieldOfView
from roisearch.motion import Motion
from roisearch.planners.base import Planner
from roisearch.planners.own import BasePlanner
from roisearch.regions import Regions, segment_regions
from roisearch.registry import PLANNERS, make_planner
from roisearch.walk import Walk

__all__ = [
    "PLANNERS",
    "Alternative",
    "BasePlanner",
    "Belief",
    "Decision",
    "Effort",
    "FieldOfView",
    "Fleet",
    "Motion",
    "Planner",
    "Regions",
    "SearchState",
    "Walk",
    "make_planner",
    "segment_regions",
]
