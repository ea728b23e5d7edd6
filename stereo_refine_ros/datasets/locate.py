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

"""Where the scenes are: the folder asked for, the environment, beside the checkout, the cache."""

from __future__ import annotations

import os
from pathlib import Path

DATA_VARIABLE = 'STEREO_REFINE_DATA'


def cache_dir() -> Path:
    """Return the user's cache folder of this package; it need not exist."""
    base = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    return Path(base) / 'stereo_refine_ros'


def find_data(explicit: str | Path | None = None) -> Path:
    """
    Return the folder that holds the scene folders.

    The first that exists of: `explicit`, the variable STEREO_REFINE_DATA, `../shared` beside
    the working directory and beside the checkout; else the user's cache, where downloaded
    scenes go. Each may be the folder of the scenes or hold it as `middlebury/`.

    Raises
    ------
    FileNotFoundError
        When `explicit` or STEREO_REFINE_DATA names a folder that does not exist.

    """
    for source, value in (('--data', explicit),
                          (DATA_VARIABLE, os.environ.get(DATA_VARIABLE))):
        if value:
            return _scene_folder(_existing(source, Path(value)))
    for base in (Path.cwd(), Path(__file__).resolve().parents[2]):
        shared = base.parent / 'shared'
        if (shared / 'middlebury').is_dir():
            return shared / 'middlebury'
    return cache_dir() / 'middlebury'


def _existing(source: str, path: Path) -> Path:
    if not path.is_dir():
        raise FileNotFoundError(f'{source}: {path} is not a folder')
    return path


def _scene_folder(path: Path) -> Path:
    nested = path / 'middlebury'
    return nested if nested.is_dir() else path
