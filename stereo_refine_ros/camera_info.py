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
Geometry of a rectified pair from the fields of its two CameraInfo messages.

Here because messages come from ROS and, without it, from bags; both have the same fields.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.params import CameraParams
from stereo_refine_ros.types import StereoGeometry

# What lies outside is a mistake, and would overflow in the messages that carry it on.
FOCAL_PX = (1e-2, 1e6)
BASELINE_M = (1e-6, 1e4)
_PRINCIPAL_POINT_PX = 1e6
AS_PUBLISHED = CameraParams()
SIZE_SLACK_PX = 2  # drivers round regions of interest and crops to even numbers


class CameraInfoFields(Protocol):
    """The fields of sensor_msgs/CameraInfo that are read, from whatever library."""

    height: int
    width: int
    distortion_model: str
    d: Sequence[float]
    k: Sequence[float]
    r: Sequence[float]
    p: Sequence[float]
    binning_x: int
    binning_y: int
    roi: Any


@dataclass(frozen=True)
class Region:
    """The fields of sensor_msgs/RegionOfInterest; all of the image by default."""

    x_offset: int = 0
    y_offset: int = 0
    height: int = 0
    width: int = 0


@dataclass
class CameraModel:
    """The fields of sensor_msgs/CameraInfo, for calibrations that come from files."""

    width: int
    height: int
    distortion_model: str
    d: Sequence[float]
    k: Sequence[float]
    r: Sequence[float]
    p: Sequence[float]
    binning_x: int = 0
    binning_y: int = 0
    roi: Region = field(default_factory=Region)


def stereo_geometry(left: CameraInfoFields | None, right: CameraInfoFields | None, width: int,
                    height: int, camera: CameraParams = AS_PUBLISHED) -> StereoGeometry:
    """
    Read focal length, baseline and principal points from the projection matrices P.

    Regions of interest and binning are applied as image_geometry does: the offset is in pixels
    of the full image and comes off before binning.

    Parameters
    ----------
    left : sensor_msgs.msg.CameraInfo or None
        Principal point of the left image.
    right : sensor_msgs.msg.CameraInfo or None
        Focal length is taken from this one; the baseline is between both.
    width, height : int
        Size of the images in pixels.
    camera : CameraParams
        What is not 0 stands instead of what the messages say; principal points that they do not
        say are in the middle.

    Raises
    ------
    BadMessage
        With reason 'camera_info_size', 'focal_length', 'no_baseline' or 'baseline'.

    """
    size = (width, height)
    _, _, cx_left, cy = _projection('left/camera_info', left, size, camera.focal_length)
    fx, fy, cx_right, _ = _projection('right/camera_info', right, size, camera.focal_length)
    baseline = camera.baseline or _shift(left) - _shift(right)
    if abs(baseline) < BASELINE_M[0]:
        raise BadMessage(
            'no_baseline', 'camera_info: the baseline is 0 m: P[3] must be -fx times the '
            'baseline on the right; set it there, or camera.baseline')
    if not is_within(baseline, BASELINE_M):
        raise BadMessage(
            'baseline', f'right/camera_info: baseline -P[3] / P[0] is {baseline:g} m; '
            'it must be positive and plausible (are left and right swapped?)')
    return StereoGeometry(fx, baseline, cx_left, cy, cx_right, fy)


def is_within(value: float, limits: tuple[float, float]) -> bool:
    """Whether a number is finite and between two limits."""
    return limits[0] <= value <= limits[1]


def declared_size(info: CameraInfoFields) -> tuple[int, int]:
    """Return width and height of the images that a camera_info is for; zeros if it says none."""
    full = (info.roi.width or info.width, info.roi.height or info.height)
    return full[0] // max(1, info.binning_x), full[1] // max(1, info.binning_y)


def _shift(info: CameraInfoFields | None) -> float:
    """Return how far right of the reference camera a camera is, in metres."""
    if info is None or len(info.p) != 12 or info.p[0] == 0:
        return 0.0
    return float(info.p[3]) / float(info.p[0])


def _projection(name: str, info: CameraInfoFields | None, size: tuple[int, int], focal_px: float
                ) -> tuple[float, float, float, float]:
    """Return fx, fy, cx, cy in pixels of the image that was sent."""
    middle = ((size[0] - 1) / 2.0, (size[1] - 1) / 2.0)
    if info is None:
        if focal_px > 0.0:
            return focal_px, focal_px, *middle
        raise BadMessage('focal_length', f'no {name} came: publish it, or set '
                         'camera.baseline and camera.focal_length')
    check_info_size(name, info, *size)
    if focal_px > 0.0 and (len(info.p) != 12 or info.p[0] == 0):
        return focal_px, focal_px, *middle
    if len(info.p) != 12:
        raise BadMessage('focal_length', f'{name}: P has {len(info.p)} values instead of 12')
    fx, fy = float(info.p[0]), float(info.p[5])
    cx, cy = float(info.p[2]), float(info.p[6])
    bin_x, bin_y = max(1, info.binning_x), max(1, info.binning_y)
    sent = (focal_px or fx / bin_x, focal_px or fy / bin_y,
            (cx - info.roi.x_offset) / bin_x, (cy - info.roi.y_offset) / bin_y)
    if not (all(is_within(focal, FOCAL_PX) for focal in sent[:2])
            and all(is_within(abs(center), (0.0, _PRINCIPAL_POINT_PX)) for center in sent[2:])):
        raise BadMessage(
            'focal_length', f'{name}: P has fx {fx:g}, fy {fy:g}, cx {cx:g}, cy {cy:g}; '
            'is the camera calibrated and rectified?')
    return sent


def check_info_size(name: str, info: CameraInfoFields, width: int, height: int) -> None:
    """Check that a camera_info is of the image's size, or nearly; raise BadMessage otherwise."""
    said = declared_size(info)
    if said == (0, 0):
        return  # some drivers leave the size out
    if max(abs(said[0] - width), abs(said[1] - height)) > SIZE_SLACK_PX:
        raise BadMessage(
            'camera_info_size',
            f'{name}: for {said[0]} x {said[1]}, the image is {width} x {height}')
