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
Images from the fields of a CompressedImage: JPEG and PNG, as image_transport and drivers send.

`check_compressed` reads the header of the file and no pixels: a small message can claim to be a
huge image, and it is refused before anything is allocated for it.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct
from typing import Any, Protocol
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.encodings import BadMessage, check_size, ENCODINGS

_PNG = b'\x89PNG\r\n\x1a\n'
_JPEG = b'\xff\xd8'
_JPEG_END = b'\xff\xd9'
# Frame headers of JPEG (SOF): all of 0xC0 to 0xCF but tables (C4, CC) and the reserved C8.
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
# No file of ours needs more for a pixel; scans without end would keep the decoder busy.
_MOST_BYTES_A_PIXEL = 12
_HEADER_BYTES = 1 << 16
_COLORS = {'rgb8', 'bgr8', 'rgba8', 'bgra8', 'rgb16', 'bgr16', 'rgba16', 'bgra16'}


class CompressedFields(Protocol):
    """The fields of sensor_msgs/CompressedImage, from whatever library."""

    format: str  # noqa: A003
    data: Any


@dataclass(frozen=True)
class CompressedHeader:
    """
    What a compressed image says of itself before it is decoded.

    Attributes
    ----------
    width, height : int
        Pixels.
    kind : str
        'jpeg' or 'png'.
    encoding : str
        Of the image before compression, '' where the format does not name it.
    is_swapped : bool
        Whether red and blue were not exchanged before compression, as OpenCV expects.

    """

    width: int
    height: int
    kind: str
    encoding: str
    is_swapped: bool


def check_compressed(name: str, message: CompressedFields) -> CompressedHeader:
    """
    Check a compressed image by its format and the header of its data.

    Parameters
    ----------
    name : str
        What the message is called in an error.
    message : sensor_msgs.msg.CompressedImage
        Its format may be that of image_transport, `bgr8; jpeg compressed bgr8`, or a driver's
        plain `jpeg` or `png`; what the data are is read from the data.

    Raises
    ------
    BadMessage
        With reason 'encoding', 'data_size', 'zero_size' or 'too_large'.

    """
    data = memoryview(message.data).cast('B')
    encoding, _, rest = message.format.partition(';')
    encoding, rest = encoding.strip(), rest.strip()
    if 'compressedDepth' in message.format:
        raise BadMessage('encoding', f'{name}: format {message.format[:40]!r} is a depth map; '
                         'expected an image as jpeg or png')
    start = bytes(data[:len(_PNG)])
    if start == _PNG:
        kind, (width, height) = 'png', _png_size(name, data)
    elif start.startswith(_JPEG):
        kind, (width, height) = 'jpeg', _jpeg_size(name, data)
    else:
        raise BadMessage(
            'encoding', f'{name}: format {message.format[:40]!r}, and the data are neither jpeg '
            'nor png; set the transport to one of these, or decode before this node')
    check_size(name, width, height)
    if len(data) > _HEADER_BYTES + width * height * _MOST_BYTES_A_PIXEL:
        raise BadMessage('data_size', f'{name}: {len(data)} bytes for {width} x {height} pixels')
    is_swapped = encoding in _COLORS and bool(rest) and 'compressed bgr' not in rest
    return CompressedHeader(width, height, kind, encoding, is_swapped)


def decode_compressed(name: str, message: CompressedFields) -> NDArray[Any]:
    """
    Decode a compressed image.

    Returns
    -------
    uint8 or uint16 ndarray of shape (H, W) for grey or (H, W, 3) in BGR order

    Raises
    ------
    BadMessage
        As `check_compressed`, and with reason 'data_size' for data that are cut off or damaged.

    """
    header = check_compressed(name, message)
    data = memoryview(message.data).cast('B')
    (_check_png if header.kind == 'png' else _check_jpeg)(name, data)
    try:
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise BadMessage('data_size', f'{name}: {header.kind}: {error.err}') from error
    if pixels is None or pixels.shape[:2] != (header.height, header.width):
        raise BadMessage('data_size', f'{name}: the {header.kind} is damaged')
    if pixels.dtype not in (np.uint8, np.uint16):
        raise BadMessage('encoding', f'{name}: pixels are {pixels.dtype}')
    return _colors(name, pixels, header)


def _colors(name: str, pixels: NDArray[Any], header: CompressedHeader) -> NDArray[Any]:
    """Make grey or BGR of decoded pixels: drop alpha, exchange red and blue, undo Bayer."""
    if pixels.ndim == 3 and pixels.shape[2] == 4:
        pixels = pixels[..., :3]
    if pixels.ndim == 3 and header.is_swapped:
        pixels = pixels[..., ::-1]
    if pixels.ndim == 2 and header.encoding.startswith('bayer_'):
        pattern = ENCODINGS.get(header.encoding)
        if pattern is None or pattern.convert is None or min(pixels.shape) < pattern.smallest:
            raise BadMessage('encoding', f'{name}: {header.encoding[:40]!r} of '
                             f'{header.width} x {header.height}')
        pixels = pattern.convert(pixels)
    return np.ascontiguousarray(pixels)


def _png_size(name: str, data: memoryview) -> tuple[int, int]:
    if len(data) < 26 or data[12:16] != b'IHDR':
        raise BadMessage('data_size', f'{name}: the png is cut off')
    width, height = struct.unpack_from('>II', data, 16)
    return width, height


def _jpeg_size(name: str, data: memoryview) -> tuple[int, int]:
    """Walk the segments of a JPEG up to its frame header."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # padding between segments
            at += 1
            continue
        if marker in _JPEG_FRAMES:
            height, width = struct.unpack_from('>HH', data, at + 5)
            return width, height
        if marker == 0xDA or marker == 0xD9:
            break
        is_bare = marker == 0x01 or 0xD0 <= marker <= 0xD7
        at += 2 if is_bare else 2 + struct.unpack_from('>H', data, at + 2)[0]
    raise BadMessage('data_size', f'{name}: the jpeg is cut off or damaged: no frame header')


def _check_jpeg(name: str, data: memoryview) -> None:
    """Look for the end: OpenCV paints what is missing grey, and says so to stderr alone."""
    if not bytes(data[-_HEADER_BYTES:]).rstrip(b'\0').endswith(_JPEG_END):
        raise BadMessage('data_size', f'{name}: the jpeg is cut off: {len(data)} bytes, and no '
                         'end-of-image mark')


def _check_png(name: str, data: memoryview) -> None:
    """Walk the chunks of a PNG, their checksums too, up to its end."""
    at = len(_PNG)
    while at + 12 <= len(data):
        length, = struct.unpack_from('>I', data, at)
        end = at + 12 + length
        if end > len(data):
            break
        if zlib.crc32(data[at + 4:end - 4]) != struct.unpack_from('>I', data, end - 4)[0]:
            raise BadMessage('data_size', f'{name}: the png is damaged: a checksum differs')
        if data[at + 4:at + 8] == b'IEND':
            return
        at = end
    raise BadMessage('data_size', f'{name}: the png is cut off: {len(data)} bytes')
