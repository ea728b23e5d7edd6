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

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.typesys import get_typestore, Stores

from stereo_refine_ros.encodings import decode_image
from stereo_refine_ros.grey_range import same_kind, SteadyRange
from stereo_refine_ros.pairing import Pairing
from stereo_refine_ros.types import StereoPair

IMAGE_TYPE = 'sensor_msgs/msg/Image'
IMAGE_TOPICS = ('left/image_rect', 'right/image_rect')
_SIDES = ('left', 'right')
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

    """

    stamp_ns: int
    pair: StereoPair


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
    steady = SteadyRange()
    pairing = Pairing(_SIDES, slop_ns=round(slop_s * _NS), queue_size=queue_size)
    with open_bag(path) as reader:
        side_of = _sides(reader.connections, left_topic, right_topic)
        wanted = [item for item in reader.connections if item.topic in side_of]
        for connection, recorded_ns, raw in reader.messages(wanted):
            message = store.deserialize_cdr(raw, connection.msgtype)
            stamp = message.header.stamp
            for found in pairing.add(side_of[connection.topic], stamp.sec * _NS + stamp.nanosec,
                                     message, recorded_ns / _NS):
                views = [decode_image(side, found.messages[side]) for side in _SIDES]
                yield BagPair(found.stamp_ns,
                              StereoPair(*same_kind(*steady.to_8bit(*views))))


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


def _sides(connections: list[Connection], left_topic: str, right_topic: str) -> dict[str, str]:
    return {find_topic(connections, name, IMAGE_TYPE): side
            for side, name in zip(_SIDES, (left_topic, right_topic), strict=True)}
