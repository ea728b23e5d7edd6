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

"""A folder of stereo pairs: `left/` and `right/`, or `NAME_left.*` and `NAME_right.*`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stereo_refine_ros.datasets.images import read_pair, SUFFIXES
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.grey_range import SteadyRange
from stereo_refine_ros.types import StereoGeometry

_NOT_VIEWS = ('disp', 'mask')


def list_pairs(folder: str | Path) -> list[tuple[str, Path, Path]]:
    """
    Return (name, left file, right file) of every pair in `folder`, sorted by name.

    Raises
    ------
    FileNotFoundError
        When there is no pair, or a view without its partner.

    """
    root = Path(folder)
    lefts, rights = _views(root, 'left'), _views(root, 'right')
    if not lefts or not rights:
        raise FileNotFoundError(
            f'{root}: no pairs; expected left/ and right/, or NAME_left.* and NAME_right.*')
    alone = sorted(set(lefts) ^ set(rights))
    if alone:
        raise FileNotFoundError(f'{root}: views without a partner: {", ".join(alone[:5])}')
    return [(name, lefts[name], rights[name]) for name in sorted(lefts)]


def iterate_folder(folder: str | Path) -> Iterator[Scene]:
    """Yield the pairs of `folder` as scenes, with the geometry of its `calib.txt` if any."""
    geometry = read_projections(Path(folder) / 'calib.txt')
    steady = SteadyRange()
    for name, left, right in list_pairs(folder):
        yield Scene(name, read_pair(left, right, steady), geometry=geometry)


def read_projections(path: Path) -> StereoGeometry | None:
    """
    Read a calibration of two lines, the 3x4 projection matrices of left and right.

    Returns
    -------
    StereoGeometry or None
        None where there is no such file or it is written in another form.

    """
    if not path.is_file():
        return None
    try:
        numbers = np.array([line.split() for line in path.read_text().splitlines() if line],
                           np.float64)
    except ValueError:
        return None
    if numbers.shape != (2, 12):
        return None
    left, right = numbers.reshape(2, 3, 4)
    return StereoGeometry(float(right[0, 0]), float(-right[0, 3] / right[0, 0]),
                          float(left[0, 2]), float(left[1, 2]), float(right[0, 2]))


def _views(root: Path, side: str) -> dict[str, Path]:
    if (root / side).is_dir():
        return {path.stem: path for path in (root / side).iterdir() if _is_image(path)}
    found = {}
    for path in root.glob(f'*{side}.*'):
        if _is_image(path) and not path.stem.startswith(_NOT_VIEWS):
            found[path.stem.removesuffix(side).rstrip('_-') or root.name] = path
    return found


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES
