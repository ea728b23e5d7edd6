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

"""What may stand at a pixel: dense maps to choose from, the first of them what was given."""

from __future__ import annotations

from numba import njit
import numpy as np

from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.refinement.likelihood import Evidence, PlaneMap
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap


def propose(given: FloatMap, planes: PlaneMap, evidence: Evidence, threads: int = 1) -> FloatMap:
    """
    Gather the candidates of every pixel.

    Parameters
    ----------
    given : float32 ndarray of shape (H, W)
        The map to refine, NaN where it has holes.
    planes, evidence
        On the same grid.
    threads : int
        Bands of rows side by side.

    Returns
    -------
    float32 ndarray of shape (K, H, W), no NaN unless nothing was given
        The given map with its holes filled from the background; the plane of the segment; the
        planes beside a hole, behind and in front; the checked matches at full resolution, where
        the given map is another, and at half. Where one has nothing to say, it repeats the first.

    """
    background = fill_from_background(given)
    others = [planes.values, planes.behind, planes.before]
    if evidence.has_right:
        if evidence.fine is not given:  # else it is the first already
            others.append(evidence.fine)
        others.append(evidence.coarse)
    maps = np.empty((1 + len(others), *given.shape), np.float32)

    def fill(start: int, stop: int) -> None:
        rows = slice(start, stop)
        maps[0, rows] = background[rows]
        for to, other in zip(maps[1:], others, strict=True):
            _fill_kernel(start, stop, other, background, to)
    run_bands(fill, len(given), threads)
    return maps


@njit(cache=True, nogil=True)
def _fill_kernel(start, stop, values, background, out):
    for y in range(start, stop):
        for x in range(values.shape[1]):
            value = values[y, x]
            out[y, x] = background[y, x] if np.isnan(value) else value
