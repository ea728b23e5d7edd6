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

"""The Fast DDS profile with shared memory for whole images, for processes that set it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import shutil

PROFILE = 'fastdds_shm.xml'
# Fast DDS reads the first name up to Jazzy and the second one after it.
VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
SHARED_MEMORY = Path('/dev/shm')
# Three participants, 32 MB each, and some room.
_NEEDED_BYTES = 128 << 20
# Whoever sets one of these has chosen, or uses another middleware.
_CHOICES = (*VARIABLES, 'FASTDDS_BUILTIN_TRANSPORTS')


def profile_variables(config: Path, environment: Mapping[str, str]) -> dict[str, str]:
    """
    Return the variables that give images shared memory large enough for them.

    Parameters
    ----------
    config : Path
        Folder of the profile.
    environment : mapping of str to str
        Of the process; what it chooses itself stays.

    Returns
    -------
    dict of str to str
        Empty where something else is chosen, or there is no profile or no room for it.

    """
    profile = config / PROFILE
    if any(environment.get(name) for name in _CHOICES):
        return {}
    if 'fastrtps' not in environment.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp'):
        return {}
    if not profile.is_file() or free_shared_memory() < _NEEDED_BYTES:
        return {}
    return dict.fromkeys(VARIABLES, str(profile))


def free_shared_memory() -> int:
    """Return the free bytes of shared memory; containers often have only 64 MB."""
    return shutil.disk_usage(SHARED_MEMORY).free if SHARED_MEMORY.is_dir() else 0
