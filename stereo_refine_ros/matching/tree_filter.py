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

"""Non-local refinement: disparities spread from the stable pixels over the tree."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.graph.trees import aggregate, PixelTree
from stereo_refine_ros.matching.disparity_selection import select_winners
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import FloatMap


def spread_over_tree(values: FloatMap, tree: PixelTree, min_disparity: int,
                     num_disparities: int, sigma: float,
                     threads: int = 1) -> FloatMap:
    """
    Give every pixel the whole disparity that the pixels near it in the tree agree on.

    A valid pixel votes with the cost |d - value|, an invalid one not at all; the aggregated cost
    decides. This is the weighted median along the tree.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        Disparities of the stable pixels, NaN elsewhere.
    tree : PixelTree
        Of the left image.
    min_disparity, num_disparities : int
        The disparities to choose from: [min_disparity, min_disparity + num_disparities).
    sigma : float
        Reach along the tree; colour differences in units of 255.
    threads : int
        With 2 or more, two halves of the disparities are aggregated side by side.

    Returns
    -------
    float32 ndarray of shape (H, W)
        No NaN; where no vote arrives at all, the smallest disparity.

    References
    ----------
    Q. Yang, "A non-local cost aggregation method for stereo matching", CVPR 2012, section 3.3.

    """
    half = num_disparities // 2 if threads > 1 else 0
    args = values, tree, sigma
    upper = start(threads, _lowest, min_disparity + half, num_disparities - half, *args)
    if half == 0:
        return upper.result()[0]
    best, cost = _lowest(min_disparity, half, *args)
    best_above, cost_above = upper.result()
    return np.where(cost_above < cost, best_above, best)


def _lowest(first: int, count: int, values: FloatMap, tree: PixelTree, sigma: float,
            ) -> tuple[FloatMap, FloatMap]:
    """Return the best of the disparities first..first + count - 1, and its cost."""
    volume = np.empty((*values.shape, count), np.float32)
    _vote_kernel(values.reshape(-1), np.float32(first), volume.reshape(-1, count))
    aggregate(volume, tree, sigma)
    winners = select_winners(volume)
    cost = np.take_along_axis(volume, winners[..., np.newaxis], axis=2)[..., 0]
    return (winners + first).astype(np.float32), cost


@njit(cache=True, nogil=True)
def _vote_kernel(values, first, rows):
    for i in range(rows.shape[0]):
        row = rows[i]
        if np.isnan(values[i]):
            row[:] = 0
            continue
        distance = first - values[i]
        for k in range(row.size):
            row[k] = abs(distance + np.float32(k))
