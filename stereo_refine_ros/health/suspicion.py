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

"""A coarse look at a pair that hardly matches: turned upside down, or exchanged."""

from __future__ import annotations

from dataclasses import dataclass, fields
import math

import cv2
import numpy as np

from stereo_refine_ros.health import tuning
from stereo_refine_ros.types import FloatMap, Image


# Coarse pixels at the lower end of the range that do not count.
_END = 0.5
# By how much the best block must beat the next, percent, and its texture, OpenCV's unit.
_UNIQUENESS, _TEXTURE = 5, 5


@dataclass(frozen=True)
class CoarseLook:
    """
    Share of pixels that match and agree between the views, 0..1, at coarse size.

    Attributes
    ----------
    as_is, upside_down, swapped : float
        The pair as it is, with the right view turned by half a turn, with the views exchanged.
    nearer : float
        The pair as it is, nearer than the search range by up to its length.

    """

    as_is: float
    upside_down: float
    swapped: float
    nearer: float


# How a pair may be looked at: the fields of CoarseLook.
LOOKS = tuple(field.name for field in fields(CoarseLook))


def suspect(left: Image, right: Image, min_disparity: int, num_disparities: int) -> CoarseLook:
    """
    Match a pair coarsely, as it is and in the two ways it may have been put together wrongly.

    Parameters
    ----------
    left, right : uint8 ndarray of shape (H, W)
        Grey, of one shape.
    min_disparity, num_disparities : int
        The range at full size, pixels.

    """
    return CoarseLook(*(
        look_at(view, left, right, min_disparity, num_disparities) for view in LOOKS))


def look_at(view: str, left: Image, right: Image, min_disparity: int, num_disparities: int,
            ) -> float:
    """Return one field of `suspect`."""
    scale = max(1, round(left.shape[1] / tuning.COARSE_WIDTH_PX))
    size = max(1, left.shape[1] // scale), max(1, left.shape[0] // scale)
    small = [np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))
             for image in (left, right)]
    lowest, count = min_disparity // scale, -(-num_disparities // scale)
    if view == 'nearer':
        # What leaves the view has no partner: the range grows by the width at most.
        return _matched_ratio(small[0], small[1], lowest, count + min(count, size[0]),
                              (min_disparity + num_disparities) / scale + 1)
    if view == 'swapped':
        small.reverse()
    elif view == 'upside_down':
        small[1] = np.asarray(cv2.rotate(small[1], cv2.ROTATE_180))
    return _matched_ratio(small[0], small[1], lowest, count)


def _matched_ratio(left: Image, right: Image, lowest: int, count: int,
                   beyond: float = -math.inf) -> float:
    """Return the share of pixels whose matches agree from both views, and lie beyond a value."""
    disparities = 16 * max(1, -(-count // 16))
    columns, rows = max(lowest, 0) + disparities, tuning.COARSE_BLOCK_PX
    left, right = (np.asarray(cv2.copyMakeBorder(
        view, rows, rows, columns, columns, cv2.BORDER_REPLICATE)) for view in (left, right))
    to_right = _match(left, right, lowest, disparities)
    # The right view's match is the left view's of the mirrored pair.
    to_left = _match(right[:, ::-1], left[:, ::-1], lowest, disparities)[:, ::-1]
    inside = slice(columns, left.shape[1] - columns)
    disparity = to_right[rows:-rows, inside]
    target = np.rint(np.arange(left.shape[1])[inside] - disparity).astype(np.int64)
    back = np.take_along_axis(to_left[rows:-rows], target.clip(0, left.shape[1] - 1), axis=1)
    # A pair put together wrongly piles up at the end of the range, where a shift of 0 nearly fits.
    is_matched = ((disparity > lowest + _END) & (back > lowest + _END)
                  & (np.abs(disparity - back) <= 1.0) & (disparity > beyond))
    return float(is_matched.mean())


def _match(left: Image, right: Image, lowest: int, disparities: int) -> FloatMap:
    """Return the disparities of OpenCV's block matcher, pixels, below `lowest` where none."""
    matcher = cv2.StereoBM_create(disparities, tuning.COARSE_BLOCK_PX)
    matcher.setMinDisparity(lowest)
    matcher.setUniquenessRatio(_UNIQUENESS)
    matcher.setTextureThreshold(_TEXTURE)
    fixed = matcher.compute(np.ascontiguousarray(left), np.ascontiguousarray(right))
    return fixed.astype(np.float32) / np.float32(16)
