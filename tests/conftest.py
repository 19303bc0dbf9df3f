"""What holds for all tests."""

import os

from hypothesis import settings

# A slow machine is not a wrong result; in CI the examples are the same every time.
settings.register_profile("here", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "here")
