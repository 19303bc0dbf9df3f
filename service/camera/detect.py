"""How well the detector finds a target that a frame shows: by how many pixels the target has.

A target of size s at slant range r, seen at the grazing angle g, has about n = f * s * sqrt(sin g) / r pixels a side
(f the focal length in pixels; sqrt(sin g) is the mean foreshortening of what lies on the ground). The chance to find
it follows the target transfer probability function of the Johnson criteria, t(n) = x^E / (1 + x^E) with
x = n / n50 and E = 2.7 + 0.7 x (Leachtenauer 2003), scaled so that in the middle of the image, from the height of
the search, it is the p_tp that was measured for the detector, and never more than that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from service.camera.optics import Floats


@dataclass(frozen=True)
class Detectability:
    """p_tp by pixels on target: `half_px` pixels a side are found half as often as many pixels are, `nominal_px`
    and more with `p_tp`; less than `floor` counts as not looked at."""

    p_tp: float
    size_m: float
    half_px: float
    nominal_px: float
    floor: float

    def pixels(self, focal_px: float, range_m: Floats, sin_grazing: Floats) -> Floats:
        """Pixels a side of the target, float [k]."""
        sin = np.clip(sin_grazing, 0.0, 1.0)
        n: Floats = focal_px * self.size_m * np.sqrt(sin) / np.maximum(range_m, 1e-6)
        return n

    def chance(self, pixels: Floats) -> Floats:
        """p_tp of targets with so many pixels a side, float [k]; 0 below the floor."""
        p = self.p_tp * np.minimum(1.0, self._transfer(pixels) / self._transfer(np.array(self.nominal_px)))
        return np.where(p >= self.floor, p, 0.0)

    def _transfer(self, pixels: Floats) -> Floats:
        x = np.clip(pixels / self.half_px, 0.0, 20.0)
        power = x ** (2.7 + 0.7 * x)
        t: Floats = power / (1.0 + power)
        return t
