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
Where compiled kernels are kept: in the user's cache, one folder for each state of the sources.

Numba looks only at the file that a kernel stands in. A kernel that calls into another file, or
uses a constant of it, would be served from the cache with the other file's old code.
"""

from __future__ import annotations

import atexit
import hashlib
import os
from pathlib import Path
import shutil
import sys
import tempfile


def use_versioned_cache() -> None:
    """Point numba to the folder of this state of the sources, unless the user chose one."""
    if 'NUMBA_CACHE_DIR' in os.environ:
        return
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    name = f'kernels-{_digest_of_sources()}'
    path = os.path.join(home, 'stereo_refine_ros', name)
    try:
        os.makedirs(path, exist_ok=True)
    except OSError:  # a service account without a home: a folder that nobody else can plant
        path = tempfile.mkdtemp(prefix='stereo_refine_ros-')
        atexit.register(shutil.rmtree, path, ignore_errors=True)
    os.environ['NUMBA_CACHE_DIR'] = path
    if 'numba' in sys.modules:
        sys.modules['numba'].config.CACHE_DIR = path


def _digest_of_sources() -> str:
    digest = hashlib.sha256()
    root = Path(__file__).resolve().parent
    for folder in ('graph', 'matching', 'quality', 'refinement'):
        for path in sorted((root / folder).glob('*.py')):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
