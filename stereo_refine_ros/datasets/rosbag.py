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

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores

from stereo_refine_ros.camera_info import CameraInfoFields
from stereo_refine_ros.datasets.bag_file import (
    bag_messages, COMPRESSED, find_image_topic, INFO_TYPE, open_bag)
from stereo_refine_ros.decoding import PairDecoder
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.pairing import MessageSet, Pairing
from stereo_refine_ros.types import StereoPair

_SIDES = ('left', 'right')
# What the images are called where nobody says: rectified ones first, or raw ones.
_RECTIFIED, _RAW = ('image_rect', 'image_rect_color'), ('image_raw',)
_NS = 1_000_000_000
_LOOKED_AT = 1000  # stamps, to say how far left and right are apart


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


@dataclass(frozen=True)
class BagOptions:
    """
    How pairs are read from a bag.

    Attributes
    ----------
    left_topic, right_topic : str
        Recorded names of raw or compressed images, or their ends where only one topic ends so;
        by default what is called left|right/image_rect (or image_raw).
    slop_s : float
        Largest difference of the stamps of a pair, in seconds.
    queue_size : int
        Images kept per view while waiting for their partner.
    rectify : bool
        Whether the images are raw and have to be rectified by the camera_info beside them.

    """

    left_topic: str = ''
    right_topic: str = ''
    slop_s: float = 0.0
    queue_size: int = 10
    rectify: bool = False

    def names(self, side: str) -> tuple[str, ...]:
        """Return the names by which the topic of a side is looked for."""
        given = self.left_topic if side == 'left' else self.right_topic
        kinds = _RAW + _RECTIFIED if self.rectify else _RECTIFIED + _RAW
        return (given,) if given else tuple(f'{side}/{kind}' for kind in kinds)


def _raise(text: str) -> None:
    raise ValueError(text)


def iterate_pairs(path: str | Path, options: BagOptions | None = None,
                  on_damaged: Callable[[str], None] = _raise) -> Iterator[BagPair]:
    """
    Yield the stereo pairs of a bag in the order in which they became complete.

    Parameters
    ----------
    path : str or Path
        Folder of the bag, or its .mcap or .db3 file.
    options : BagOptions, optional
        Topics, pairing, rectification.
    on_damaged : callable of str
        Told of each message or pair that cannot be used, which is left out then; by default a
        ValueError ends the reading.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag or topic, or no pair at all in it.

    """
    options = options or BagOptions()
    with open_bag(path) as reader:
        yield from _Pairs(reader, options, on_damaged)


class _Pairs:
    """Reads, pairs and decodes; counts what it needs for a message where nothing pairs."""

    def __init__(self, reader: Reader, options: BagOptions,
                 on_damaged: Callable[[str], None]) -> None:
        self._reader = reader
        self._on_damaged = on_damaged
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._side_of = {find_image_topic(reader.connections, *options.names(side)): side
                         for side in _SIDES}
        if len(self._side_of) < len(_SIDES):
            raise ValueError(f'bag: left and right are one topic, {next(iter(self._side_of))}')
        topics = list(self._side_of)
        self._decoder = PairDecoder((topics[0], topics[1]))
        self._pairing = Pairing(_SIDES, slop_ns=round(options.slop_s * _NS),
                                queue_size=options.queue_size)
        self._info_of = _info_topics(reader, self._side_of) if options.rectify else {}
        self._infos: dict[str, CameraInfoFields] = {}
        self._stamps: dict[str, list[int]] = {side: [] for side in _SIDES}

    def __iter__(self) -> Iterator[BagPair]:
        self._read_first_infos()
        has_pairs = False
        wanted = [item for item in self._reader.connections
                  if item.topic in self._side_of or item.topic in self._info_of]
        for connection, recorded_ns, raw in bag_messages(self._reader, wanted):
            message = self._deserialize(connection, recorded_ns, raw)
            if message is None:
                continue
            if connection.topic in self._info_of:
                self._infos[self._info_of[connection.topic]] = message
                continue
            for found in self._add(self._side_of[connection.topic], message, recorded_ns):
                pair = self._decode(found)
                if pair is not None:
                    has_pairs = True
                    yield BagPair(found.stamp_ns, pair)
        if not has_pairs:
            raise ValueError(f'bag: {self._reader.path}: no stereo pair; {self._why_none()}')

    def _read_first_infos(self) -> None:
        """Look ahead: the first image may come before the first camera_info."""
        for topic, side in self._info_of.items():
            wanted = [item for item in self._reader.connections if item.topic == topic]
            for connection, recorded_ns, raw in bag_messages(self._reader, wanted):
                message = self._deserialize(connection, recorded_ns, raw)
                if message is not None:
                    self._infos[side] = message
                    break

    def _deserialize(self, connection: Connection, recorded_ns: int, raw: bytes) -> Any:
        try:
            return self._store.deserialize_cdr(raw, connection.msgtype)
        except Exception as error:  # any byte may be wrong, and any of it then
            self._on_damaged(f'{connection.topic}, recorded at {recorded_ns / _NS:.3f} s: '
                             f'damaged message ({type(error).__name__}: {error})')
            return None

    def _add(self, side: str, message: Any, recorded_ns: int) -> list[MessageSet]:
        stamp_ns = message.header.stamp.sec * _NS + message.header.stamp.nanosec
        self._stamps[side].append(stamp_ns)
        return self._pairing.add(side, stamp_ns, message, recorded_ns / _NS)

    def _decode(self, found: MessageSet) -> StereoPair | None:
        infos = (self._infos['left'], self._infos['right']) if self._info_of else None
        try:
            return self._decoder.decode(found.messages['left'], found.messages['right'], infos)
        except BadMessage as error:
            self._on_damaged(f'pair stamped {found.stamp_ns / _NS:.3f} s: {error}')
            return None

    def _why_none(self) -> str:
        left, right = (self._stamps[side] for side in _SIDES)
        text = f'{len(left)} left and {len(right)} right images'
        if not left or not right:
            return text
        apart_ns = min(abs(stamp - min(right, key=lambda other: abs(other - stamp)))
                       for stamp in left[:_LOOKED_AT])
        if apart_ns == 0:
            return text
        slop_s = 1.5 * apart_ns / _NS
        return (f'{text}, their stamps are {apart_ns / 1e6:.3g} ms apart or more; pair them all '
                f'the same with -p sync.approximate=true -p sync.slop={slop_s:.2g}')


def _info_topics(reader: Reader, side_of: dict[str, str]) -> dict[str, str]:
    """Find the camera_info beside each image topic."""
    recorded = {item.topic for item in reader.connections
                if item.msgtype == INFO_TYPE and item.msgcount > 0}
    topics = {topic.removesuffix(COMPRESSED).rpartition('/')[0] + '/camera_info': side
              for topic, side in side_of.items()}
    missing = sorted(set(topics) - recorded)
    if missing:
        raise ValueError(f'bag: inputs.rectify needs {" and ".join(missing)}, with messages; '
                         f'camera_info topics are {", ".join(sorted(recorded)) or "none"}')
    return topics
