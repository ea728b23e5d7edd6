# Copyright 2026 stereo_refine_ros contributors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The right view moved by a fraction of a row here and there: one pass, row by row."""

from __future__ import annotations

import math

from numba import njit
import numpy as np
from numpy.typing import NDArray

# Rows and columns that an interpolated pixel is made of (Lanczos, 3 lobes), and the steps of a
# pixel that it is interpolated at.
_TAPS, _STEPS = 6, 128
# The shift is taken as one over so many columns: at 0.2 degrees it is right to 0.03 px.
_COLUMNS_AT_ONCE = 16


def _lanczos() -> NDArray[np.float32]:
    """Return the weights of the samples around a position, float32 (steps, taps)."""
    distance = (np.arange(_STEPS)[:, None] / _STEPS - (np.arange(_TAPS) - (_TAPS // 2 - 1)))
    weights = np.sinc(distance) * np.sinc(distance / (_TAPS // 2))
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


_WEIGHTS = _lanczos()


@njit(cache=True, nogil=True)
def warp_rows(start, stop, image, terms, angle, out):
    """
    Write the rows start..stop of `out`: pixels moved by the row offset, then along the row.

    Parameters
    ----------
    start, stop : int
        Rows of this band.
    image : uint8 ndarray of shape (H, W, C)
        Where pixels come from.
    terms : float64 ndarray of shape (4,)
        Offset, tilt, stretch and twist, pixels.
    angle : float
        What the view is turned by, radian.
    out : uint8 ndarray of shape (H, W, C)
        Written.

    """
    height, width, channels = image.shape
    lines = image.reshape(height, width * channels)
    target = out.reshape(height, width * channels)
    margin = channels * (_TAPS + int(abs(angle) * height))
    padded = np.empty(width * channels + 2 * margin, np.float32)
    for y in range(start, stop):
        down = y / max(height - 1, 1) - 0.5
        at_centre = terms[0] + terms[2] * down
        slope = (terms[1] + terms[3] * down) / max(width - 1, 1)
        columns = _COLUMNS_AT_ONCE if slope != 0 else width
        for x in range(0, width, columns):
            end = min(x + columns, width)
            shift = at_centre + slope * 0.5 * (x + end - width)
            _blend_rows(lines, y + shift, x * channels, end * channels, padded, margin)
        _move_along(padded, margin, -angle * (y - 0.5 * (height - 1)), channels, target[y])


@njit(cache=True, nogil=True, fastmath={'contract'})
def _blend_rows(lines, position, begin, end, padded, margin):
    first, step = _first_and_step(position)
    last = len(lines) - 1
    a, b, c = (lines[min(max(first, 0), last), begin:end],
               lines[min(max(first + 1, 0), last), begin:end],
               lines[min(max(first + 2, 0), last), begin:end])
    d, e, f = (lines[min(max(first + 3, 0), last), begin:end],
               lines[min(max(first + 4, 0), last), begin:end],
               lines[min(max(first + 5, 0), last), begin:end])
    wa, wb, wc = _WEIGHTS[step, 0], _WEIGHTS[step, 1], _WEIGHTS[step, 2]
    wd, we, wf = _WEIGHTS[step, 3], _WEIGHTS[step, 4], _WEIGHTS[step, 5]
    to = padded[margin + begin:margin + end]
    for k in range(end - begin):
        to[k] = (wa * np.float32(a[k]) + wb * np.float32(b[k]) + wc * np.float32(c[k])
                 + wd * np.float32(d[k]) + we * np.float32(e[k]) + wf * np.float32(f[k]))


@njit(cache=True, nogil=True, fastmath={'contract'})
def _move_along(padded, margin, shift, channels, target):
    size = len(target)
    if shift == 0:
        line = padded[margin:]
        for k in range(size):
            target[k] = np.uint8(
                min(max(line[k] + np.float32(0.5), np.float32(0)), np.float32(255)))
        return
    for k in range(margin):
        padded[k] = padded[margin + k % channels]
        padded[margin + size + k] = padded[margin + size - channels + k % channels]
    first, step = _first_and_step(shift)
    first = margin + channels * first
    a, b, c = padded[first:], padded[first + channels:], padded[first + 2 * channels:]
    d, e, f = (padded[first + 3 * channels:], padded[first + 4 * channels:],
               padded[first + 5 * channels:])
    wa, wb, wc = _WEIGHTS[step, 0], _WEIGHTS[step, 1], _WEIGHTS[step, 2]
    wd, we, wf = _WEIGHTS[step, 3], _WEIGHTS[step, 4], _WEIGHTS[step, 5]
    for k in range(size):
        value = wa * a[k] + wb * b[k] + wc * c[k] + wd * d[k] + we * e[k] + wf * f[k]
        target[k] = np.uint8(min(max(value + np.float32(0.5), np.float32(0)), np.float32(255)))


@njit(cache=True, nogil=True)
def _first_and_step(position):
    """Return the first sample that a position is interpolated from, and its row of weights."""
    steps = int(math.floor(position * _STEPS + 0.5))
    return steps // _STEPS - (_TAPS // 2 - 1), steps % _STEPS
