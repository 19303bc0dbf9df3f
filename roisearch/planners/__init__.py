"""The planners, one a file; `roisearch.registry` knows their names."""
