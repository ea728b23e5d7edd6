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

"""Malformed compressed images, made from a seed: bombs, cut-off and damaged files, other sizes."""

from __future__ import annotations

from collections.abc import Callable
import struct

import cv2
from malformed import LEFT, Messages, pick, RIGHT
import numpy as np
from sensor_msgs.msg import CompressedImage, Image

COMPRESSED = '/compressed'
FORMATS = {'.png': 'bgr8; png compressed bgr8', '.jpg': 'bgr8; jpeg compressed bgr8'}
STRANGE_FORMATS = ('', 'jpeg', 'png', 'h264', '16UC1; compressedDepth png', 'x' * 3000, '\u4e2d;',
                   'bayer_rggb8; png compressed', 'rgb8; png compressed rgb8', ';;;')
Spoil = Callable[[bytes, np.random.Generator], bytes]


def compressed(image: Image, suffix: str) -> CompressedImage:
    """Compress a bgr8 image message, as image_transport does."""
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
    message = CompressedImage(header=image.header, format=FORMATS[suffix])
    message.data.frombytes(cv2.imencode(suffix, pixels)[1].tobytes())
    return message


def compress(messages: Messages, rng: np.random.Generator) -> Messages:
    """Return a set of messages with its images compressed, under their own names."""
    suffix = pick(rng, list(FORMATS))
    return {(topic + COMPRESSED if topic in (LEFT, RIGHT) else topic):
            (compressed(message, suffix) if topic in (LEFT, RIGHT) else message)
            for topic, message in messages.items()}


def random_compressed(rng: np.random.Generator) -> CompressedImage:
    """Draw a file, some of it changed or cut off, under any format."""
    channels = pick(rng, (1, 3, 4))
    shape = (int(rng.integers(1, 20)), int(rng.integers(1, 20)), channels)
    pixels = rng.integers(0, 256, shape, np.uint8)
    suffix = pick(rng, ('.png', '.jpg'))
    if suffix == '.png' and rng.random() < 0.3:
        pixels = pixels.astype(np.uint16) * 257
    data = bytearray(cv2.imencode(suffix, pixels if channels < 4 or suffix == '.png'
                                  else pixels[..., :3])[1].tobytes())
    for _ in range(pick(rng, (0, 0, 1, 1, 5))):
        data[int(rng.integers(len(data)))] = int(rng.integers(256))
    if rng.random() < 0.2:
        data = data[:int(rng.integers(len(data)))]
    message = CompressedImage(format=pick(rng, STRANGE_FORMATS))
    message.data.frombytes(bytes(data))
    return message


def spoil(messages: Messages, name: str, rng: np.random.Generator) -> None:
    """Give one image of a compressed set one defect."""
    message = messages[pick(rng, (LEFT, RIGHT)) + COMPRESSED]
    data = SPOILS[name](bytes(message.data), rng)
    del message.data[:]
    message.data.frombytes(data)


def _bomb(data: bytes, rng: np.random.Generator) -> bytes:
    """Claim a size that no memory holds."""
    width, height = (int(side) for side in rng.integers(20000, 65536, 2))
    if data[:1] == b'\x89':
        return data[:16] + struct.pack('>II', width, height) + data[24:]
    at = data.index(b'\xff\xc0') + 5
    return data[:at] + struct.pack('>HH', height, width) + data[at + 4:]


def _cut_off(data: bytes, rng: np.random.Generator) -> bytes:
    return data[:int(rng.integers(len(data) - 1))]


def _another_size(data: bytes, rng: np.random.Generator) -> bytes:
    shape = (int(rng.integers(4, 40)), int(rng.integers(4, 40)), 3)
    return bytes(cv2.imencode('.png', rng.integers(0, 256, shape, np.uint8))[1].tobytes())


def _no_image(data: bytes, rng: np.random.Generator) -> bytes:
    return bytes(pick(rng, (b'', b'\0' * 500, b'GIF89a' + data, b'\0\0\0\x01g' + data)))


SPOILS: dict[str, Spoil] = {
    'bomb': _bomb, 'cut off': _cut_off, 'another size': _another_size, 'no image': _no_image}
