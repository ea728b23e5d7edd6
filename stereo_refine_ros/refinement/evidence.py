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

from dataclasses import dataclass, replace

import numpy as np

from stereo_refine_ros.images import halve
from stereo_refine_ros.levels import halve_pair, repeated, to_grid
from stereo_refine_ros.matching.islands import without_islands
from stereo_refine_ros.matching.match import Match, Scan
from stereo_refine_ros.matching.scanline import scan
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.refinement.likelihood import Evidence
from stereo_refine_ros.types import FloatMap, Image, StereoPair


@dataclass(frozen=True, eq=False)
class HalfMatch:
    """The left view at half size, and its match there, in pixels of the full size."""

    image: Image
    scan: Scan


def match_half(pair: StereoPair, params: MatchingParams) -> HalfMatch | None:
    """Match a pair at half resolution; None without a right view."""
    if pair.right is None:
        return None
    first, count = params.min_disparity, params.num_disparities
    half = halve_pair(pair)
    found = scan(half, first // 2, -(-count // 2))
    disparity = np.clip(2 * without_islands(found.disparity), first, first + count - 1)
    return HalfMatch(half.left, replace(found, disparity=disparity, right=2 * found.right))


def gather_evidence(pair: StereoPair, match: Match, given: FloatMap, half: HalfMatch | None,
                    params: MatchingParams, scale: int, threads: int = 1) -> Evidence:
    """
    Lay the matches at both resolutions out on the grid.

    The scanline matcher has matched at full resolution already. Without a right view the map
    given is its own and only witness. `given` is the map of `match` on the grid.
    """
    if half is None:
        return _alone(pair.left if scale == 1 else halve(pair.left), given, scale)
    fine = match.scan or scan(pair, params.min_disparity, params.num_disparities, threads)
    coarse = half.scan
    values = given if match.scan else to_grid(
        without_islands(fine.disparity, threads), scale, threads)
    if scale == 2:
        return Evidence(half.image, 2, values, coarse.disparity,
                        np.ascontiguousarray(fine.uniqueness[::2, ::2]), coarse.right)
    return Evidence(pair.left, 1, values, repeated(coarse.disparity, pair.shape, 2),
                    fine.uniqueness, fine.right)


def _alone(image: Image, given: FloatMap, scale: int) -> Evidence:
    nothing = np.full(given.shape, np.nan, np.float32)
    return Evidence(image, scale, given, nothing, np.zeros_like(given), nothing, False)
