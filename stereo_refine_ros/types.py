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

"""The nouns of the pipeline: what one frame is made of, from images to refined disparity."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
import math

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import Image, to_grey

FloatMap = NDArray[np.float32]
LabelMap = NDArray[np.int32]


def require_image(name: str, image: object) -> Image:
    """
    Check that `image` is a non-empty uint8 array of shape (H, W) or (H, W, 3).

    Raises
    ------
    ValueError
        Naming `name`, what was expected and what came.

    """
    if not isinstance(image, np.ndarray):
        raise ValueError(f'{name}: expected a numpy array, got {type(image).__name__}')
    is_image_shape = image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)
    if image.dtype != np.uint8 or not is_image_shape or image.size == 0:
        raise ValueError(
            f'{name}: expected uint8 (H, W) or (H, W, 3), got {image.dtype} {image.shape}')
    return image


@dataclass(frozen=True, eq=False)
class StereoPair:
    """
    A rectified pair; a point at column x of `left` lies at column x - d of `right`.

    Attributes
    ----------
    left, right : uint8 ndarray of shape (H, W) or (H, W, 3) BGR
        `right` is None when somebody else's disparity is refined with the left image alone.

    """

    left: Image
    right: Image | None

    def __post_init__(self) -> None:
        """Refuse what is not a pair of images of one size."""
        require_image('left', self.left)
        if self.right is None:
            return
        require_image('right', self.right)
        if self.left.shape != self.right.shape:
            raise ValueError(
                f'left and right differ in shape: {self.left.shape} and {self.right.shape}')

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.left.shape[0], self.left.shape[1]

    def with_right(self, right: Image) -> StereoPair:
        """Put another right view beside the left one."""
        pair = StereoPair(self.left, right)
        pair.__dict__['left_grey'] = self.left_grey  # where the cache of the property is
        return pair

    @cached_property
    def left_grey(self) -> Image:
        """Return the left view in grey levels, uint8 (H, W)."""
        return to_grey(self.left)

    @cached_property
    def right_grey(self) -> Image:
        """Return the right view in grey levels, uint8 (H, W)."""
        if self.right is None:
            raise ValueError('the pair has no right image')
        return to_grey(self.right)


@dataclass(frozen=True)
class StereoGeometry:
    """
    Pinhole geometry of a rectified pair: Z = focal_px * baseline_m / (d + doffs_px).

    `d` is the disparity between the image columns (x_left - x_right);
    `doffs_px` is cx_right - cx_left.
    """

    focal_px: float
    baseline_m: float
    cx_left: float
    cy: float
    cx_right: float
    focal_y_px: float | None = None

    @property
    def fy(self) -> float:
        """Vertical focal length in pixels; the horizontal one where none was given."""
        return self.focal_px if self.focal_y_px is None else self.focal_y_px

    @property
    def doffs_px(self) -> float:
        """Offset that turns the difference of image columns into a metric disparity."""
        return self.cx_right - self.cx_left


@dataclass(frozen=True, eq=False)
class DisparityMap:
    """
    Disparities of the left view.

    Attributes
    ----------
    values : float32 ndarray of shape (H, W)
        Pixels, positive for points in front of the cameras; NaN is the only mark of "invalid".
    min_disparity, num_disparities : int
        The searched range is [min_disparity, min_disparity + num_disparities).

    """

    values: FloatMap
    min_disparity: int
    num_disparities: int

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Mask of valid pixels, shape (H, W)."""
        return np.isfinite(self.values)

    @property
    def valid_ratio(self) -> float:
        """Share of valid pixels, 0..1."""
        return float(np.count_nonzero(self.valid)) / self.values.size


