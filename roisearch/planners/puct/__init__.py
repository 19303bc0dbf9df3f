"""The paper's planner: PUCT over the flat MDP, the BMDP-O and the lite MDP-O.

From the object inwards: `planner` (plans, keeps a trip), `settings` and `presets`, and the compiled kernels `decide`
(one call a decision), `goals`, `search` (the algorithm, step by step), `rollouts`, and `records`, what they pass
around.
"""
