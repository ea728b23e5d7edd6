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
Images from the fields of a message: checked first, then decoded to grey or BGR.

Here because messages come from ROS and, without it, from bags; both have the same fields.

`check_image` reads only the fields, allocates nothing and is cheap enough for a callback;
`decode_image` touches the pixels. What has 16 bits keeps them: `grey_range` brings the two views
of a pair to 8 together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

Pixels = NDArray[Any]

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
    convert : callable from (rows, W[, C]) ndarray to (H, W) or (H, W, 3), or None
        None where the pixels are grey or BGR already.
    even_width, even_height : bool
        Two pixels share their colour.
    smallest : int
        Least width and height from which the conversion can work.
    rows : Fraction
        Rows of data for each row of the image: more than 1 where colour is a plane of its own.

    """

    channels: int
    item_bytes: int = 1
    convert: Callable[[Pixels], Pixels] | None = None
    even_width: bool = False
    even_height: bool = False
    smallest: int = 1
    rows: Fraction = Fraction(1)


def _color(code: int) -> Callable[[Pixels], Pixels]:
    return lambda pixels: cv2.cvtColor(pixels, code)


def _bayer(code: int, item_bytes: int) -> Encoding:
    return Encoding(1, item_bytes, _color(code), smallest=4)


def _half_color(code: int) -> Encoding:
    """Describe 4:2:0: grey, then a plane of half the size both ways for both colours."""
    return Encoding(1, 1, _color(code), even_width=True, even_height=True, rows=Fraction(3, 2))


def _stretch(low: int, high: int, center: int, target: int) -> Pixels:
    """Return a table from the range of video, `low` to `high`, to all 8 bits."""
    levels = (np.arange(256) - center) * (255.0 / (high - low)) + target
    return np.rint(np.clip(levels, 0, 255)).astype(np.uint8)


_LUMA, _CHROMA = _stretch(16, 235, 16, 0), _stretch(16, 240, 128, 128)


def _nv24(pixels: Pixels) -> Pixels:
    """Convert 4:4:4, grey and then U, V in turn, which OpenCV does not know."""
    height = pixels.shape[0] // 3
    luma = _LUMA[pixels[:height]]
    chroma = _CHROMA[pixels[height:]].reshape(height, -1, 2)
    return cv2.cvtColor(np.dstack([luma, chroma[..., 1], chroma[..., 0]]), cv2.COLOR_YCrCb2BGR)


_RGB, _BGRA, _RGBA = (
    _color(code) for code in (cv2.COLOR_RGB2BGR, cv2.COLOR_BGRA2BGR, cv2.COLOR_RGBA2BGR))
_UYVY = Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_UYVY), even_width=True)
_YUYV = Encoding(2, convert=_color(cv2.COLOR_YUV2BGR_YUY2), even_width=True)
# OpenCV names a Bayer pattern by the second row and column, ROS by the first.
_BAYER = {'rggb': cv2.COLOR_BayerBG2BGR, 'bggr': cv2.COLOR_BayerRG2BGR,
          'gbrg': cv2.COLOR_BayerGR2BGR, 'grbg': cv2.COLOR_BayerGB2BGR}

ENCODINGS: dict[str, Encoding] = {
    'mono8': Encoding(1), '8UC1': Encoding(1),
    'mono16': Encoding(1, 2), '16UC1': Encoding(1, 2),
    'bgr8': Encoding(3), '8UC3': Encoding(3), 'rgb8': Encoding(3, convert=_RGB),
    'bgra8': Encoding(4, convert=_BGRA), '8UC4': Encoding(4, convert=_BGRA),
    'rgba8': Encoding(4, convert=_RGBA),
    'bgr16': Encoding(3, 2), '16UC3': Encoding(3, 2), 'rgb16': Encoding(3, 2, _RGB),
    'bgra16': Encoding(4, 2, _BGRA), '16UC4': Encoding(4, 2, _BGRA),
    'rgba16': Encoding(4, 2, _RGBA),
    'yuv422': _UYVY, 'uyvy': _UYVY, 'yuv422_yuy2': _YUYV, 'yuyv': _YUYV,
    'nv12': _half_color(cv2.COLOR_YUV2BGR_NV12), 'nv21': _half_color(cv2.COLOR_YUV2BGR_NV21),
    'nv24': Encoding(1, convert=_nv24, rows=Fraction(3)),
    **{f'bayer_{pattern}{8 * item_bytes}': _bayer(code, item_bytes)
       for item_bytes in (1, 2) for pattern, code in _BAYER.items()}}


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
    check_layout(name, message, encoding.channels * encoding.item_bytes, encoding.rows)
    if encoding.even_width and message.width % 2 or encoding.even_height and message.height % 2:
        raise BadMessage('encoding', f'{name}: {message.encoding} of odd size '
                         f'{message.width} x {message.height}')
    if min(message.width, message.height) < encoding.smallest:
        raise BadMessage(
            'encoding', f'{name}: {message.encoding} of {message.width} x {message.height}')
    return encoding


def check_layout(name: str, message: ImageFields, pixel_bytes: int,
                 rows: Fraction = Fraction(1)) -> None:
    """Check size, step and amount of data of an image message; nothing is allocated."""
    width, height, step = message.width, message.height, message.step
    check_size(name, width, height)
    if step < width * pixel_bytes:
        raise BadMessage(
            'step', f'{name}: step {step}, a row of {width} {message.encoding} '
            f'needs {width * pixel_bytes} bytes')
    needed = step * height * rows
    if len(message.data) != needed and not _is_packed(message, pixel_bytes, rows):
        raise BadMessage(
            'data_size', f'{name}: {len(message.data)} bytes of data, step {step} x height '
            f'{height}{f" x {rows}" if rows > 1 else ""} is {float(needed):.0f}')


def check_size(name: str, width: int, height: int) -> None:
    """Check that an image is neither empty nor larger than can be worked on."""
    if width == 0 or height == 0:
        raise BadMessage('zero_size', f'{name}: size {width} x {height}')
    if width > MAX_SIDE or height > MAX_SIDE:
        raise BadMessage(
            'too_large', f'{name}: {width} x {height}, at most {MAX_SIDE} pixels a side')
    if width * height > MAX_PIXELS:
        raise BadMessage(
            'too_large', f'{name}: {width} x {height}, at most {MAX_PIXELS} pixels')


def pixels_of(message: ImageFields, channels: int, dtype: np.dtype[Any],
              rows: Fraction = Fraction(1)) -> Pixels:
    """View the data of a checked message as (rows, W) or (rows, W, channels), padding cut off."""
    count, width = int(message.height * rows), message.width
    row_bytes = width * channels * dtype.itemsize
    data = np.frombuffer(message.data, np.uint8).reshape(count, -1)
    packed = np.ascontiguousarray(data[:, :row_bytes]).view(dtype)
    return packed.reshape((count, width) if channels == 1 else (count, width, channels))


def decode_image(name: str, message: ImageFields) -> Pixels:
    """
    Turn an image message into contiguous pixels.

    Parameters
    ----------
    name : str
        What the message is called in an error.
    message : sensor_msgs.msg.Image
        Any encoding of `ENCODINGS`, any step, either byte order.

    Returns
    -------
    uint8 or uint16 ndarray of shape (H, W) for grey or (H, W, 3) in BGR order
        Not to be written to: it may share the message's memory.

    Raises
    ------
    BadMessage
        As `check_image`.

    """
    encoding = check_image(name, message)
    pixels = pixels_of(message, encoding.channels, _dtype(encoding, message), encoding.rows)
    pixels = pixels.astype(pixels.dtype.newbyteorder('='), copy=False)
    if encoding.convert is None:
        return pixels
    converted = np.asarray(encoding.convert(pixels))
    return converted.reshape((message.height, message.width) + converted.shape[2:])


def _dtype(encoding: Encoding, message: ImageFields) -> np.dtype[Any]:
    if encoding.item_bytes == 1:
        return np.dtype(np.uint8)
    return np.dtype('>u2' if message.is_bigendian else '<u2')


def _is_packed(message: ImageFields, pixel_bytes: int, rows: Fraction) -> bool:
    """Whether planes lie end to end; then some drivers count the bytes of all in the step."""
    return rows > 1 and len(message.data) == message.width * pixel_bytes * message.height * rows
