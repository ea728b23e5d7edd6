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

"""Opening a rosbag2 without ROS, and saying what to do where it cannot be opened."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

IMAGE_TYPE = 'sensor_msgs/msg/Image'
COMPRESSED_TYPE = 'sensor_msgs/msg/CompressedImage'
INFO_TYPE = 'sensor_msgs/msg/CameraInfo'
COMPRESSED = '/compressed'
_ROS1_MAGIC = b'#ROSBAG'
_STORAGES = ('.mcap', '.db3')


@contextmanager
def open_bag(path: str | Path) -> Iterator[Reader]:
    """
    Open a rosbag2, mcap or sqlite3: its folder or its file.

    Raises
    ------
    FileNotFoundError, ValueError
        When there is no such bag, or it cannot be read; saying what to do.

    """
    bag = Path(path)
    if not bag.exists():
        raise FileNotFoundError(f'bag: {path} does not exist')
    hint = _other_kind(bag)
    if hint:
        raise ValueError(f'bag: {path}: {hint}')
    try:
        reader = Reader(bag)
        reader.open()
    except Exception as error:  # each storage raises errors of its own library
        raise ValueError(f'bag: {path}: {error}{_rescue(bag)}') from error
    try:
        yield reader
    finally:
        reader.close()


def bag_messages(reader: Reader, connections: Iterable[Connection], start_ns: int | None = None,
                 stop_ns: int | None = None) -> Iterator[tuple[Connection, int, bytes]]:
    """
    Yield (connection, recorded nanoseconds, raw CDR) in the order of recording.

    Raises
    ------
    ValueError
        Where the file is damaged.

    """
    try:
        yield from reader.messages(connections, start=start_ns, stop=stop_ns)
    except Exception as error:  # as in `open_bag`
        raise ValueError(f'bag: {reader.path}: {error}{_rescue(reader.path)}') from error


def find_image_topic(connections: list[Connection], *names: str) -> str:
    """
    Return the one recorded image topic that is called by the first of `names` that one is.

    Parameters
    ----------
    connections : list of Connection
        Of the bag.
    names : str
        Whole names or their ends; for each, that of compressed images is looked for as well.

    Raises
    ------
    ValueError
        When there is none, or more than one, listing the image topics there are.

    """
    kind_of = {item.topic: item.msgtype for item in connections
               if item.msgtype in (IMAGE_TYPE, COMPRESSED_TYPE)}
    for name in (form for given in names for form in (given, given + COMPRESSED)):
        exact = [topic for topic in kind_of if topic.strip('/') == name.strip('/')]
        found = exact or [topic for topic in kind_of if topic.endswith('/' + name.strip('/'))]
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f'bag: {len(found)} topics called {name}: '
                             f'{", ".join(sorted(found))}; choose with --topics LEFT,RIGHT')
    there = ', '.join(sorted(kind_of)) or 'none'
    raise ValueError(f'bag: no topics called {" or ".join(names)}; image topics are {there}; '
                     'choose with --topics LEFT,RIGHT')


def _other_kind(bag: Path) -> str:
    """Say what else than a rosbag2 this is, if it is."""
    files = [bag] if bag.is_file() else sorted(bag.iterdir())
    ros1 = next((item for item in files if item.is_file() and item.suffix == '.bag'
                 and _starts_with(item, _ROS1_MAGIC)), None)
    if ros1 is not None:
        return (f'a bag of ROS 1; convert it: rosbags-convert --src {ros1} --dst '
                f'{ros1.with_suffix("")} (pip install rosbags)')
    if bag.is_dir() and not (bag / 'metadata.yaml').exists():
        storage = next((item for item in files if item.suffix in _STORAGES), None)
        if storage is not None:
            return (f'no metadata.yaml beside {storage.name}: pass {storage} itself, or run '
                    f'ros2 bag reindex {bag}')
        return 'no rosbag2: neither metadata.yaml nor a .mcap or .db3 file'
    return ''


def _rescue(bag: Path) -> str:
    """Say how what is left of a damaged file may be had."""
    files = [bag] if bag.is_file() else sorted(bag.glob('*'))
    for item in files:
        if item.suffix == '.mcap':
            recovered = item.with_name(f'{item.stem}_recovered.mcap')
            return (f'; was the recording cut off? Try: mcap recover {item} -o {recovered}, and '
                    'pass that file')
        if item.suffix == '.db3':
            recovered = item.with_name(f'{item.stem}_recovered.db3')
            return (f'; was the recording cut off? Try: sqlite3 {item} .recover | sqlite3 '
                    f'{recovered}, and pass that file')
    return ''


def _starts_with(path: Path, magic: bytes) -> bool:
    with path.open('rb') as stream:
        return stream.read(len(magic)) == magic
