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

"""Calibration files of data sets: KITTI, Middlebury, and EuRoC's of raw cameras."""

from __future__ import annotations

from pathlib import Path
import re
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from stereo_refine_ros.camera_info import CameraModel, stereo_geometry
from stereo_refine_ros.types import StereoGeometry
import yaml

Floats = NDArray[np.float64]

_FISHEYE = ('equidistant', 'fisheye')


def read_projections(path: Path, cameras: tuple[str, str] = ('0', '1')) -> StereoGeometry | None:
    """
    Read the projection matrices of left and right from a calibration file.

    Parameters
    ----------
    path : Path
        Two lines of 12 numbers; KITTI's `calib.txt` (`P0: ...`) or `calib_cam_to_cam.txt`
        (`P_rect_00: ...`); or Middlebury's `calib.txt` (`cam0=[...]`).
    cameras : pair of str
        Numbers of the left and the right camera, where the file has more than two.

    Returns
    -------
    StereoGeometry or None
        None where there is no such file or it is written in another form.

    """
    if not path.is_file():
        return None
    lines = [line for line in path.read_text(encoding='utf-8').splitlines() if line.strip()]
    named = dict(re.split(r'\s*[:=]\s*', line, maxsplit=1) for line in lines
                 if re.match(r'\w+\s*[:=]', line))
    if 'cam0' in named and 'baseline' in named:
        return _middlebury(named)
    for form in ('P{}', 'P_rect_0{}'):
        texts = [named.get(form.format(camera), '') for camera in cameras]
        if all(texts):
            return _geometry(*texts)
    return _geometry(*lines) if len(lines) == 2 else None


def read_euroc(left: Path, right: Path) -> tuple[CameraModel, CameraModel]:
    """
    Read two `sensor.yaml` and compute how the raw images have to be turned.

    Parameters
    ----------
    left, right : Path
        Intrinsics, distortion and extrinsics of a pinhole camera each.

    Returns
    -------
    pair of CameraModel
        With R and P as stereo calibration would publish them, without black borders.

    Raises
    ------
    ValueError
        When a file says something else.

    """
    documents = [_read_yaml(path) for path in (left, right)]
    try:
        return _rectified(*documents)
    except (KeyError, TypeError, ValueError, cv2.error) as error:
        raise ValueError(f'{left}, {right}: {error!r}; expected pinhole cameras with '
                         'T_BS, resolution, intrinsics and distortion, as EuRoC has') from error


def euroc_geometry(models: tuple[CameraModel, CameraModel]) -> StereoGeometry:
    """Return the geometry of what `read_euroc` rectifies to."""
    left, right = models
    return stereo_geometry(left, right, left.width, left.height)


def _geometry(left_text: str, right_text: str) -> StereoGeometry | None:
    try:
        left, right = (np.array(text.split(), np.float64) for text in (left_text, right_text))
    except ValueError:
        return None
    if left.shape != (12,) or right.shape != (12,) or not (left[0] > 0 and right[0] > 0):
        return None
    # KITTI's colour cameras both stand beside the camera that coordinates refer to.
    baseline = left[3] / left[0] - right[3] / right[0]
    return StereoGeometry(float(right[0]), float(baseline), float(left[2]), float(left[6]),
                          float(right[2]), float(right[5]))


def _middlebury(named: dict[str, str]) -> StereoGeometry | None:
    """Read Middlebury's own form; its baseline is in millimetres."""
    try:
        matrix = np.array([row.split() for row in named['cam0'].strip('[] ').split(';')],
                          np.float64)
        baseline, doffs = float(named['baseline']), float(named.get('doffs', 0))
    except ValueError:
        return None
    if matrix.shape != (3, 3):
        return None
    cx = float(matrix[0, 2])
    return StereoGeometry(float(matrix[0, 0]), baseline / 1e3, cx, float(matrix[1, 2]),
                          cx + doffs)


def _read_yaml(path: Path) -> dict[str, Any]:
    lines = path.read_text(encoding='utf-8').splitlines()
    text = '\n'.join(line for line in lines if not line.startswith('%'))  # OpenCV's directive
    try:
        return dict(yaml.safe_load(text))
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise ValueError(f'{path}: {error}') from error


def _rectified(left: dict[str, Any], right: dict[str, Any]) -> tuple[CameraModel, CameraModel]:
    for document in (left, right):
        if document['camera_model'] != 'pinhole':
            raise ValueError(f'camera_model {document["camera_model"]!r}')
    width, height = (int(side) for side in left['resolution'])
    k_left, k_right = _intrinsics(left), _intrinsics(right)
    d_left, d_right = (np.array(item['distortion_coefficients'], np.float64)
                       for item in (left, right))
    model = str(left['distortion_model'])
    motion = np.linalg.inv(_pose(right)) @ _pose(left)
    turn, shift = motion[:3, :3].copy(), motion[:3, 3:].copy()
    if model in _FISHEYE:
        turns = cv2.fisheye.stereoRectify(
            k_left, d_left, k_right, d_right, (width, height), turn, shift, 0,
            balance=0.0)[:4]
    else:
        turns = cv2.stereoRectify(
            k_left, d_left, k_right, d_right, (width, height), turn, shift, alpha=0)[:4]
    r_left, r_right, p_left, p_right = turns
    return (_model(width, height, model, d_left, k_left, r_left, p_left),
            _model(width, height, model, d_right, k_right, r_right, p_right))


def _model(width: int, height: int, model: str, *matrices: Floats) -> CameraModel:
    d, k, r, p = ([float(value) for value in np.ravel(matrix)] for matrix in matrices)
    return CameraModel(width, height, model, d, k, r, p)


def _intrinsics(document: dict[str, Any]) -> Floats:
    fx, fy, cx, cy = (float(value) for value in document['intrinsics'])
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def _pose(document: dict[str, Any]) -> Floats:
    return np.array(document['T_BS']['data'], np.float64).reshape(4, 4)
