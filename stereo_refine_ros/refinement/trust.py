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

"""
Maps from outside that know more than the evidence: how they are recognised, and kept.

The map of a good stereo network is better than what any matching cost can say against it, and
a refinement that overrules it makes it worse. What tells such a map from a matcher's is where
its steps are: sharp, and at the edges of the image, on both sides of things; a matcher's are a
window's width away on one side, and lost in a hole on the other.
"""

from __future__ import annotations

import cv2
from numba import njit
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.types import FloatMap, Image

# A step of the map is the steepest rise of a row within _SLOPE pixels: by _STEEP at least, and
# by _STEP together with what rises beside it, of which a sharp step has the larger part; pixels.
_SLOPE, _STEEP, _STEP, _SHARP_PART = 2, 0.75, 1.5, 0.7
# It is at an edge when the largest colour change within _REACH, of at least _EDGE grey levels,
# is within _NEAR: by chance a third of the steps are.
_EDGE, _REACH, _NEAR = 10, 4, 1
# A map is trusted when of its steps up, and of its steps down, so many are sharp and at edges.
# test/evaluation/test_trusted_maps.py: ground truth has more, a semi-global matcher's map less.
_TRUSTED_SHARE = 0.52
# Few steps prove little: a standard deviation of the count, in square roots of it, is at most:
_DOUBT = 0.5
# What differs by more is another surface, pixels; and whole regions must: pixels of the image.
_OTHER_SURFACE, _LEAST_REGION = 1.0, 100
_OUTLINE = np.ones((3, 3), np.uint8)
# What changes within the noise of a trusted map is smoothed: in standard deviations, found from
# the median distance to the median of a window, on every so many pixels. A reach of fewer pixels
# is not noise but the shape of things.
_NOISE_REACH, _SIGMA_OF_MEDIAN, _NOISE_WINDOW, _NOISE_STRIDE = 3.0, 1.4826, 5, 4
_LEAST_NOISE = 0.2


def follows_edges(values: FloatMap, image: Image) -> bool:
    """
    Whether the steps of a map are sharp and where the edges of its image are.

    Parameters
    ----------
    values : float32 ndarray of shape (H, W)
        A map as it came, pixels, NaN invalid.
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        The left view.

    """
    steps, hits = count_steps(values, image)
    return bool(np.all(hits > _TRUSTED_SHARE * steps + _DOUBT * np.sqrt(steps)))


def count_steps(values: FloatMap, image: Image) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Count the steps along rows near any edge, and the sharp ones at it; [down, up] of each."""
    return _count_kernel(values, edge_weights(image))


def find_overruled(projected: FloatMap, given: FloatMap, rows: int, height: int
                   ) -> NDArray[np.bool_]:
    """
    Find the regions whose given disparities the planes took to another surface.

    Parameters
    ----------
    projected, given : float32 ndarray of shape (h, W)
        After the planes and before, pixels, NaN invalid.
    rows, height : int
        One row of the maps is `rows` of the image's `height`.

    Returns
    -------
    bool ndarray of shape (height, W)
        Without small regions: of those, a good map knows better. With a pixel around the others:
        their outline as it was given is neither surface.

    """
    differs = (np.abs(projected - given) > _OTHER_SURFACE).astype(np.uint8)
    _, regions, figures, _ = cv2.connectedComponentsWithStats(differs, connectivity=8)
    is_large = figures[:, cv2.CC_STAT_AREA] * rows >= _LEAST_REGION
    is_large[0] = False  # where nothing differs
    large = np.repeat(is_large[regions].astype(np.uint8), rows, axis=0)[:height]
    return cv2.dilate(large, _OUTLINE) > 0


def take_back(refined: FloatMap, given: FloatMap, overruled: NDArray[np.bool_]) -> FloatMap:
    """
    Give the pixels of a trusted map back what they had.

    Except for what was overruled, and what changed by no more than the map's own noise.

    Parameters
    ----------
    refined : float32 ndarray of shape (H, W)
        Dense, pixels.
    given : float32 ndarray of shape (H, W)
        The map as it came, NaN invalid.
    overruled : bool ndarray of shape (H, W)
        Where the images spoke clearly against the map.

    """
    filled = np.where(np.isnan(given), refined, given)
    away = np.abs(filled - cv2.medianBlur(filled, _NOISE_WINDOW))
    sample = away[::_NOISE_STRIDE, ::_NOISE_STRIDE]
    reach = _NOISE_REACH * _SIGMA_OF_MEDIAN * float(np.median(sample))
    if reach < _LEAST_NOISE:
        reach = 0.0
    return np.where(~overruled & (np.abs(refined - given) > reach), given, refined)


@njit(cache=True, nogil=True)
def _count_kernel(values, weights):
    height, width = values.shape
    steps, hits = np.zeros(2), np.zeros(2)
    for y in range(height):
        row = values[y]
        for x in range(width - 1):
            rise = abs(row[x + 1] - row[x])
            if not rise > _STEEP or not _is_steepest(row, x, rise):
                continue
            # Beside a hole the whole rise is NaN, and says nothing against the step.
            whole = abs(row[min(x + _SLOPE, width - 2) + 1] - row[max(x - _SLOPE, 0)])
            if max(rise, whole) <= _STEP:
                continue
            edge = _strongest_edge(weights[y, :, 0], x)
            if edge < 0:
                continue
            side = int(row[x + 1] > row[x])
            steps[side] += 1
            if abs(edge - x) <= _NEAR and not rise < _SHARP_PART * whole:
                hits[side] += 1
    return steps, hits


@njit(cache=True, nogil=True)
def _is_steepest(row, x, rise):
    """Whether no rise nearby is steeper; of equal ones the first counts."""
    for i in range(max(x - _SLOPE, 0), min(x + _SLOPE, row.shape[0] - 2) + 1):
        other = abs(row[i + 1] - row[i])
        if other > rise or (other == rise and i < x):
            return False
    return True


@njit(cache=True, nogil=True)
def _strongest_edge(row, x):
    """Return the column of the largest weight around x, -1 where all are small."""
    strongest, place = _EDGE - 1, -1
    for i in range(max(x - _REACH, 0), min(x + _REACH + 1, row.shape[0] - 1)):
        if row[i] > strongest:
            strongest, place = np.int64(row[i]), i
    return place
