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

"""Scanline optimisation on gradients and two censuses, at the resolution of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import halve
from stereo_refine_ros.matching.features import alike, feature_planes, flat_steps
from stereo_refine_ros.matching.islands import without_islands
from stereo_refine_ros.matching.match import Match, Scan
from stereo_refine_ros.matching.scanline_paths import band_kernel, STRIP, work_size
from stereo_refine_ros.matching.scanline_winners import WIDEST
from stereo_refine_ros.matching.scratch import scratch
from stereo_refine_ros.matching.tuning import (
    CENSUS_CAP, EDGE_FACTOR, EDGE_STEP, FULL_RANGE, GRADIENT_CAP, OUT_OF_VIEW, PENALTIES, WINDOW)
from stereo_refine_ros.matching.vector_twins import LANES_PER_ITEM, LEFT_PLANES, PLANES
from stereo_refine_ros.matching.windows import half_range, windows
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.threads import run_parts, start
from stereo_refine_ros.types import DisparityMap, StereoPair

# Powers of two: vectors of other widths are taken apart, 96 lanes cost more than 128 do.
LANES = (32, 64, 128, 256)
# Rows of a band, whole strips, so that the result does not depend on the number of threads. Each
# band matches RUN_UP rows above and below it once more; larger ones leave threads without work.
_BAND_ROWS = 3 * STRIP
_ONE_WINDOW = np.zeros((1, 1), np.int32)


def lanes_for(num_disparities: int) -> int:
    """Return the lanes that hold so many disparities, at most FULL_RANGE."""
    return next(count for count in LANES if count >= num_disparities)


def lane_counts(num_disparities: int) -> tuple[int, ...]:
    """Return all counts of LANES that matching at full and at half size uses for a range."""
    counts, used = [num_disparities, -(-num_disparities // 2)], set()
    while counts:
        count = counts.pop()
        if count > FULL_RANGE:
            used.add(lanes_for(WINDOW))
            counts += [-(-count // 2), -(-count // 2) + 1]  # as `half_range` has it
        else:
            used.add(lanes_for(count))
    return tuple(sorted(used))


def match_scanline(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """
    Match by scanline optimisation.

    `disparity` is sub-pixel and NaN where a pixel of the right view has a cheaper partner,
    where another fits as well, and in small islands.
    """
    found = scan(pair, params.min_disparity, params.num_disparities, threads)
    values = without_islands(found.disparity, threads)
    return Match(DisparityMap(values, params.min_disparity, params.num_disparities), scan=found)


def scan(pair: StereoPair, min_disparity: int, num_disparities: int, threads: int = 1,
         edge_step: float = EDGE_STEP) -> Scan:
    """
    Match a pair over [min_disparity, min_disparity + num_disparities).

    Parameters
    ----------
    pair : StereoPair
        uint8 images of shape (H, W) or (H, W, 3).
    min_disparity, num_disparities : int, pixels
        Any range; all of it may lie outside the view.
    threads : int
        The result does not depend on it.
    edge_step : float, grey levels
        A step of the left view from one pixel to the next of at least this is an edge.

    Raises
    ------
    ValueError
        Without a right image, and for views wider than WIDEST.

    """
    if pair.right is None:
        raise ValueError('scanline: needs the right image')
    if pair.shape[1] > WIDEST:
        raise ValueError(f'scanline: views are at most {WIDEST} pixels wide, not {pair.shape[1]}')
    base, count = _ONE_WINDOW, num_disparities
    if num_disparities > FULL_RANGE:
        half = scan(StereoPair(halve(pair.left), halve(pair.right)),
                    *half_range(min_disparity, num_disparities), threads, edge_step)
        base = windows(without_islands(half.disparity, threads), pair.shape, min_disparity,
                       num_disparities)
        count = WINDOW
    return scan_windows(pair, min_disparity, count, base, threads, edge_step)


def scan_windows(pair: StereoPair, min_disparity: int, num_disparities: int,
                 base: NDArray[np.int32], threads: int, edge_step: float) -> Scan:
    """Match every pixel over the `num_disparities` that begin `base` after `min_disparity`."""
    assert pair.right is not None
    height, width = pair.shape
    lanes = lanes_for(num_disparities)
    margin = lanes + width
    size = height * width + 2 * margin
    mask = np.zeros(lanes, np.uint8)
    mask[num_disparities:] = 255
    outside = np.full(width + 2 * margin, OUT_OF_VIEW, np.uint8)
    outside[margin:margin + width] = 0
    out = tuple(np.empty((height, width), np.float32) for _ in range(3))
    working = work_size(width, lanes, base.shape[0] > 1)
    compared = PLANES * height * width
    with scratch(LEFT_PLANES * height * width) as left, scratch(PLANES * size) as right:
        tasks = (start(threads, feature_planes, pair.right_grey, True, margin, right),
                 start(threads, alike, pair.left, edge_step, left[compared:]))
        feature_planes(pair.left_grey, False, 0, left[:compared])
        flat = tuple(flags.reshape(-1) for flags in flat_steps(pair.left, edge_step))
        for task in tasks:
            task.result()
        args = ((0,) * (lanes // LANES_PER_ITEM), (left, right, mask, outside, size), base, flat,
                ((GRADIENT_CAP, CENSUS_CAP), _penalties(lanes), min_disparity, margin,
                 num_disparities - 1))

        def match_band(band: int, _: int) -> None:
            with scratch(working) as work:
                band_kernel(band * _BAND_ROWS, min((band + 1) * _BAND_ROWS, height), *args,
                            work, out)
        count = -(-height // _BAND_ROWS)
        run_parts(match_band, count, count, threads)
    return Scan(*out)


def _penalties(lanes: int) -> NDArray[np.uint8]:
    """Lay out P1 and P2 as the vector steps take them."""
    even = np.array(PENALTIES)
    by_flag = np.rint(np.stack([even * EDGE_FACTOR, even], axis=1)).astype(np.uint8)
    return np.repeat(by_flag.reshape(-1), lanes)
