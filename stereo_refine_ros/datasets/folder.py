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
Folders of stereo pairs, in the layouts of data sets and of people.

A folder a side (`left/`, KITTI's `image_2/` or `image_02/data/`, EuRoC's `mav0/cam0/data/`), or
the side in the name (`NAME_left.png`, `left_000.png`, `im0.png`). Raw EuRoC pairs are rectified
by their `sensor.yaml`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import glob
from pathlib import Path
import re

from stereo_refine_ros.camera_info import CameraModel
from stereo_refine_ros.datasets.calibration import (
    euroc_geometry, read_euroc, read_projections)
from stereo_refine_ros.datasets.images import read_pair, SUFFIXES
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.grey_range import SteadyRange
from stereo_refine_ros.rectification.raw_images import Rectifier
from stereo_refine_ros.types import StereoGeometry, StereoPair

Pairs = list[tuple[str, Path, Path]]

# A folder a side, and the numbers that calibration files call the two cameras by.
_SIDES = (
    ('left', 'right', '01'), ('Left', 'Right', '01'), ('image_2', 'image_3', '23'),
    ('image_02/data', 'image_03/data', '23'), ('image_0', 'image_1', '01'),
    ('image_00/data', 'image_01/data', '01'), ('mav0/cam0/data', 'mav0/cam1/data', '01'),
    ('cam0/data', 'cam1/data', '01'))
# How the side stands in the name of a file.
_LEFT_NAME, _RIGHT_NAME = (
    re.compile(rf'(?:(?:(?P<before>.*)[_-])?{side}|{side}[_-]?(?P<after>.*)|(?P<im>){im})', re.I)
    for side, im in (('left', 'im0'), ('right', 'im1')))
_NOT_VIEWS = ('disp', 'mask')
_STAMP = re.compile(r'\d{16,}')  # such cameras may start and end one frame apart
_EXPECTED = (
    'left/ and right/, NAME_left.* and NAME_right.*, left_NAME.* and right_NAME.*, im0.* and '
    'im1.*, image_2/ and image_3/, image_02/data/ and image_03/data/, or mav0/cam0/data/ and '
    'mav0/cam1/data/; for other names give --left GLOB --right GLOB')


@dataclass(frozen=True, eq=False)
class _Layout:
    """The pairs of a folder and what is known of their cameras."""

    pairs: Pairs
    geometry: StereoGeometry | None = None
    raw: tuple[CameraModel, CameraModel] | None = None


def list_pairs(folder: str | Path) -> Pairs:
    """
    Return (name, left file, right file) of every pair in `folder`, sorted by name.

    Raises
    ------
    FileNotFoundError
        When there is no pair, or a view without its partner.

    """
    root = Path(folder)
    return _in_folders(root) or _in_one_folder(root)


def match_globs(left: str, right: str) -> Pairs:
    """
    Return (name, left file, right file) of the files that two patterns find, in their order.

    Raises
    ------
    FileNotFoundError
        When a pattern finds nothing, or not as much as the other.

    """
    lefts, rights = (sorted(Path(name) for name in glob.glob(pattern, recursive=True)
                            if _is_image(Path(name))) for pattern in (left, right))
    if not lefts or len(lefts) != len(rights):
        raise FileNotFoundError(
            f'--left {left} finds {len(lefts)} images, --right {right} {len(rights)}; expected '
            'as many on both sides (quote the patterns, so that the shell leaves them alone)')
    return [(path.stem, path, other) for path, other in zip(lefts, rights, strict=True)]


def iterate_folder(folder: str | Path) -> Iterator[Scene]:
    """
    Yield the pairs of `folder` as scenes, with the geometry of its calibration if any.

    Raises
    ------
    FileNotFoundError, ValueError
        As `list_pairs`, or when a file cannot be read.

    """
    yield from _iterate(_describe(Path(folder), list_pairs(folder)))


def iterate_globs(left: str, right: str) -> Iterator[Scene]:
    """Yield the pairs that two patterns find as scenes; see `match_globs`."""
    yield from _iterate(_Layout(match_globs(left, right)))


def _iterate(layout: _Layout) -> Iterator[Scene]:
    steady, rectifier = SteadyRange(), Rectifier()
    for name, left, right in layout.pairs:
        pair = read_pair(left, right, steady)
        if layout.raw is not None and pair.right is not None:
            pair = StereoPair(*(
                rectifier.rectify(str(path), view, model) for path, view, model in zip(
                    (left, right), (pair.left, pair.right), layout.raw, strict=True)))
        yield Scene(name, pair, geometry=layout.geometry)


def _describe(root: Path, pairs: Pairs) -> _Layout:
    """Find the calibration that belongs to pairs."""
    sensors = [path.parents[1] / 'sensor.yaml' for path in pairs[0][1:]]
    if all(path.is_file() for path in sensors):
        raw = read_euroc(*sensors)
        return _Layout(pairs, euroc_geometry(raw), raw)
    numbers = next((numbers for left, _, numbers in _SIDES
                    if pairs[0][1].parent == root / left), '01')
    for path in (root / 'calib.txt', root / 'calib_cam_to_cam.txt',
                 root.parent / 'calib_cam_to_cam.txt'):
        geometry = read_projections(path, (numbers[0], numbers[1]))
        if geometry is not None:
            return _Layout(pairs, geometry)
    return _Layout(pairs)


def _in_folders(root: Path) -> Pairs:
    for left, right, _ in _SIDES:
        if (root / left).is_dir() and (root / right).is_dir():
            views = [{_without_side(path.stem, pattern): path
                      for path in (root / side).iterdir() if _is_image(path)}
                     for side, pattern in ((left, _LEFT_NAME), (right, _RIGHT_NAME))]
            if views[0] or views[1]:
                return _matched(root, *views)
    return []


def _in_one_folder(root: Path) -> Pairs:
    views: list[dict[str, Path]] = [{}, {}]
    for path in root.iterdir() if root.is_dir() else ():
        if _is_image(path) and not path.stem.startswith(_NOT_VIEWS):
            for found, pattern in zip(views, (_LEFT_NAME, _RIGHT_NAME), strict=True):
                if pattern.fullmatch(path.stem):
                    found[_without_side(path.stem, pattern) or root.name] = path
    if not all(views):
        raise FileNotFoundError(f'{root}: no pairs; expected {_EXPECTED}')
    return _matched(root, *views)


def _without_side(stem: str, pattern: re.Pattern[str]) -> str:
    match = pattern.fullmatch(stem)
    return stem if match is None else match['before'] or match['after'] or ''


def _matched(root: Path, lefts: dict[str, Path], rights: dict[str, Path]) -> Pairs:
    alone = sorted(name for name in set(lefts) ^ set(rights) if not _STAMP.fullmatch(name))
    both = sorted(set(lefts) & set(rights))
    if alone or not both:
        names = alone or sorted(set(lefts) | set(rights))
        raise FileNotFoundError(f'{root}: views without a partner: {", ".join(names[:5])}')
    return [(name, lefts[name], rights[name]) for name in both]


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES
