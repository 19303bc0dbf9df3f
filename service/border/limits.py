"""How much may be under way over the border at a time; the doors keep to it, and the flight insists on it."""

MOST_FRAMES = 4
"""Frames with reports that the doors send before the first is answered."""
MOST_IN_A_FRAME = 64
MOST_TEXT = 1 << 18
"""Characters of reports in a frame, unless a single one has more."""
MOST_ORDERS = 64
"""As many as the door lets in: half of them only such that stop the aircraft."""
MOST_NEWS = 4
MOST_ROWS = 2000
"""Of a track, hits or curve in one answer; the rest comes with the next."""
