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
Raw images rectified by K, D, R and P of their camera_info, as image_proc does.

The maps are computed once for a camera_info and kept as long as it says the same.
"""

from __future__ import annotations

from collections import OrderedDict
import threading
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.camera_info import CameraInfoFields, check_info_size, FOCAL_PX, is_within
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.types import Image

Floats = NDArray[np.float64]
Maps = tuple[NDArray[Any], NDArray[Any]]

# Names of one model, and how many coefficients D may have; none is a lens without distortion.
_PINHOLE = ('plumb_bob', 'rational_polynomial', 'radial-tangential', 'radtan', '')
_FISHEYE = ('equidistant', 'fisheye')
_PINHOLE_COUNTS, _FISHEYE_COUNTS = (0, 4, 5, 8, 12, 14), (0, 4)
# Two cameras, and room for a second pair while calibrations change.
_KEPT = 4


class Rectifier:
    """Rectifies the images of a camera; threads may share it."""

    def __init__(self) -> None:
        """Start without maps."""
        self._lock = threading.Lock()
        self._maps: OrderedDict[tuple[Any, ...], Maps] = OrderedDict()

    def rectify(self, name: str, image: Image, info: CameraInfoFields) -> Image:
        """
        Rectify one raw image.

        Parameters
        ----------
        name : str
            What the camera_info is called in an error.
        image : ndarray of uint8, shape (H, W) or (H, W, 3)
            As the camera took it.
        info : sensor_msgs.msg.CameraInfo
            Distortion model plumb_bob, rational_polynomial or equidistant; region of interest
            and binning are those of the image.

        Returns
        -------
        uint8 ndarray of the shape of `image`
            What no pixel of the raw image shows is 0.

        Raises
        ------
        BadMessage
            With reason 'camera_info_size' or 'distortion'.

        """
        height, width = image.shape[:2]
        check_info_size(name, info, width, height)
        first, second = self._maps_of(name, info, width, height)
        rectified = cv2.remap(image, first, second, cv2.INTER_LINEAR)
        return np.asarray(rectified, np.uint8).reshape(image.shape)

    def _maps_of(self, name: str, info: CameraInfoFields, width: int, height: int) -> Maps:
        roi = info.roi
        key = (width, height, info.distortion_model, *map(float, (
            *info.d, *info.k, *info.r, *info.p, info.binning_x, info.binning_y, roi.x_offset,
            roi.y_offset)))
        with self._lock:
            found = self._maps.get(key)
            if found is None:
                found = self._maps[key] = _compute_maps(name, info, width, height)
                while len(self._maps) > _KEPT:
                    self._maps.popitem(last=False)
            self._maps.move_to_end(key)
        return found


def _compute_maps(name: str, info: CameraInfoFields, width: int, height: int) -> Maps:
    """Check a calibration and turn it into maps, in the fixed point that remap works in."""
    is_fisheye = info.distortion_model in _FISHEYE
    if not is_fisheye and info.distortion_model not in _PINHOLE:
        raise BadMessage(
            'distortion', f'{name}: distortion_model {info.distortion_model[:40]!r} is none of '
            'plumb_bob, rational_polynomial, equidistant')
    d = np.array(info.d, np.float64)
    counts = _FISHEYE_COUNTS if is_fisheye else _PINHOLE_COUNTS
    if d.size not in counts or not np.isfinite(d).all():
        raise BadMessage(
            'distortion', f'{name}: D has {d.size} values, {info.distortion_model or "no model"} '
            f'takes {" or ".join(map(str, counts[1:]))}, all finite')
    k = _matrix(name, 'K', info.k, 3)
    r = _matrix(name, 'R', info.r, 3)
    p = _matrix(name, 'P', info.p, 4)[:, :3]
    if not np.allclose(r @ r.T, np.eye(3), atol=1e-2):
        raise BadMessage('distortion', f'{name}: R is no rotation; is the pair calibrated?')
    for letter, matrix in (('K', k), ('P', p)):
        if not all(is_within(matrix[i, i], FOCAL_PX) for i in (0, 1)):
            raise BadMessage(
                'distortion', f'{name}: {letter} has focal lengths {matrix[0, 0]:g} and '
                f'{matrix[1, 1]:g}; is the camera calibrated?')
    sent = _sent(info)
    make = cv2.fisheye.initUndistortRectifyMap if is_fisheye else cv2.initUndistortRectifyMap
    d = d if d.size else np.zeros(4)
    return make(sent @ k, d, r, sent @ p, (width, height), cv2.CV_16SC2)


def _sent(info: CameraInfoFields) -> Floats:
    """Return what turns pixels of the full image into those that were sent."""
    bin_x, bin_y = max(1, info.binning_x), max(1, info.binning_y)
    return np.array([[1 / bin_x, 0, -info.roi.x_offset / bin_x],
                     [0, 1 / bin_y, -info.roi.y_offset / bin_y], [0, 0, 1.0]])


def _matrix(name: str, letter: str, values: Any, columns: int) -> Floats:
    matrix = np.array(values, np.float64).ravel()
    if matrix.size != 3 * columns or not np.isfinite(matrix).all():
        raise BadMessage('distortion', f'{name}: {letter} has {matrix.size} values instead of '
                         f'{3 * columns}, or some are not finite')
    return matrix.reshape(3, columns)
