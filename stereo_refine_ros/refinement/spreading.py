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

"""Every pixel takes the disparity that the matched pixels around it agree on."""

from __future__ import annotations

from collections.abc import Sequence

from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.trees import similarity_table
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import FloatMap

# Colour change that a vote survives, in units of 255, and what each step leaves of it.
_SIGMA = 0.05
_FADE = 0.95
# Votes for disparities farther apart than this do not support each other at all, pixels.
_REACH = 4
# Disparities swept at once. Known to the compiler, so that every loop over them becomes a few
# vector instructions; and few, so that a part of the volume stays in the cache.
LANES = 32
# Images of more pixels have no room for two volumes of 128 bytes a pixel side by side.
_LARGEST_PAIR = 1 << 20


def spread_disparities(values: FloatMap, weights: NDArray[np.uint8], min_disparity: int,
                       num_disparities: int, threads: int = 1) -> FloatMap:
    """
    Let the valid pixels vote, and give every pixel the whole disparity with most support.

    A valid pixel supports disparity d by max(0, _REACH - |d - value|). Votes are summed by sweeps
    along rows and then columns, as `support.sweep` does it, so that they end at colour edges and
    fill what has no vote.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Disparities, NaN where there is no vote.
    weights : uint8 ndarray of shape (H, W, 2)
        Edge weights of the image's pixel graph.
    min_disparity, num_disparities : int
        The disparities to choose from: [min_disparity, min_disparity + num_disparities).
    threads : int
        With 2 or more, two halves of the range are swept side by side.

    Returns
    -------
    float32 ndarray of shape (H, W)
        No NaN; where no vote arrives at all, the smallest disparity.

    """
    table = similarity_table(_SIGMA) * np.float32(_FADE)
    # Parts of the range, so that memory does not grow with it.
    firsts = range(min_disparity, min_disparity + num_disparities, LANES)
    half = len(firsts) // 2
    args = min_disparity + num_disparities, values, weights, table
    if values.size > _LARGEST_PAIR:
        return _most_supported(firsts, *args)[0]
    upper = start(threads, _most_supported, firsts[half:], *args)
    if half == 0:
        return upper.result()[0]
    best, support = _most_supported(firsts[:half], *args)
    best_above, support_above = upper.result()
    return np.where(support_above > support, best_above, best)


def _most_supported(firsts: Sequence[int], end: int, values: FloatMap,
                    weights: NDArray[np.uint8], table: FloatMap) -> tuple[FloatMap, FloatMap]:
    """Return the best disparity of the parts that begin at `firsts`, and its support."""
    volume = np.empty((*values.shape, LANES), np.float32)
    best, support = np.empty(values.shape, np.float32), np.full(values.shape, -1, np.float32)
    for first in firsts:
        _downward_kernel(values, weights, table, np.float32(first), volume)
        _upward_kernel(weights, table, first, min(LANES, end - first), volume, best, support)
    return best, support


@njit(cache=True, nogil=True)
def _downward_kernel(values, weights, table, first, volume):
    """Sum the votes along every row, and the rows' sums downward."""
    height, width, count = volume.shape
    carried = np.empty(count, np.float32)
    nothing = np.zeros(count, np.float32)
    votes = _votes(count)
    for y in range(height):
        row = volume[y]
        carried[:] = 0
        for x in range(width):
            vote = votes[_vote_start(values[y, x], first, count):]
            kept = table[weights[y, x, 0]]
            for k in range(LANES):
                row[x, k] = carried[k]
                carried[k] = (carried[k] + vote[k]) * kept
        carried[:] = 0
        for x in range(width - 1, -1, -1):
            vote = votes[_vote_start(values[y, x], first, count):]
            kept = table[weights[y, max(x - 1, 0), 0]]
            above = volume[y - 1, x] if y > 0 else nothing
            _collect(row[x], carried, vote, kept, above, table[weights[max(y - 1, 0), x, 1]])


@njit(cache=True, nogil=True, inline='always')
def _collect(here, carried, vote, kept, above, kept_above):
    for k in range(LANES):
        arrived = carried[k] + vote[k]
        here[k] = here[k] + arrived + kept_above * above[k]
        carried[k] = arrived * kept


@njit(cache=True, nogil=True)
def _votes(count):
    """Lay out one vote such that any `count` entries are that of some disparity, or of none."""
    votes = np.zeros(3 * count + 2 * _REACH, np.float32)
    for k in range(-_REACH, _REACH + 1):
        votes[count + _REACH + k] = _REACH - abs(k)
    return votes


@njit(cache=True, nogil=True, inline='always')
def _vote_start(value, first, count):
    """Where in `_votes` the vote of a pixel begins; the zeros at its end where it has none."""
    if np.isnan(value):
        return 2 * count + 2 * _REACH
    middle = int(np.rint(value - first))
    return count + _REACH - min(max(middle, -_REACH), count + _REACH)


@njit(cache=True, nogil=True)
def _upward_kernel(weights, table, first, used, volume, best, support):
    """Add the sums from below to those from above, and choose among those in use."""
    height, width, count = volume.shape
    from_below = np.zeros((width, count), np.float32)
    nothing = np.zeros(count, np.float32)
    total = np.empty(count, np.float32)
    # Floats that are not negative sort as their bits do, and only whole numbers have a maximum
    # that fills vector registers.
    bits = total.view(np.int32)
    for y in range(height - 1, -1, -1):
        for x in range(width):
            above = volume[y - 1, x] if y > 0 else nothing
            _turn(volume[y, x], above, from_below[x], table[weights[max(y - 1, 0), x, 1]],
                  table[weights[y, x, 1]], total)
            total[used:] = 0
            most = np.int32(-1)
            for k in range(LANES):
                most = max(most, bits[k])
            index = 0
            while bits[index] < most:
                index += 1
            if total[index] > support[y, x]:
                best[y, x] = np.float32(first + index)
                support[y, x] = total[index]


@njit(cache=True, nogil=True, inline='always')
def _turn(down, above, from_below, kept_above, kept_below, total):
    """Send up what a pixel has, less what came down to it from above."""
    for k in range(LANES):
        everything = down[k] + kept_below * from_below[k]
        total[k] = everything if everything > 0 else np.float32(0)
        from_below[k] = everything - kept_above * above[k]
