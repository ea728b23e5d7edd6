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
Malformed messages, made from a seed: for `fuzz.py`, and for the tests of faults.

`random_image`, `random_info` and `random_disparity` draw every field from values that break
code. `HARMFUL` and `HARMLESS` are single defects of an otherwise good set of messages: a harmful
one must never be answered with a disparity, a harmless one must be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.encodings import ENCODINGS

Messages = dict[str, Any]
Defect = Callable[[Messages, np.random.Generator], None]

LEFT, RIGHT = 'left/image_rect', 'right/image_rect'
LEFT_INFO, RIGHT_INFO = 'left/camera_info', 'right/camera_info'
PRELIMINARY = 'preliminary/disparity'
NUMBERS = (0.0, -0.0, -1.0, 1.0, 0.1, 100.0, 5e-324, 1e-30, 1e30, 1e300, -1e300, float('nan'),
           float('inf'), float('-inf'))
SIZES = (0, 1, 2, 3, 4, 7, 16, 33, 16385, 65536, 2 ** 31, 2 ** 32 - 1)
STRANGE_ENCODINGS = ('', 'MONO8', 'mono8 ', 'mono', '32FC1', '64FC4', 'bgr15', 'jpeg', 'nv61',
                     'x' * 3000, '\u00e9\u4e2d', 'mono8\n', '8UC', '8UC-1')
DATA_LIMIT = 1 << 16


def pick(rng: np.random.Generator, values: Any) -> Any:
    """Return one of a sequence's values, of its own type."""
    return values[int(rng.integers(len(values)))]


def fill(message: Image, length: int, rng: np.random.Generator) -> None:
    """Give an image message random bytes, never more than a fuzzer can afford."""
    message.data.frombytes(rng.bytes(max(0, min(length, DATA_LIMIT))))


def random_image(rng: np.random.Generator, encodings: tuple[str, ...] = tuple(ENCODINGS)
                 ) -> Image:
    """Draw an image whose fields may or may not fit each other."""
    message = Image(is_bigendian=int(rng.integers(256)))
    message.encoding = pick(rng, encodings if rng.random() < 0.85 else STRANGE_ENCODINGS)
    message.width, message.height = (
        int(rng.integers(1, 20)) if rng.random() < 0.8 else pick(rng, SIZES) for _ in range(2))
    needed = message.width * pixel_bytes(message.encoding)
    step = needed + pick(rng, (0, 0, 0, 0, 1, 5, -1, -needed, 2 ** 31))
    message.step = min(max(step, 0), 2 ** 32 - 1)
    layout = ENCODINGS.get(message.encoding)
    length = int(message.step * message.height * (1 if layout is None else layout.rows))
    fill(message, length + pick(rng, (0, 0, 0, 0, -1, 1, -40, 999)), rng)
    return message


def pixel_bytes(encoding: str) -> int:
    """Return the bytes of a pixel, 4 for what is no known encoding."""
    layout = ENCODINGS.get(encoding)
    return 4 if layout is None else layout.channels * layout.item_bytes


