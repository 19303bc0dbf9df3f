"""Compiled loops of `roisearch.bounds.pursuing`: filtering forth and back through layers, and the best path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roisearch.kernels.records import Floats, Ints
from roisearch.kernels.walking import Map, Room, tick

Cube = NDArray[np.float64]
Choices = NDArray[np.int8]
DOWN, RIGHT = (-1, 0, 1, 0, -1, 1, 1, -1), (0, 1, 0, -1, 1, 1, -1, -1)
"""Moves, the four straight ones first."""


class Layers(NamedTuple):
    """The moments at which looks may be made, in order; one step of the searcher may have two, around a tick.

    step: int [n], the step that a layer belongs to, from 0 on, rising. ticks: int [n], of the walk before it. gain:
    float [n], what a unit of probability that is found in it counts, never rising. into: float [rows + 2, cols + 2],
    and stops: see `roisearch.kernels.walking`. p_tp: of a look. diagonal: whether the searcher moves to eight
    neighbours and may wait; else to four, and never waits.
    """

    step: Ints
    ticks: Ints
    gain: Floats
    into: Map
    stops: float
    p_tp: float
    diagonal: bool


@njit(cache=True, nogil=True)
def filtered(guess: Map, walks: Floats, stopped: Floats, layers: Layers, before: Cube) -> float:
    """What looks that are made with the chance `guess`, float [n, cells], find, each find counted by its layer's gain.

    `walks` and `stopped` [cells] are the mass at the beginning; they are not changed. `before` [2, n, cells] receives
    what is undetected before each layer's looks, of who walks and of who has stopped; [2, 0, 0]: it is not asked for.
    """
    shape = layers.into.shape
    room, still = Room(np.zeros(shape), np.zeros(shape)), stopped.copy()
    rows, cols = shape[0] - 2, shape[1] - 2
    room.now[1:-1, 1:-1] = walks.reshape(rows, cols)
    total = 0.0
    for n in range(layers.step.size):
        for _ in range(layers.ticks[n]):
            tick(still, layers.into, layers.stops, room)
            room = Room(room.then, room.now)
        if before.size > 0:
            before[0, n] = room.now[1:-1, 1:-1].copy().reshape(rows * cols)
            before[1, n] = still
        for row in range(rows):
            for col in range(cols):
                cell = row * cols + col
                if guess[n, cell] > 0.0:
                    left = 1.0 - layers.p_tp * guess[n, cell]
                    total += layers.gain[n] * (room.now[row + 1, col + 1] + still[cell]) * (1.0 - left)
                    room.now[row + 1, col + 1] *= left
                    still[cell] *= left
    return total


@njit(cache=True, nogil=True)
def slopes(guess: Map, before: Cube, layers: Layers) -> None:
    """What a look in each layer and cell counts in the bound for `guess`, [n, cells], to `before[0]` of `filtered`."""
    shape = layers.into.shape
    rows, cols = shape[0] - 2, shape[1] - 2
    later, room = np.zeros(shape), np.zeros(shape)  # what is found later of a target that walks, where it is
    rests = np.zeros(shape)  # and of one that has stopped
    for n in range(layers.step.size - 1, -1, -1):
        gain = layers.gain[n]
        for row in range(rows):
            for col in range(cols):
                cell = row * cols + col
                left = 1.0 - layers.p_tp * guess[n, cell]
                walks, stays = later[row + 1, col + 1], rests[row + 1, col + 1]
                more = before[0, n, cell] * (gain - walks) + before[1, n, cell] * (gain - stays)
                before[0, n, cell] = layers.p_tp * left * more
                later[row + 1, col + 1] = (1.0 - left) * gain + left * walks
                rests[row + 1, col + 1] = (1.0 - left) * gain + left * stays
        for _ in range(layers.ticks[n]):
            _tick_back(later, rests, layers, room)
            later, room = room, later


@njit(cache=True, nogil=True)
def _tick_back(later: Map, rests: Map, layers: Layers, room: Map) -> None:
    """One tick backwards, to `room`: what is found later of a target that is yet to step."""
    into, stops = layers.into, layers.stops
    for row in range(1, into.shape[0] - 1):
        for col in range(1, into.shape[1] - 1):
            stays, total = 1.0, 0.0
            if into[row, col] > 0.0:
                for down, right in ((-1, 0), (0, -1), (0, 1), (1, 0)):
                    chance, there = into[row + down, col + right], later[row + down, col + right]
                    stays -= chance
                    total += chance * (there + stops * (rests[row + down, col + right] - there))
            here = later[row, col]
            room[row, col] = total + stays * (here + stops * (rests[row, col] - here))


@njit(cache=True, nogil=True)
def linear(guess: Map, walks: Floats, stopped: Floats, layers: Layers, before: Cube) -> float:
    """The constant of the bound for `guess`; what a look counts comes to `before[0]`, [n, cells]. See `pursuing`."""
    constant = filtered(guess, walks, stopped, layers, before)
    slopes(guess, before, layers)
    for n in range(guess.shape[0]):
        for cell in range(guess.shape[1]):
            left = 1.0 - layers.p_tp * guess[n, cell]
            if guess[n, cell] > 0.0 and left > 0.0:
                constant -= guess[n, cell] * (1.0 - layers.p_tp) / left * before[0, n, cell]
    return constant


@njit(cache=True, nogil=True)
def limit_from(
    mass: Map, place: int, first: int, guess: Map, layers: Layers, before: Cube, choice: Choices
) -> float:
    """What no flight can add that has looked at the cell `place` in the layer before `first`, one layer a step.

    mass: float [2, cells], who is undetected after that look, walking and stopped. `before` [2, n, cells] and
    `choice` [n, cells] are room.
    """
    rest = Layers(
        layers.step[first:] - first, layers.ticks[first:], layers.gain[first:], layers.into, layers.stops,
        layers.p_tp, layers.diagonal,
    )  # fmt: skip
    n = rest.step.size
    if n == 0:
        return 0.0
    path = np.zeros(n, dtype=np.int64)
    least: float = rest.gain[0] * (mass[0].sum() + mass[1].sum())
    for part in (0.0, 1.0):
        constant = linear(part * guess[first:], mass[0], mass[1], rest, before[:, :n])
        least = min(least, constant + best_path(before[0, :n], place, rest, choice[:n], path))
    return least


@njit(cache=True, nogil=True)
def walked_on(mass: Map, ticks: int, layers: Layers) -> None:
    """Let those of `mass`, float [2, cells], walking and stopped, walk for some ticks."""
    shape = layers.into.shape
    room = Room(np.zeros(shape), np.zeros(shape))
    room.now[1:-1, 1:-1] = mass[0].reshape(shape[0] - 2, shape[1] - 2)
    for _ in range(ticks):
        tick(mass[1], layers.into, layers.stops, room)
        room = Room(room.then, room.now)
    mass[0] = room.now[1:-1, 1:-1].copy().reshape(mass.shape[1])


@njit(cache=True, nogil=True)
def best_path(worth: Map, start: int, layers: Layers, choice: Choices, path: Ints) -> float:
    """The most that looks of `worth`, float [n, cells], add up to on a path from the cell `start`.

    `path` [n] receives the cell that is looked at in each layer, -1 for none; `choice` [steps, cells] is room.
    """
    cols = layers.into.shape[1] - 2
    rows = layers.into.shape[0] - 2
    moves = 8 if layers.diagonal else 4
    value, other, gain = np.zeros(rows * cols), np.zeros(rows * cols), np.zeros(rows * cols)
    n = layers.step.size
    for step in range(choice.shape[0] - 1, -1, -1):
        gain[:] = -np.inf
        while n > 0 and layers.step[n - 1] == step:
            n -= 1
            np.maximum(gain, worth[n], gain)
        gain += value
        for row in range(rows):
            for col in range(cols):
                cell = row * cols + col
                best, chosen = value[cell] if layers.diagonal else -np.inf, -1
                for move in range(moves):
                    r, c = row + DOWN[move], col + RIGHT[move]
                    if 0 <= r < rows and 0 <= c < cols and gain[r * cols + c] > best:
                        best, chosen = gain[r * cols + c], move
                other[cell], choice[step, cell] = best, chosen
        value, other = other, value
    _follow(worth, start, layers, choice, path)
    most: float = value[start]
    return most


@njit(cache=True, nogil=True)
def _follow(worth: Map, start: int, layers: Layers, choice: Choices, path: Ints) -> None:
    """The path that `choice` tells."""
    cols, cell, n = layers.into.shape[1] - 2, start, 0
    path[:] = -1
    for step in range(choice.shape[0]):
        move = choice[step, cell]
        if move >= 0:
            cell += DOWN[move] * cols + RIGHT[move]
        best = n
        while n < layers.step.size and layers.step[n] == step:
            best = n if worth[n, cell] > worth[best, cell] else best
            n += 1
        if move >= 0:
            path[best] = cell
