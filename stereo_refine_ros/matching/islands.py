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

"""Matched regions that are too small to be anything but chance."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.graph.disjoint_set import find, union
from stereo_refine_ros.matching.scratch import scratch
from stereo_refine_ros.matching.tuning import ISLANDS
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap

# Of a pixel; by as many a region's disparity may change from a pixel to the next.
_EIGHTHS = 8
_NONE = -(1 << 30)


def without_islands(disparity: FloatMap, threads: int = 1) -> FloatMap:
    """
    Drop matched regions of like disparity that are smaller than a part in ISLANDS.

    Parameters
    ----------
    disparity : float32 ndarray of shape (H, W)
        NaN where nothing matched. Neighbours belong together that differ by less than a pixel.
    threads : int
        Bands of rows side by side; the result does not depend on it.

    Returns
    -------
    float32 ndarray of shape (H, W)

    """
    height, width = disparity.shape
    out = np.empty_like(disparity)
    with scratch(12 * disparity.size) as memory:
        run, size, parent = memory.view(np.int32).reshape(3, height * width)
        run = run.reshape(height, width)
        run_bands(_label_kernel, height, threads, disparity, run, size, parent)
        _unite_kernel(disparity, run, size, parent)
        run_bands(_keep_kernel, height, threads, disparity, run, size, disparity.size // ISLANDS,
                  out)
    return out


@njit(cache=True, nogil=True)
def _label_kernel(start, stop, disparity, run, size, parent):
    """Join the runs of rows start..stop that touch, numbered from start * W on."""
    width = disparity.shape[1]
    steps = np.empty((2, width), np.int32)
    begins, contact = np.empty((2, width), np.uint8), np.empty((2, width), np.uint8)
    count = start * width
    for y in range(start, stop):
        here, above = steps[y & 1], steps[1 - (y & 1)]
        _quantise(disparity[y], here)
        first = count
        count = _runs(here, begins[y & 1], run[y], size, count)
        for i in range(first, count):
            parent[i] = i
        if y > start:
            _find_contacts(here, above, begins[y & 1], begins[1 - (y & 1)], contact[0],
                           contact[1])
            _join(contact[1], run[y], run[y - 1], size, parent)


@njit(cache=True, nogil=True)
def _unite_kernel(disparity, run, size, parent):
    """Join across the borders of bands, and give every run the size of its region."""
    height, width = disparity.shape
    here, above = np.empty((2, width), np.int32)
    contact, ones = np.empty((2, width), np.uint8), np.ones(width, np.uint8)
    for y in range(1, height):
        if run[y, 0] == y * width:  # the first of a band, or as good
            _quantise(disparity[y - 1], above)
            _quantise(disparity[y], here)
            _find_contacts(here, above, ones, ones, contact[0], contact[1])
            _join(contact[1], run[y], run[y - 1], size, parent)
    for y in range(height):
        for i in range(run[y, 0], run[y, width - 1] + 1):
            size[i] = size[find(parent, i)]


@njit(cache=True, nogil=True)
def _keep_kernel(start, stop, disparity, run, size, smallest, out):
    for y in range(start, stop):
        row, to, ids = disparity[y], out[y], run[y]
        for x in range(row.shape[0]):
            to[x] = row[x] if size[np.uintp(ids[x])] > smallest else np.float32(np.nan)


@njit(cache=True, nogil=True)
def _quantise(row, steps):
    for x in range(row.shape[0]):
        steps[x] = _NONE if np.isnan(row[x]) else np.int32(row[x] * np.float32(_EIGHTHS))


@njit(cache=True, nogil=True)
def _runs(here, begin, run, size, count):
    """Give the runs of a row, unmatched ones too, the numbers from `count` on; no branches."""
    width = here.shape[0]
    begin[0] = 1
    before, after, begins = here[:width - 1], here[1:], begin[1:]
    for x in range(width - 1):
        begins[x] = np.int32(abs(np.int32(after[x] - before[x]))) > np.int32(_EIGHTHS)
    number = np.intp(count - 1)
    for x in range(width):
        number += np.intp(begin[x])
        run[x] = number
        size[np.uintp(number)] = x + 1  # at last: where the run ends
    for i in range(number, count, -1):
        size[i] -= size[i - 1]
    return number + 1


@njit(cache=True, nogil=True)
def _find_contacts(here, above, begin, begin_above, touches, is_first):
    """Mark where a run begins to touch one of the row above."""
    none, most = np.int32(_NONE), np.int32(_EIGHTHS)
    for x in range(here.shape[0]):
        apart = np.int32(abs(np.int32(here[x] - above[x])))
        touches[x] = (here[x] != none) & (apart <= most)
    is_first[0] = touches[0]
    for x in range(1, here.shape[0]):
        is_first[x] = touches[x] & (begin[x] | begin_above[x] | (touches[x - 1] ^ np.uint8(1)))


@njit(cache=True, nogil=True)
def _join(is_first, run, run_above, size, parent):
    for x in range(is_first.shape[0]):
        if is_first[x]:
            a, b = find(parent, run[x]), find(parent, run_above[x])
            if a != b:
                union(parent, size, a, b)
