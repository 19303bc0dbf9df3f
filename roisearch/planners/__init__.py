"""The planners; `roisearch.registry` knows their names.

Two are rooms with compiled kernels of their own: `puct`, the paper's, and `lookahead`, the default. The others are one
file each and share the kernels in `roisearch.kernels`.
"""