def random_info(rng: np.random.Generator, width: int, height: int) -> CameraInfo:
    """Draw a calibration that may or may not make sense for an image size."""
    message = CameraInfo(width=width, height=height)
    p = [100.0, 0.0, 8.0, -10.0, 0.0, 100.0, 8.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    for i in range(12):
        if rng.random() < 0.05:
            p[i] = pick(rng, NUMBERS)
    message.p = p if rng.random() < 0.97 else p[:int(rng.integers(12))]
    for field in ('width', 'height', 'binning_x', 'binning_y'):
        if rng.random() < 0.05:
            setattr(message, field, pick(rng, SIZES))
    for field in ('x_offset', 'y_offset', 'width', 'height'):
        if rng.random() < 0.05:
            setattr(message.roi, field, pick(rng, SIZES))
    return message


def random_disparity(rng: np.random.Generator) -> DisparityImage:
    """Draw a disparity message with any declaration and any floats."""
    message = DisparityImage(image=random_image(rng, ('32FC1',)))
    size = len(message.image.data) // 4 * 4
    values = rng.uniform(-5, 40, size // 4).astype('<f4')
    strange = rng.random(values.size) < 0.2
    with np.errstate(over='ignore'):
        values[strange] = rng.choice(NUMBERS, np.count_nonzero(strange)).astype('<f4')
    message.image.data[:size] = type(message.image.data)('B', values.tobytes())
    for field, usual in (('f', 100.0), ('t', 0.1), ('min_disparity', 0.0),
                         ('max_disparity', 31.0), ('delta_d', 0.0625)):
        with np.errstate(over='ignore'):  # the fields are float32 on the wire
            strange_one = float(np.float32(pick(rng, NUMBERS)))
        setattr(message, field, usual if rng.random() < 0.7 else strange_one)
    return message


def _either_image(messages: Messages, rng: np.random.Generator) -> Image:
    return messages[pick(rng, [name for name in (LEFT, RIGHT) if name in messages])]


def _either_info(messages: Messages, rng: np.random.Generator) -> CameraInfo:
    return messages[pick(rng, (LEFT_INFO, RIGHT_INFO))]


def _resize(message: Image, length: int, rng: np.random.Generator) -> None:
    del message.data[:]
    fill(message, length, rng)


def _encoding(messages: Messages, rng: np.random.Generator) -> None:
    _either_image(messages, rng).encoding = pick(rng, STRANGE_ENCODINGS)


def _wider_encoding(messages: Messages, rng: np.random.Generator) -> None:
    _either_image(messages, rng).encoding = 'bgra8'


def _empty(messages: Messages, rng: np.random.Generator) -> None:
    setattr(_either_image(messages, rng), pick(rng, ('width', 'height')), 0)


def _absurd_size(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    message.width, message.height = pick(rng, SIZES[-4:]), pick(rng, SIZES[-6:])
    message.step = min(message.width * 3, 2 ** 32 - 1)


def _short_step(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    message.step = int(rng.integers(message.step))


def _long_step(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    message.step += int(rng.integers(1, 2 ** 31))


def _truncated(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    _resize(message, int(rng.integers(len(message.data))), rng)


def _oversized(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    _resize(message, len(message.data) + int(rng.integers(1, 5000)), rng)


def _sizes_differ(messages: Messages, rng: np.random.Generator) -> None:
    message = messages[RIGHT]
    message.height += int(rng.integers(1, 9))
    _resize(message, message.step * message.height, rng)


def _info_size(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_info(messages, rng)
    setattr(message, pick(rng, ('width', 'height')), int(rng.integers(1, 2 ** 32)))
    if rng.random() < 0.3:
        message.binning_x = int(rng.integers(100, 2 ** 32))


def _focal_length(messages: Messages, rng: np.random.Generator) -> None:
    _either_info(messages, rng).p[pick(rng, (0, 5))] = pick(
        rng, [value for value in NUMBERS if not 0.01 <= value <= 1e5])


def _principal_point(messages: Messages, rng: np.random.Generator) -> None:
    _either_info(messages, rng).p[pick(rng, (2, 6))] = pick(
        rng, [value for value in NUMBERS if not abs(value) <= 1e6])


def _baseline(messages: Messages, rng: np.random.Generator) -> None:
    messages[RIGHT_INFO].p[3] = pick(
        rng, (1.0, 20.0, 1e300, -1e300, *map(float, ('nan', 'inf', '-inf'))))


def _no_baseline(messages: Messages, rng: np.random.Generator) -> None:
    messages[RIGHT_INFO].p[3] = pick(rng, (0.0, -5e-324))


def _projection_length(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_info(messages, rng)
    message.p = [100.0] * int(rng.integers(12))


def _stamp_of_image(messages: Messages, rng: np.random.Generator) -> None:
    # Always of the right one: a left one of an earlier set would fit its stamp.
    _stamp_apart(messages[RIGHT], rng)


def _stamp_of_info(messages: Messages, rng: np.random.Generator) -> None:
    _stamp_apart(_either_info(messages, rng), rng)


def _stamp_apart(message: Any, rng: np.random.Generator) -> None:
    """Set a stamp apart: at 0, in the past, in the future, or nearly right."""
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = pick(rng, (
        (0, 0), (stamp.sec, stamp.nanosec + 1), (2 ** 31 - 1, 999_999_999),
        (-2 ** 31, 0), (stamp.sec, 2 ** 32 - 1), (max(0, stamp.sec - 3600), stamp.nanosec)))


def _padding(messages: Messages, rng: np.random.Generator) -> None:
    for name in (LEFT, RIGHT):
        message, extra = messages[name], int(rng.integers(1, 30))
        rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, -1)
        padded = np.pad(rows, ((0, 0), (0, extra)), constant_values=int(rng.integers(256)))
        message.step += extra
        del message.data[:]
        message.data.frombytes(padded.tobytes())


def _unused_fields(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_info(messages, rng)
    message.d = [pick(rng, NUMBERS) for _ in range(int(rng.integers(20)))]
    message.k, message.r = ([pick(rng, NUMBERS) for _ in range(9)] for _ in range(2))
    message.distortion_model = pick(rng, STRANGE_ENCODINGS)


def _byte_order(messages: Messages, rng: np.random.Generator) -> None:
    _either_image(messages, rng).is_bigendian = int(rng.integers(1, 256))


def _noise(messages: Messages, rng: np.random.Generator) -> None:
    message = _either_image(messages, rng)
    _resize(message, len(message.data), rng)


def _constant(messages: Messages, rng: np.random.Generator) -> None:
    message, value = _either_image(messages, rng), int(rng.integers(256))
    size = len(message.data)
    del message.data[:]
    message.data.frombytes(bytes([value]) * size)


def _sixteen_bits(messages: Messages, rng: np.random.Generator) -> None:
    """Flood with 16-bit images whose range is another one each time, from none to all."""
    low, high = sorted(int(value) for value in rng.integers(0, 65536, 2))
    for name in (LEFT, RIGHT):
        message = messages[name]
        message.encoding, message.step = 'mono16', 2 * message.width
        deep = rng.integers(low, high + 1, (message.height, message.width)).astype('<u2')
        del message.data[:]
        message.data.frombytes(deep.tobytes())


def _odd_stamp(messages: Messages, rng: np.random.Generator) -> None:
    """Stamp the whole set alike, at a time that no clock shows."""
    sec = pick(rng, (0, -1, -2 ** 31, 2 ** 31 - 1))
    for message in messages.values():
        message.header.stamp.sec = sec


HARMFUL: dict[str, Defect] = {
    'encoding': _encoding, 'wider encoding': _wider_encoding, 'empty': _empty,
    'absurd size': _absurd_size, 'short step': _short_step, 'long step': _long_step,
    'truncated': _truncated, 'oversized': _oversized, 'sizes differ': _sizes_differ,
    'camera_info size': _info_size, 'baseline': _baseline, 'one stamp': _stamp_of_image}
# Without a usable calibration the disparity comes, without depth.
HARMLESS: dict[str, Defect] = {
    'focal length': _focal_length, 'principal point': _principal_point,
    'no baseline': _no_baseline, 'length of P': _projection_length,
    'stamp of camera_info': _stamp_of_info,
    'padding': _padding, 'unused fields': _unused_fields, 'byte order': _byte_order,
    'noise': _noise, 'constant': _constant, '16 bits': _sixteen_bits,
    'odd stamp': _odd_stamp}
