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
Shared memory for images: no more than this host has room for, settled before Fast DDS starts.

Fast DDS reserves the whole segment of its profile for each process. A container has 64 MB of
/dev/shm unless told otherwise: room for one process of 32 MB. The second would get none, and its
images would not arrive.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, MutableMapping
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import tempfile
from typing import TYPE_CHECKING
from xml.etree import ElementTree

if TYPE_CHECKING:
    Tree = ElementTree.ElementTree[ElementTree.Element]

# Fast DDS reads the first name up to Jazzy and the second one after it.
PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
MEMORY = Path('/dev/shm')

_OWN_PROFILES = 'stereo_refine_'  # how the names of the profiles in config/ begin
_SPACE = '{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}'
_MB = 1 << 20
# Measured with Fast DDS 2.14: a segment of 32 MB is a file of 33.5; ports and what a process
# needs for discovery take less than one more.
_OVERHEAD = 1.05
_REST = _MB
_SHARE = 4  # a process takes at most this part of what is free: camera, node and two who look on
_SMALLEST = _MB  # holds a colour image of 640x480
_MORE = ('give it more (docker run --shm-size=512m, or --ipc=host), or clear what ended processes '
         'left in it (fastdds shm clean)')


@dataclass(frozen=True)
class _Profile:
    path: str
    tree: Tree

    @property
    def is_own(self) -> bool:
        names = [item.get('profile_name', '') for item in self.tree.iter(f'{_SPACE}participant')]
        return any(name.startswith(_OWN_PROFILES) for name in names)

    def shared_transports(self) -> list[ElementTree.Element]:
        return [item for item in self.tree.iter(f'{_SPACE}transport_descriptor')
                if item.findtext(f'{_SPACE}type') == 'SHM']

    def segment_bytes(self) -> int:
        """Return the largest segment that the profile asks for, 0 for none."""
        sizes = [item.findtext(f'{_SPACE}segment_size', '0') for item in self.shared_transports()]
        return max(map(int, sizes), default=0)


def fit_to_host(warn: Callable[[str], None],
                environment: MutableMapping[str, str] = os.environ) -> None:
    """
    Take a smaller segment where the one of the profile in use does not fit.

    Only the profiles of this package are changed, in a copy that `environment` then names;
    of another one it is said what is wrong with it here.

    Parameters
    ----------
    warn : callable of str
        Told what was changed or is wrong, and what to do.
    environment : mutable mapping of str to str
        Names the profile; to be called before the middleware reads it.

    """
    profile = _profile_in_use(environment)
    if profile is None or not MEMORY.is_dir():
        return
    usage = shutil.disk_usage(MEMORY)
    wanted, room = profile.segment_bytes(), usage.free - _REST
    state = f'{MEMORY} has {usage.free // _MB} of {usage.total // _MB} MB free'
    if not profile.is_own:
        if wanted * _OVERHEAD > room:
            warn(f'{state}, {profile.path} asks for {wanted // _MB} MB for each process: this one '
                 f'gets none, and images may not arrive; {_MORE}')
        return
    fitting = int(room / _SHARE / _OVERHEAD)
    if fitting >= wanted:
        return
    try:
        if fitting >= _SMALLEST:
            _use(_with_segment(profile, fitting), environment)
            if fitting < wanted // 2:
                warn(f'{state}: this process takes {fitting // _MB} MB of it for images instead '
                     f'of {wanted // _MB}, so that there is some for others; if images are lost, '
                     f'{_MORE}')
        else:
            _use(_without_segment(profile), environment)
            warn(f'{state}, too little for images: they go by UDP, large ones may be lost; '
                 f'{_MORE}')
    except OSError as error:
        warn(f'{state}, but cannot be written ({error}): images may not arrive; let this user '
             'write it')


def _profile_in_use(environment: MutableMapping[str, str]) -> _Profile | None:
    if not environment.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp').startswith('rmw_fastrtps'):
        return None
    for name in PROFILE_VARIABLES:
        path = environment.get(name, '')
        # What cannot be read, Fast DDS reports itself.
        with contextlib.suppress(OSError, ElementTree.ParseError, ValueError):
            profile = _Profile(path, ElementTree.parse(path))
            if profile.segment_bytes():
                return profile
    return None


def _with_segment(profile: _Profile, size: int) -> Tree:
    for transport in profile.shared_transports():
        for name in 'segment_size', 'maxMessageSize':
            value = transport.find(_SPACE + name)
            if value is not None:
                value.text = str(min(size, int(value.text or 0)))
    return profile.tree


def _without_segment(profile: _Profile) -> Tree:
    """Take the shared-memory transports away, and the names by which they are used."""
    shared = profile.shared_transports()
    names = {item.findtext(f'{_SPACE}transport_id') for item in shared}
    for parent in list(profile.tree.iter()):
        for child in list(parent):
            is_use = child.tag == f'{_SPACE}transport_id' and child.text in names
            if child in shared or (is_use and parent.tag == f'{_SPACE}userTransports'):
                parent.remove(child)
    return profile.tree


def _use(tree: Tree, environment: MutableMapping[str, str]) -> None:
    """Write a profile that lives as long as this process, and name it."""
    ElementTree.register_namespace('', _SPACE[1:-1])
    with tempfile.NamedTemporaryFile(
            dir=MEMORY, prefix='stereo_refine_ros-', suffix='.xml', delete=False) as file:
        tree.write(file, encoding='utf-8', xml_declaration=True)
    atexit.register(Path(file.name).unlink, missing_ok=True)
    environment.update(dict.fromkeys(PROFILE_VARIABLES, file.name))
