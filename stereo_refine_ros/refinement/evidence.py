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

"""What two matches of a pair, at full and at half resolution, say of any map of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stereo_refine_ros.images import halve
from stereo_refine_ros.levels import halve_pair, repeated, to_grid
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.scanline import reliable, scan, Scan  # noqa: I101
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement.likelihood import Evidence
from stereo_refine_ros.types import FloatMap, Image, StereoPair


def gather_evidence(pair: StereoPair, match: Match, params: MatchingParams, scale: int,
                    threads: int = 1) -> Evidence:
    """
    Match a pair at both resolutions, and lay the matches out on the grid.

    The scanline matcher has matched at full resolution already. Without a right view the map
    given is its own and only witness.
    """
    if pair.right is None:
        return _alone(pair.left, match.disparity.values, scale)
    first, count = params.min_disparity, params.num_disparities
    fine = match.scan or scan(pair, first, count, threads)
    half = halve_pair(pair)
    coarse = _doubled(scan(half, first // 2, -(-count // 2), threads), first, count)
    values = match.disparity.values if match.scan else reliable(fine)
    if scale == 2:
        return Evidence(half.left, 2, to_grid(values, 2), coarse.disparity,
                        np.ascontiguousarray(fine.uniqueness[::2, ::2]), coarse.right)
    return Evidence(pair.left, 1, values, repeated(coarse.disparity, pair.shape, 2),
                    fine.uniqueness, fine.right)


def _doubled(found: Scan, first: int, count: int) -> Scan:
    """Turn a match of half-size images into full-size pixels of the range, islands dropped."""
    disparity = np.clip(2 * reliable(found), first, first + count - 1)
    return replace(found, disparity=disparity, right=2 * found.right)


def _alone(left: Image, given: FloatMap, scale: int) -> Evidence:
    image, values = (left, given) if scale == 1 else (halve(left), to_grid(given, 2))
    nothing = np.full(values.shape, np.nan, np.float32)
    return Evidence(image, scale, values, nothing, np.zeros_like(values), nothing, False)
