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

"""The calibration of a frame, and what is doubtful about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from sensor_msgs.msg import CameraInfo

from stereo_refine_ros.camera_info import declared_size, stereo_geometry
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.params import CameraParams
from stereo_refine_ros.types import StereoGeometry

LONG_BASELINE_M = 5.0  # longer ones are more often a P in millimetres than a pair of masts


@dataclass(frozen=True, eq=False)
class Calibration:
    """The camera_info of either side: that of the image's stamp, else the newest."""

    left: CameraInfo | None = None
    right: CameraInfo | None = None

    @property
    def is_complete(self) -> bool:
        """Whether both are there."""
        return self.left is not None and self.right is not None


@dataclass(frozen=True)
class Note:
    """
    Something doubtful about a frame that is used all the same.

    Attributes
    ----------
    key, text : str
        Logged once by key.
    is_lasting : bool
        Whether /diagnostics warns of it as long as it is so.

    """

    key: str
    text: str
    is_lasting: bool = True


def calibrate(calibration: Calibration, camera: CameraParams, width: int, height: int
              ) -> tuple[StereoGeometry | None, tuple[Note, ...]]:
    """
    Return the geometry of a pair, None where it has none, and what is doubtful.

    Raises
    ------
    BadMessage
        Where the calibration is that of other images: 'camera_info_size', 'baseline'.

    """
    try:
        geometry = stereo_geometry(calibration.left, calibration.right, width, height, camera)
    except BadMessage as error:
        if error.reason not in ('focal_length', 'no_baseline'):
            raise
        return None, (Note('no calibration', f'disparity comes without depth: {error}'),)
    return geometry, tuple(_doubts(calibration, camera, geometry, (width, height)))


def _doubts(calibration: Calibration, camera: CameraParams, geometry: StereoGeometry,
            size: tuple[int, int]) -> Iterator[Note]:
    if geometry.baseline_m > LONG_BASELINE_M and not camera.baseline:
        yield Note('baseline', (
            f'right/camera_info: the baseline is {geometry.baseline_m:g} m; is P in '
            'millimetres? Depth will be off by that; mend P, or set camera.baseline'))
    for name, info in (('left', calibration.left), ('right', calibration.right)):
        said = (0, 0) if info is None else declared_size(info)
        if said not in ((0, 0), size):
            yield Note(f'{name} size', (
                f'{name}/camera_info is for {said[0]} x {said[1]}, the image is {size[0]} x '
                f'{size[1]}: taken as it is; check roi, height and binning'), is_lasting=False)
