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
DisparityImage messages to and from disparity maps.

A message holds metric disparities, Z = f T / d, so the difference of the principal points is
added on the way out and taken off on the way in; its mark of an invalid pixel is one value
below every valid disparity, because stereo_image_proc's point_cloud_node drops the smallest.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
import sys

import cv2
import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.camera_info import BASELINE_M, FOCAL_PX, is_within
from stereo_refine_ros.encodings import BadMessage, check_layout, pixels_of
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.types import DisparityMap, FloatMap, StereoGeometry

DELTA_D = 1.0 / 16.0  # the step of OpenCV's matchers; refined values are finer
_PLAUSIBLE_PX = 1e5
_ODD_SHARE = 0.01  # of a negated map that may be positive
_ENCODINGS = {'32FC1': 'f4', '16SC1': 'i2', '16UC1': 'u2'}


def invalid_value(disparity: DisparityMap, geometry: StereoGeometry) -> float:
    """Return the value that marks an invalid pixel: one below the smallest metric disparity."""
    return disparity.min_disparity + geometry.doffs_px - 1.0


def disparity_message(disparity: DisparityMap, geometry: StereoGeometry, header: Header
                      ) -> DisparityImage:
    """
    Build the message of a disparity map, with the header copied exactly.

    Parameters
    ----------
    disparity : DisparityMap
        Differences of image columns in pixels, NaN invalid.
    geometry : StereoGeometry
        Focal length, baseline and the offset between the principal points.
    header : std_msgs.msg.Header
        Of the left camera_info: downstream nodes synchronise on its stamp.

    """
    message = DisparityImage()
    for target in (message.header, message.image.header):
        target.stamp, target.frame_id = header.stamp, header.frame_id
    # Extrapolated values at or below the mark could not be told from it.
    usable = disparity.values > disparity.min_disparity - 1.0
    metric = np.where(usable, disparity.values + np.float32(geometry.doffs_px),
                      np.float32(invalid_value(disparity, geometry)))
    fill_image(message.image, metric.astype(np.float32, copy=False), '32FC1')
    message.f, message.t = geometry.focal_px, geometry.baseline_m
    message.min_disparity = disparity.min_disparity + geometry.doffs_px
    message.max_disparity = message.min_disparity + disparity.num_disparities - 1.0
    message.delta_d = DELTA_D
    message.valid_window.height, message.valid_window.width = disparity.values.shape
    return message


@dataclass(frozen=True, eq=False)
class ReceivedDisparity:
    """
    What somebody else's DisparityImage says.

    Attributes
    ----------
    values : float32 ndarray of shape (H, W)
        Metric disparity in pixels, NaN invalid.
    focal_px, baseline_m : float
        NaN where the message holds none that can be used.
    min_disparity, max_disparity : float
        The declared range, NaN where there is none.
    delta_d : float

    """

    values: FloatMap
    focal_px: float
    baseline_m: float
    min_disparity: float
    max_disparity: float
    delta_d: float

    @property
    def has_range(self) -> bool:
        """Whether the message declared the range that was searched."""
        return math.isfinite(self.min_disparity)


def check_disparity(name: str, message: DisparityImage) -> None:
    """Check what a DisparityImage says about its data; raise BadMessage otherwise."""
    encoding = message.image.encoding
    if encoding not in _ENCODINGS:
        raise BadMessage(
            'encoding', f'{name}: encoding {encoding[:40]!r} is none of {", ".join(_ENCODINGS)}')
    check_layout(name, message.image, np.dtype(_ENCODINGS[encoding]).itemsize)
    if encoding != '32FC1' and not 0.0 < message.delta_d <= 1.0:
        raise BadMessage(
            'delta_d', f'{name}: {encoding} needs delta_d, the pixels that 1 stands for; it is '
            f'{message.delta_d:g}')


def read_disparity(name: str, message: DisparityImage) -> ReceivedDisparity:
    """
    Read a DisparityImage, tolerant of the ways in which drivers write it.

    Whole numbers are steps of delta_d. Invalid is what is not finite or below the declared
    range; zeros as well, unless the range includes 0 and another mark is in use. Where all that
    is valid is negative, the sign is dropped, of the range as well. A wrong `is_bigendian` is
    seen by values that make no sense in that byte order. The baseline's sign is dropped.

    Raises
    ------
    BadMessage
        As `check_disparity`.

    """
    check_disparity(name, message)
    raw = _pixels(message)
    low, high = _declared_range(message)
    if _is_negated(raw):
        raw = -raw
        low, high = (-high, -low) if high <= 0 else (low, high)
    with np.errstate(invalid='ignore'):
        unusable = ~np.isfinite(raw) | (np.abs(raw) > _PLAUSIBLE_PX)
        if math.isfinite(low):
            unusable |= raw < low
    zero_is_mark = not (math.isfinite(low) and low <= 0 and unusable.any())
    if zero_is_mark:
        unusable |= raw == 0
    return ReceivedDisparity(
        np.where(unusable, np.float32(np.nan), raw), _usable(message.f, FOCAL_PX),
        _usable(abs(message.t), BASELINE_M), low, high, float(message.delta_d))


def resize_disparity(values: FloatMap, width: int, height: int) -> FloatMap:
    """Fit a map to another image size; disparities scale with the width."""
    if values.shape == (height, width):
        return values
    resized = cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST)
    return resized.reshape(height, width) * np.float32(width / values.shape[1])


def _pixels(message: DisparityImage) -> FloatMap:
    """Return the pixels as disparities, whatever marks the invalid ones."""
    encoding = message.image.encoding
    if encoding == '32FC1':
        return _floats(message)
    order = '>' if message.image.is_bigendian else '<'
    steps = pixels_of(message.image, 1, np.dtype(f'{order}{_ENCODINGS[encoding]}'))
    return steps.astype(np.float32) * np.float32(message.delta_d)


def _is_negated(raw: FloatMap) -> bool:
    """Whether a map has many different negative values and hardly a positive one (ZED)."""
    with np.errstate(invalid='ignore'):
        plausible = np.abs(raw) <= _PLAUSIBLE_PX
        negative = raw[plausible & (raw < 0)]
        positive = np.count_nonzero(plausible & (raw > 0))
    # One negative value alone is the mark of invalid pixels.
    return bool(negative.size > 0 and positive < _ODD_SHARE * negative.size
                and negative.min() < negative.max())


def _floats(message: DisparityImage) -> FloatMap:
    native = '>' if sys.byteorder == 'big' else '<'
    declared = '>' if message.image.is_bigendian else '<'
    values = pixels_of(message.image, 1, np.dtype(f'{declared}f4'))
    if declared != native:
        undeclared = pixels_of(message.image, 1, np.dtype(f'{native}f4'))
        if _plausible_count(undeclared) > _plausible_count(values):
            values = undeclared
    return values.astype(np.float32)


def _plausible_count(values: NDArray) -> int:
    with np.errstate(invalid='ignore'):
        size = np.abs(values)
        return int(np.count_nonzero((size >= 1e-3) & (size <= _PLAUSIBLE_PX)))


def _declared_range(message: DisparityImage) -> tuple[float, float]:
    low, high = sorted((float(message.min_disparity), float(message.max_disparity)))
    if -_PLAUSIBLE_PX <= low < high <= _PLAUSIBLE_PX:
        return low, high
    return math.nan, math.nan


def _usable(value: float, limits: tuple[float, float]) -> float:
    return float(value) if is_within(value, limits) else math.nan
