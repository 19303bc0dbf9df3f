"""The default planner: a plan of thousands of steps, kept from decision to decision and made better in between.

It is the lite MDP-O with options that sweep. The paper's are the model without a belief in the tree, with an option for
each region, and the choice among options by PUCT. Ours are that an option sweeps its region down to a level, that the
reward is expected time, and what is done with the plan between two steps: it is kept, challenged and annealed.

From the object inwards: `planner` (follows the belief along the plan), `settings`; `thinking` (what is
thought between two steps) with `challenge` and `anneal`; and the compiled kernels `plans` (PUCT over sweeps), `order`
(annealing), `sweeps` (the rule that options and rollouts follow) and `chart` (the map in thought); `desk` makes what
they work on.
"""
