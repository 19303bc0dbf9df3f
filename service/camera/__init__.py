"""The camera as geometry: what a frame shows of the ground, how well, and where on the ground a pixel lies.

Pure: poses and arrays in, cells and likelihoods out. Points are (east, south, up) in metres in the grid's own axes
(`GridFrame.to_metres`), up from the launch point.
"""

from service.camera.detect import Detectability
from service.camera.ground import Flat, Ground
from service.camera.locate import Errors, Spot, locate_pixel, spread
from service.camera.look import Looks, look_at_cells
from service.camera.optics import Pinhole, Sight, rotation, sight_from
from service.camera.terrain import Terrain, terrain_of

__all__ = [
    "Detectability",
    "Errors",
    "Flat",
    "Ground",
    "Looks",
    "Pinhole",
    "Sight",
    "Spot",
    "Terrain",
    "locate_pixel",
    "look_at_cells",
    "rotation",
    "sight_from",
    "spread",
    "terrain_of",
]
