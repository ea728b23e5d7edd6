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

"""Pictures, depth and points made from one refined frame."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image, PointCloud2, PointField
from std_msgs.msg import Header

from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.types import DisparityMap, FloatMap, Image as Pixels, StereoGeometry

POINT_STEP = 16  # x, y, z, rgb


def color_map(disparity: DisparityMap) -> Pixels:
    """
    Colour a disparity map with viridis over its search range; invalid pixels are black.

    Viridis rises evenly in lightness, so it reads the same for the colour-blind.
    """
    scale = 255.0 / max(1, disparity.num_disparities - 1)
    levels = np.nan_to_num((disparity.values - disparity.min_disparity) * np.float32(scale))
    colored = cv2.applyColorMap(
        np.clip(np.rint(levels), 0, 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    colored = colored.reshape(disparity.values.shape + (3,))
    colored[~disparity.valid] = 0
    return colored


def depth_map(disparity: DisparityMap, geometry: StereoGeometry) -> FloatMap:
    """Distance along the optical axis in metres (REP 118), NaN where it is unknown."""
    metric = disparity.values + np.float32(geometry.doffs_px)
    factor = np.float32(geometry.focal_px * geometry.baseline_m)
    with np.errstate(invalid='ignore'):
        metric = np.where(metric > 0, metric, np.float32(np.nan))
    return factor / metric


def image_message(header: Header, pixels: NDArray, encoding: str) -> Image:
    """Wrap an array as an Image message with a header copied."""
    message = Image()
    message.header.stamp, message.header.frame_id = header.stamp, header.frame_id
    return fill_image(message, pixels, encoding)


def point_cloud(header: Header, depth: FloatMap, geometry: StereoGeometry, left: Pixels
                ) -> PointCloud2:
    """
    Build an organised cloud in the left optical frame: x right, y down, z forward, in metres.

    Points without depth are NaN in all three coordinates; `rgb` is packed as PCL does.
    """
    height, width = depth.shape
    points = np.empty((height, width, 4), np.float32)
    columns = np.arange(width, dtype=np.float32) - np.float32(geometry.cx_left)
    rows = np.arange(height, dtype=np.float32)[:, None] - np.float32(geometry.cy)
    points[..., 0] = depth * (columns / np.float32(geometry.focal_px))
    points[..., 1] = depth * (rows / np.float32(geometry.fy))
    points[..., 2] = depth
    bgr = left if left.ndim == 3 else np.repeat(left[..., None], 3, axis=2)
    packed = points.view(np.uint8).reshape(height, width, POINT_STEP)
    packed[..., 12:15] = bgr
    packed[..., 15] = 0
    return _cloud_message(header, packed)


def _cloud_message(header: Header, packed: NDArray[np.uint8]) -> PointCloud2:
    message = PointCloud2()
    message.header.stamp, message.header.frame_id = header.stamp, header.frame_id
    message.height, message.width = packed.shape[:2]
    message.fields = [
        PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1)
        for i, name in enumerate(('x', 'y', 'z', 'rgb'))]
    message.is_bigendian, message.is_dense = False, False
    message.point_step, message.row_step = POINT_STEP, POINT_STEP * packed.shape[1]
    message.data.frombytes(memoryview(packed.reshape(-1)))
    return message
