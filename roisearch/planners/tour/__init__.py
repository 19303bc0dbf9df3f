"""`puct-regions-lite` in seconds, with a motion: a tour of looks, begun with sweeps of regions and annealed.

There is no tree: what the tree of the default in steps finds by simulating, changes to the tour find here, each priced
in constant time. `tour` says how a tour is priced, `anneal` how it is changed, `starts` how it begins, `desk` keeps it,
and `planner` flies it.
"""
