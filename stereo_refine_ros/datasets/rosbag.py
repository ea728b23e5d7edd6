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

"""Stereo pairs out of a rosbag2, in code: exact and repeatable, without ROS."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import sqlite3
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys import get_typestore, Stores

from stereo_refine_ros.encodings import decode_image
from stereo_refine_ros.types import Image, StereoGeometry, StereoPair

IMAGE_TYPE = 'sensor_msgs/msg/Image'
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'
IMAGE_TOPICS = ('left/image_rect', 'right/image_rect')
_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class BagPair:
    """
    One pair of a bag.

    Attributes
    ----------
    stamp_ns : int
        Stamp of the left image.
    pair : StereoPair
    geometry : StereoGeometry or None
        From the newest camera_info of both views, None while there is none.

    """

    stamp_ns: int
    pair: StereoPair
    geometry: StereoGeometry | None


def iterate_pairs(path: str | Path, left_topic: str = IMAGE_TOPICS[0],
                  right_topic: str = IMAGE_TOPICS[1], slop_s: float = 0.0,
                  queue_size: int = 10) -> Iterator[BagPair]:
    """
    Yield the stereo pairs of a bag in the order in which they became complete.

    Parameters
    ----------
    path : str or Path
        Folder of the bag, or its .mcap or .db3 file.
    left_topic, right_topic : str
        Recorded names, or their ends where only one image topic ends so. The camera_info of
        each is looked for beside it.
    slop_s : float
        Largest difference of the stamps of a pair, in seconds.
    queue_size : int
        Images kept per view while waiting for their partner.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag or topic, or an image cannot be decoded.

    """
    store = get_typestore(Stores.ROS2_JAZZY)
    with open_bag(path) as reader:
        role_of = _roles(reader.connections, left_topic, right_topic)
        wanted = [item for item in reader.connections if item.topic in role_of]
        waiting: dict[str, dict[int, Image]] = {'left': {}, 'right': {}}
        infos: dict[str, Any] = {}
        for connection, _, raw in reader.messages(wanted):
            message = store.deserialize_cdr(raw, connection.msgtype)
            role = role_of[connection.topic]
            if role.endswith('_info'):
                infos[role] = message
                continue
            complete = _offer(waiting, role, message, round(slop_s * _NS), queue_size)
            if complete is not None:
                yield BagPair(*complete, _geometry(infos))


@contextmanager
def open_bag(path: str | Path) -> Iterator[Reader]:
    """
    Open a rosbag2, mcap or sqlite3.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag, or it cannot be read.

    """
    if not Path(path).exists():
        raise FileNotFoundError(f'bag: {path} does not exist')
    try:
        reader = Reader(path)
        reader.open()
    except (ReaderError, OSError, sqlite3.Error) as error:
        raise ValueError(f'bag: {path}: {error}') from error
    try:
        yield reader
    except (ReaderError, sqlite3.Error) as error:
        raise ValueError(f'bag: {path}: {error}') from error
    finally:
        reader.close()


def find_topic(connections: list[Connection], name: str, kind: str) -> str:
    """
    Return the one recorded topic of type `kind` that is called `name` or ends so.

    Raises
    ------
    ValueError
        When there is none, or more than one, listing those there are.

    """
    topics = sorted({item.topic for item in connections if item.msgtype == kind})
    exact = [topic for topic in topics if topic.strip('/') == name.strip('/')]
    ending = [topic for topic in topics if topic.endswith('/' + name.strip('/'))]
    found = exact or ending
    if len(found) != 1:
        raise ValueError(f'bag: {len(found) or "no"} topics called {name}; '
                         f'{kind} topics are {", ".join(topics) or "none"}')
    return found[0]


def _roles(connections: list[Connection], left_topic: str, right_topic: str) -> dict[str, str]:
    roles = {}
    recorded = {item.topic for item in connections if item.msgtype == INFO_TYPE}
    for role, name in (('left', left_topic), ('right', right_topic)):
        topic = find_topic(connections, name, IMAGE_TYPE)
        roles[topic] = role
        info = topic.rpartition('/')[0] + '/camera_info'
        if info in recorded:
            roles[info] = f'{role}_info'
    return roles


def _offer(waiting: dict[str, dict[int, Image]], role: str, message: Any, slop_ns: int,
           queue_size: int) -> tuple[int, StereoPair] | None:
    """Take an image in; return its stamp and pair when the partner is already there."""
    stamp = message.header.stamp.sec * _NS + message.header.stamp.nanosec
    other = 'right' if role == 'left' else 'left'
    partner = min(waiting[other], key=lambda candidate: abs(candidate - stamp), default=None)
    image = decode_image(role, message)
    if partner is None or abs(partner - stamp) > slop_ns:
        waiting[role][stamp] = image
        while len(waiting[role]) > queue_size:
            del waiting[role][next(iter(waiting[role]))]
        return None
    views = {role: image, other: waiting[other].pop(partner)}
    return (stamp if role == 'left' else partner), StereoPair(views['left'], views['right'])


def _geometry(infos: dict[str, Any]) -> StereoGeometry | None:
    if len(infos) < 2:
        return None
    left, right = infos['left_info'].p, infos['right_info'].p
    if right[0] == 0:
        return None
    return StereoGeometry(float(right[0]), float(-right[3] / right[0]), float(left[2]),
                          float(left[6]), float(right[2]))
