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
Images from the fields of a message: checked first, then decoded to uint8 grey or BGR.

Here because messages come from ROS and, without it, from bags; both have the same fields.

`check_image` reads only the fields, allocates nothing and is cheap enough for a callback;
`decode_image` touches the pixels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.types import Image

MAX_SIDE = 16384  # also keeps sizes within OpenCV's 16-bit coordinates
MAX_PIXELS = 1 << 25  # 8192 x 4096; the stages' buffers are a hundred times as large


class ImageFields(Protocol):
    """The fields of sensor_msgs/Image, from whatever library."""

    height: int
    width: int
    encoding: str
    is_bigendian: Any
    step: int
    data: Any


class BadMessage(ValueError):
    """
    A message that cannot be used; `reason` is a short code to count it by.

    Parameters
    ----------
    reason : str
        What `/diagnostics` counts it by; `diagnostics.ADVICE` has advice for some.
    text : str
        What is wrong, for the log.

    """

    def __init__(self, reason: str, text: str) -> None:
        """Keep the code beside the text."""
        super().__init__(text)
        self.reason = reason


@dataclass(frozen=True)
class Encoding:
    """
    Layout of one image encoding and how its pixels become grey or BGR.

    Attributes
    ----------
    channels, item_bytes : int
        Values in a pixel and bytes in a value.
    convert : callable from (H, W[, C]) ndarray to uint8 (H, W) or (H, W, 3), or None
        None where the pixels are grey or BGR already.
    even_width : bool
        Two pixels share their colour.
    smallest : int
        Least width and height from which the conversion can work.

    """

    channels: int
    item_bytes: int = 1
    convert: Callable[[NDArray[Any]], Image] | None = None
    even_width: bool = False
    smallest: int = 1


def _color(code: int) -> Callable[[NDArray[Any]], Image]:
    return lambda pixels: cv2.cvtColor(pixels, code)


def _to_8bit(pixels: NDArray[Any]) -> Image:
    """Scale the whole 16-bit range to 8 bits, as cv_bridge does from mono16 to mono8."""
    return ((pixels.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _bayer(code: int) -> Encoding:
    return Encoding(1, convert=_color(code), smallest=4)


# OpenCV names a Bayer pattern by the second row and column, ROS by the first.
ENCODINGS: dict[str, Encoding] = {
    'mono8': Encoding(1),
    '8UC1': Encoding(1),
    'mono16': Encoding(1, 2, _to_8bit),
    '16UC1': Encoding(1, 2, _to_8bit),
    'bgr8': Encoding(3),
    '8UC3': Encoding(3),
    'rgb8': Encoding(3, convert=_color(cv2.COLOR_RGB2BGR)),
    'bgra8': Encoding(4, convert=_color(cv2.COLOR_BGRA2BGR)),
    'rgba8': Encoding(4, convert=_color(cv2.COLOR_RGBA2BGR)),
    'yuv422': Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_UYVY), even_width=True),
    'uyvy': Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_UYVY), even_width=True),
    'yuv422_yuy2': Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_YUY2), even_width=True),
    'yuyv': Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_YUY2), even_width=True),
    'bayer_rggb8': _bayer(cv2.COLOR_BayerBG2BGR),
    'bayer_bggr8': _bayer(cv2.COLOR_BayerRG2BGR),
    'bayer_gbrg8': _bayer(cv2.COLOR_BayerGR2BGR),
    'bayer_grbg8': _bayer(cv2.COLOR_BayerGB2BGR),
}


def check_image(name: str, message: ImageFields) -> Encoding:
    """
    Check that an image message says what its data hold; return its encoding.

    Raises
    ------
    BadMessage
        With reason 'encoding', 'zero_size', 'too_large', 'step' or 'data_size'.

    """
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise BadMessage(
            'encoding',
            f'{name}: encoding {message.encoding[:40]!r} is none of {", ".join(ENCODINGS)}')
    check_layout(name, message, encoding.channels * encoding.item_bytes)
    if encoding.even_width and message.width % 2:
        raise BadMessage('encoding', f'{name}: {message.encoding} of odd width {message.width}')
    if min(message.width, message.height) < encoding.smallest:
        raise BadMessage(
            'encoding', f'{name}: {message.encoding} of {message.width} x {message.height}')
    return encoding


def check_layout(name: str, message: ImageFields, pixel_bytes: int) -> None:
    """Check size, step and amount of data of an image message; nothing is allocated."""
    width, height, step = message.width, message.height, message.step
    if width == 0 or height == 0:
        raise BadMessage('zero_size', f'{name}: size {width} x {height}')
    if width > MAX_SIDE or height > MAX_SIDE:
        raise BadMessage(
            'too_large', f'{name}: {width} x {height}, at most {MAX_SIDE} pixels a side')
    if width * height > MAX_PIXELS:
        raise BadMessage(
            'too_large', f'{name}: {width} x {height}, at most {MAX_PIXELS} pixels')
    if step < width * pixel_bytes:
        raise BadMessage(
            'step', f'{name}: step {step}, a row of {width} {message.encoding} '
            f'needs {width * pixel_bytes} bytes')
    if len(message.data) != step * height:
        raise BadMessage(
            'data_size', f'{name}: {len(message.data)} bytes of data, '
            f'step {step} x height {height} is {step * height}')


def pixels_of(message: ImageFields, channels: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """View the data of a checked message as (H, W) or (H, W, channels), padding cut off."""
    height, width = message.height, message.width
    row_bytes = width * channels * dtype.itemsize
    rows = np.frombuffer(message.data, np.uint8).reshape(height, message.step)
    packed = np.ascontiguousarray(rows[:, :row_bytes]).view(dtype)
    return packed.reshape((height, width) if channels == 1 else (height, width, channels))


def decode_image(name: str, message: ImageFields) -> Image:
    """
    Turn an image message into contiguous uint8 pixels.

    Parameters
    ----------
    name : str
        What the message is called in an error.
    message : sensor_msgs.msg.Image
        Any encoding of `ENCODINGS`, any step, either byte order.

    Returns
    -------
    uint8 ndarray of shape (H, W) for grey or (H, W, 3) in BGR order
        Not to be written to: it may share the message's memory.

    Raises
    ------
    BadMessage
        As `check_image`.

    """
    encoding = check_image(name, message)
    order = '>' if message.is_bigendian else '<'
    dtype = np.dtype(np.uint8) if encoding.item_bytes == 1 else np.dtype(f'{order}u2')
    pixels = pixels_of(message, encoding.channels, dtype)
    if encoding.convert is None:
        return pixels
    converted = np.asarray(encoding.convert(pixels))
    return converted.reshape(pixels.shape[:2] + converted.shape[2:])
