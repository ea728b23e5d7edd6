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

"""Scenes as messages: what a stereo camera with known ground truth would publish."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
import cv2
import numpy as np
from sensor_msgs.msg import CameraInfo, Image as ImageMessage
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.messages.disparity import disparity_message
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.types import DisparityMap, Image, StereoGeometry

FRAME_ID = 'left_camera_optical_frame'
ENCODINGS = ('bgr8', 'mono8')
_NOMINAL_BASELINE_M = 0.1


def nominal_geometry(height: int, width: int) -> StereoGeometry:
    """Return a geometry for scenes that publish none: focal length as wide as the image."""
    cx = (width - 1) / 2
    return StereoGeometry(float(width), _NOMINAL_BASELINE_M, cx, (height - 1) / 2, cx)


def scene_header(stamp: Time) -> Header:
    """Return the header that all messages of one frame share."""
    return Header(stamp=stamp, frame_id=FRAME_ID)


def image_message(image: Image, encoding: str, header: Header) -> ImageMessage:
    """
    Make an Image message.

    Parameters
    ----------
    image : uint8 ndarray of shape (H, W) or (H, W, 3)
        Grey or BGR.
    encoding : str
        `bgr8` or `mono8`, whatever the image is.
    header : Header
        Stamp and frame.

    """
    if encoding not in ENCODINGS:
        raise ValueError(f'encoding: {encoding!r} is none of {", ".join(ENCODINGS)}')
    if encoding == 'mono8' and image.ndim == 3:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
    if encoding == 'bgr8' and image.ndim == 2:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
    return fill_image(ImageMessage(header=header), image, encoding)


def camera_info_messages(geometry: StereoGeometry, height: int, width: int,
                         header: Header) -> tuple[CameraInfo, CameraInfo]:
    """Return the left and the right CameraInfo of a rectified pair."""
    shift = -geometry.focal_px * geometry.baseline_m
    return (_camera_info(geometry, geometry.cx_left, 0.0, height, width, header),
            _camera_info(geometry, geometry.cx_right, shift, height, width, header))


def truth_message(scene: Scene, geometry: StereoGeometry, header: Header) -> DisparityImage:
    """Make the DisparityImage of a scene's ground truth, unknown pixels marked as invalid."""
    assert scene.truth is not None
    span = max(float(scene.num_disparities or 1), math.floor(float(np.nanmax(scene.truth))) + 1.0)
    smallest = min(0, math.floor(float(np.nanmin(scene.truth))))
    message = disparity_message(
        DisparityMap(scene.truth, smallest, int(span) - smallest), geometry, header)
    message.delta_d = 1.0 / scene.scale
    return message


def _camera_info(geometry: StereoGeometry, cx: float, shift: float, height: int, width: int,
                 header: Header) -> CameraInfo:
    f, cy = geometry.focal_px, geometry.cy
    info = CameraInfo(header=header, height=height, width=width, distortion_model='plumb_bob')
    info.d = [0.0] * 5
    info.k = [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0]
    info.r = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    info.p = [f, 0.0, cx, shift, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info