@dataclass(frozen=True, eq=False)
class PlaneSegmentation:
    """
    Segments of the left image and the disparity plane of each: d(x, y) = a x + b y + c.

    Attributes
    ----------
    labels : int32 ndarray of shape (H, W), 0..N-1
    planes : float64 ndarray of shape (N, 3), columns a, b, c
    is_fitted : bool ndarray of shape (N,)
        False where no plane rests on the segment's own data; its row in `planes` is then that of
        a neighbour, or NaN.
    inlier_ratio : float32 ndarray of shape (N,)
        Share of the segment's fit data within the inlier threshold of its plane.
    plane_index : int32 ndarray of shape (N,)
        Segments of one plane have one number, -1 those without any. If not given, every segment
        has a plane of its own.

    """

    labels: LabelMap
    planes: NDArray[np.float64]
    is_fitted: NDArray[np.bool_]
    inlier_ratio: FloatMap
    plane_index: LabelMap = field(default_factory=lambda: np.zeros(0, np.int32))

    def __post_init__(self) -> None:
        """Give every segment a plane of its own where nothing else is said."""
        if self.plane_index.size == 0:
            numbers = np.arange(len(self.planes), dtype=np.int32)
            has_plane = np.isfinite(self.planes[:, 0])
            object.__setattr__(self, 'plane_index', np.where(has_plane, numbers, np.int32(-1)))


@dataclass(frozen=True)
class PairHealth:
    """
    What one pair of images says of the cameras that took it; NaN where it says nothing.

    Attributes
    ----------
    row_offset_px : float
        Largest vertical disagreement of the two views found, before correction, pixels; 0 where
        they were found to agree.
    gain_ratio : float
        Brightness of the right view over that of the left.
    noise_sigma : float
        Standard deviation of the sensor noise of the left view, grey levels.
    matched_ratio : float
        Share of pixels on which the own matches of both views agree.
    last_disparity_ratio : float
        Share of the matches at the last disparities of the range: things nearer than it.
    nearer_ratio : float
        Share of pixels that match nearer than the range, a coarse look.
    upside_down_ratio : float
        What `matched_ratio` would be with the right view turned upside down, a coarse look.
    swapped_ratio : float
        ... and with left and right exchanged.
    sharpness_ratio : float
        Detail of the blurrier view over that of the sharper one, 0..1.
    saturated_ratio : float
        Share of the left view's pixels that are black or white.
    contrast_left, contrast_right : float
        Standard deviation of each view, grey levels: near 0 for a black or covered lens.
    is_same_image : bool
        Whether both views are one image.
    fits_right_better : bool
        Whether an external map explains the right view's edges better than the left's.
    given_agreement : float
        Share of the surely matched pixels on which an external map agrees with the own match.

    """

    row_offset_px: float = math.nan
    gain_ratio: float = math.nan
    noise_sigma: float = math.nan
    matched_ratio: float = math.nan
    last_disparity_ratio: float = math.nan
    nearer_ratio: float = math.nan
    upside_down_ratio: float = math.nan
    swapped_ratio: float = math.nan
    sharpness_ratio: float = math.nan
    saturated_ratio: float = math.nan
    contrast_left: float = math.nan
    contrast_right: float = math.nan
    is_same_image: bool = False
    fits_right_better: bool = False
    given_agreement: float = math.nan


@dataclass(frozen=True, eq=False)
class RefinementResult:
    """
    What one frame became.

    Attributes
    ----------
    disparity : DisparityMap
        The refined map, dense.
    confidence : float32 ndarray of shape (H, W), 0..1
        How likely each disparity is within 1 px of the truth.
    preliminary : DisparityMap
        The matcher's map (or the external one) that was refined.
    segments : PlaneSegmentation
    health : PairHealth
    lr_consistent_ratio : float
        Share of pixels that passed the left-right check, NaN for a map from outside.
    stage_ms : dict of str to float
        Wall time of 'matching', 'segmentation', 'planes' and 'filter' in milliseconds;
        segmentation runs beside matching where there is a second thread.
    total_ms : float
        Wall time of the whole frame.

    """

    disparity: DisparityMap
    preliminary: DisparityMap
    segments: PlaneSegmentation
    lr_consistent_ratio: float
    stage_ms: dict[str, float] = field(default_factory=dict)
    total_ms: float = 0.0
    confidence: FloatMap = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    health: PairHealth = PairHealth()
