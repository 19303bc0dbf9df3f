"""The search itself: belief, regions, planners. Pure: arrays in, decisions out."""
