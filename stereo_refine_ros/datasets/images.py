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

"""Image files: views as they are stored, in 8 bits, and maps of raw levels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.grey_range import same_kind, SteadyRange
from stereo_refine_ros.types import StereoPair

SUFFIXES = ('.png', '.jpg', '.jpeg', '.bmp', '.tif', '.tiff', '.ppm', '.pgm', '.webp')
_AS_STORED = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def read_pair(left: Path, right: Path, steady: SteadyRange) -> StereoPair:
    """
    Read the two views of a pair, grey or BGR as they are stored.

    Parameters
    ----------
    left, right : Path
        Images of 8 or 16 bits; both become grey where one is.
    steady : SteadyRange
        Of the camera: brings 16 bits to 8.

    Raises
    ------
    ValueError
        When a file holds no such image, or the two differ in size.

    """
    views = steady.to_8bit(_read_view(left), _read_view(right))
    try:
        return StereoPair(*same_kind(*views))
    except ValueError as error:
        raise ValueError(f'{left}, {right}: {error}') from error


def read_levels(path: Path) -> NDArray[Any] | None:
    """
    Read the raw levels of a map, of whatever type they are stored in.

    Returns
    -------
    ndarray of shape (H, W), or None
        None where there is no such file.

    Raises
    ------
    ValueError
        When the file holds no image, or a coloured one: a picture of a map is no map.

    """
    if not path.is_file():
        return None
    levels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if levels is None:
        raise ValueError(f'{path}: no readable image')
    if levels.ndim == 3:  # some are stored as equal channels
        if not (levels[..., :1] == levels[..., :3]).all():
            raise ValueError(f'{path}: a coloured picture; expected one channel of levels')
        levels = levels[..., 0]
    return levels


def _read_view(path: Path) -> NDArray[Any]:
    if not path.is_file():
        raise FileNotFoundError(f'{path}: no such file')
    image = cv2.imread(str(path), _AS_STORED)
    if image is None:
        raise ValueError(f'{path}: no readable image')
    if image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f'{path}: pixels are {image.dtype}; expected 8 or 16 bits')
    return image
