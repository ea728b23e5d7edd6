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

"""Messages of a stereo camera to pairs: raw or compressed, 8 or 16 bits, rectified or not."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.camera_info import CameraInfoFields
from stereo_refine_ros.compressed import check_compressed, decode_compressed
from stereo_refine_ros.encodings import BadMessage, check_image, decode_image
from stereo_refine_ros.grey_range import same_kind, SteadyRange
from stereo_refine_ros.rectification.raw_images import Rectifier
from stereo_refine_ros.types import StereoPair

NAMES = ('left/image_rect', 'right/image_rect')


def view_size(name: str, message: Any) -> tuple[int, int]:
    """
    Check a message, raw or compressed, without touching pixels; return width and height.

    Raises
    ------
    BadMessage
        As `check_image` and `check_compressed`.

    """
    if _is_compressed(message):
        header = check_compressed(name, message)
        return header.width, header.height
    check_image(name, message)
    return message.width, message.height


class PairDecoder:
    """
    Decode the messages of one stereo camera; threads may share it.

    It keeps what should not change from frame to frame: the levels that 16-bit images are
    scaled by, and the maps that raw images are rectified by.
    """

    def __init__(self, names: tuple[str, str] = NAMES) -> None:
        """Keep what the two images are called in an error."""
        self._names = names
        self._range = SteadyRange()
        self._rectifier = Rectifier()

    def decode(self, left: Any, right: Any = None,
               infos: tuple[CameraInfoFields, CameraInfoFields] | None = None) -> StereoPair:
        """
        Decode the images of one instant.

        Parameters
        ----------
        left, right : sensor_msgs.msg.Image or CompressedImage
            `right` may be None where somebody else's disparity comes with the left image.
        infos : pair of sensor_msgs.msg.CameraInfo, optional
            Those of left and right where the images are raw and have to be rectified.

        Returns
        -------
        StereoPair
            uint8, grey or BGR; grey where only one of the two has colours.

        Raises
        ------
        BadMessage
            Saying which message is wrong and why.

        """
        messages = (left,) if right is None else (left, right)
        views = self._range.to_8bit(*(
            _decode_view(name, message)
            for name, message in zip(self._names, messages, strict=False)))
        if infos is not None:
            views = [self._rectifier.rectify(_info_name(name), view, info)
                     for name, view, info in zip(self._names, views, infos, strict=False)]
        if right is None:
            return StereoPair(views[0], None)
        _check_same_size(*views)
        return StereoPair(*same_kind(*views))


def _decode_view(name: str, message: Any) -> NDArray[Any]:
    return (decode_compressed if _is_compressed(message) else decode_image)(name, message)


def _is_compressed(message: Any) -> bool:
    return hasattr(message, 'format')


def _info_name(image_name: str) -> str:
    return f'{image_name.rpartition("/")[0]}/camera_info'


def _check_same_size(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> None:
    if left.shape[:2] != right.shape[:2]:
        raise BadMessage(
            'size_differs', f'left image is {left.shape[1]} x {left.shape[0]}, '
            f'right image {right.shape[1]} x {right.shape[0]}')
