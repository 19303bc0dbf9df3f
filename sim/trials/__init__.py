"""Trials: planners searched over many priors, measured, and set beside the paper and beside what is possible.

A *campaign* (`campaign`) is a list of jobs; a job is one search, one detection curve or one bound, and depends on
nothing but the campaign's settings and its own name (`trial`), so jobs run anywhere and in any order (`pool`) and
are written down one by one (`journal`). What was written is then counted (`summary`), compared with what the
paper claims (`claims`), drawn (`figures`) and told (`report`).
"""
