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
Steps 1-3: matching cost, aggregation, disparity selection.

Every matcher is a function `match(pair, params, threads) -> Match`, chosen by name from
`MATCHERS`.
"""

from __future__ import annotations

from collections.abc import Callable
import os

import numpy as np

from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.opencv_matchers import match_bm, match_sgbm
from stereo_refine_ros.matching.scanline import match_scanline
from stereo_refine_ros.matching.tree_matchers import match_non_local, match_segment_tree
from stereo_refine_ros.matching.tuning import BYTES_PER_CELL, BYTES_PER_PIXEL
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import DisparityMap, FloatMap, StereoPair

Matcher = Callable[[StereoPair, MatchingParams, int], Match]

MATCHERS: dict[str, Matcher] = {
    'sgbm': match_sgbm,
    'bm': match_bm,
    'segment_tree': match_segment_tree,
    'non_local': match_non_local,
    'scanline': match_scanline,
}

# Those that need little beside the images, and those that keep a cost volume of them.
OPENCV_MATCHERS = ('sgbm', 'bm')
TREE_MATCHERS = ('segment_tree', 'non_local')


def find_match(pair: StereoPair, given: FloatMap | None, params: MatchingParams,
               threads: int = 1) -> Match:
    """
    Take a map from outside, or match the pair where there is none.

    Raises
    ------
    ValueError
        For a map that is not of the pair's shape; else see `compute_match`.

    """
    if given is None:
        return compute_match(pair, params, threads)
    if not isinstance(given, np.ndarray) or given.shape != pair.shape:
        raise ValueError(f'preliminary: expected a numpy array of shape {pair.shape}, '
                         f'got {getattr(given, "shape", type(given).__name__)}')
    values = given.astype(np.float32)
    values[~np.isfinite(values)] = np.nan
    return Match(DisparityMap(values, params.min_disparity, params.num_disparities),
                 is_own=False)


def compute_match(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """
    Run the matcher that `params.method` names.

    Raises
    ------
    ValueError
        For an unknown method, without a right image, and where the cost volume would not fit
        into this machine's memory: the system would end the process without a word.

    """
    if pair.right is None:
        raise ValueError(f'matching.method {params.method}: needs the right image')
    if params.method not in MATCHERS:
        raise ValueError(f'matching.method: {params.method!r} is none of {", ".join(MATCHERS)}')
    check_memory(pair, params)
    return MATCHERS[params.method](pair, params, threads)


def check_memory(pair: StereoPair, params: MatchingParams) -> None:
    """Refuse a pair that this machine has no memory for, before anything is allocated."""
    if params.method in OPENCV_MATCHERS:
        return
    height, width = pair.shape
    pixels = height * width
    needed = pixels * (params.num_disparities * BYTES_PER_CELL
                       if params.method in TREE_MATCHERS else BYTES_PER_PIXEL)
    memory = os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE')
    if needed > memory:
        raise ValueError(
            f'matching.method {params.method}: {width} x {height} with '
            f'{params.num_disparities} disparities needs about {needed / 1e9:.0f} GB, there are '
            f'{memory / 1e9:.0f}; use fewer disparities, smaller images or sgbm')
