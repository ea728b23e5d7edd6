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

"""Record stereo pairs into a rosbag2, for tests."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='rosbags (python3-rosbags-pip) is not installed')

from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import get_typestore, Stores  # noqa: E402

from stereo_refine_ros.types import StereoGeometry  # noqa: E402

STORE = get_typestore(Stores.ROS2_JAZZY)
STORAGES = {'mcap': StoragePlugin.MCAP, 'sqlite3': StoragePlugin.SQLITE3}
NS = 1_000_000_000


def header(stamp_ns, frame_id='left_camera_optical_frame'):
    time = STORE.types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, NS))
    return STORE.types['std_msgs/msg/Header'](time, frame_id)


def image(stamp_ns, pixels, encoding=None):
    pixels = np.ascontiguousarray(pixels)
    encoding = encoding or ('mono8' if pixels.ndim == 2 else 'bgr8')
    return STORE.types['sensor_msgs/msg/Image'](
        header(stamp_ns), pixels.shape[0], pixels.shape[1], encoding, 0,
        pixels.nbytes // pixels.shape[0], pixels.reshape(-1).view(np.uint8))


def compressed(stamp_ns, data, kind):
    return STORE.types['sensor_msgs/msg/CompressedImage'](
        header(stamp_ns), kind, np.frombuffer(bytes(data), np.uint8))


def raw_camera_info(stamp_ns, model):
    """Return the message of a `CameraModel`."""
    region = STORE.types['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
    return STORE.types['sensor_msgs/msg/CameraInfo'](
        header(stamp_ns), model.height, model.width, model.distortion_model,
        *(np.array(values, np.float64) for values in (model.d, model.k, model.r, model.p)),
        0, 0, region)


def camera_info(stamp_ns, geometry: StereoGeometry, is_right, height, width):
    f, cx = geometry.focal_px, geometry.cx_right if is_right else geometry.cx_left
    shift = -f * geometry.baseline_m if is_right else 0.0
    region = STORE.types['sensor_msgs/msg/RegionOfInterest'](0, 0, 0, 0, False)
    return STORE.types['sensor_msgs/msg/CameraInfo'](
        header(stamp_ns), height, width, 'plumb_bob', np.zeros(5),
        np.array([f, 0, cx, 0, f, geometry.cy, 0, 0, 1.0]), np.eye(3).ravel(),
        np.array([f, 0, cx, shift, 0, f, geometry.cy, 0, 0, 0, 1, 0.0]), 0, 0, region)


def write_messages(path: Path, storage, messages, damaged=()):
    """
    Write (topic, recorded ns, message) triples; return the raw bytes of each topic.

    Of messages recorded at `damaged` only the first bytes are written.
    """
    raw_of = {}
    with Writer(path, version=9, storage_plugin=STORAGES[storage]) as writer:
        connection_of = {}
        for topic, stamp_ns, message in messages:
            kind = message.__msgtype__
            if topic not in connection_of:
                connection_of[topic] = writer.add_connection(topic, kind, typestore=STORE)
            raw = bytes(STORE.serialize_cdr(message, kind))
            raw = raw if stamp_ns not in damaged else raw[:40]
            writer.write(connection_of[topic], stamp_ns, raw)
            raw_of.setdefault(topic, []).append(raw)
    return raw_of


def pair_messages(pairs, geometry, period_ns=NS // 10, start_ns=1000 * NS, prefix='/'):
    """Yield the four messages of every pair as `write_messages` takes them."""
    for index, (left, right) in enumerate(pairs):
        stamp = start_ns + index * period_ns
        height, width = left.shape[:2]
        for side, pixels in (('left', left), ('right', right)):
            info = camera_info(stamp, geometry, side == 'right', height, width)
            yield f'{prefix}{side}/camera_info', stamp, info
            yield f'{prefix}{side}/image_rect', stamp, image(stamp, pixels)
