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

"""Middlebury scenes: one folder a scene, decoded to pixels of disparity."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.datasets.download import can_download, download_scene
from stereo_refine_ros.datasets.images import read_levels, read_pair
from stereo_refine_ros.datasets.locate import cache_dir, find_data
from stereo_refine_ros.datasets.scene import Mask, Scene, visible_in_both
from stereo_refine_ros.grey_range import SteadyRange
from stereo_refine_ros.types import FloatMap, StereoGeometry


def list_scenes(data: str | Path | None = None) -> list[str]:
    """Return the names of the scenes in the folder that `find_data(data)` finds, sorted."""
    root = find_data(data)
    if not root.is_dir():
        return []
    return sorted(path.parent.name for path in root.glob('*/meta.json'))


def load_scene(name: str, data: str | Path | None = None) -> Scene:
    """
    Load a scene by name, whatever its case; download it where it is not found.

    Parameters
    ----------
    name : str
        Such as `cones`; `list_scenes` names those that are there.
    data : str or Path, optional
        See `find_data`.

    Raises
    ------
    FileNotFoundError
        When the scene is neither there nor one that can be downloaded.
    ConnectionError
        When it has to be downloaded and cannot be.

    """
    root = find_data(data)
    for folder in (root, cache_dir() / 'middlebury'):
        found = _match_name(name, folder)
        if found is not None:
            return read_scene(found)
    if not can_download(name):
        raise FileNotFoundError(
            f'scene {name!r}: not in {root}, which has {", ".join(list_scenes(data)) or "none"}')
    return read_scene(download_scene(name.casefold(), cache_dir() / 'middlebury'))


def read_scene(folder: Path) -> Scene:
    """
    Read the scene in `folder`: left and right view, truth, masks, `meta.json`.

    Raises
    ------
    FileNotFoundError, ValueError
        When a file is missing or does not fit the others.

    """
    meta = _read_meta(folder / 'meta.json')
    pair = read_pair(folder / 'left.png', folder / 'right.png', SteadyRange())
    truth, scale = _read_truth(folder, 'disp_left', meta, pair.shape)
    truth_right, _ = _read_truth(folder, 'disp_right', meta, pair.shape)
    return Scene(
        name=folder.name, pair=pair, truth=truth, scale=scale,
        num_disparities=None if meta.get('ndisp') is None else int(meta['ndisp']),
        masks=_read_masks(folder, truth, truth_right), geometry=_geometry(meta),
        truth_right=truth_right)


def read_pfm(path: Path) -> FloatMap:
    """
    Read a one-channel PFM file, top row first; its infinities become NaN.

    Raises
    ------
    ValueError
        When the file is not such a file or is cut short.

    """
    with path.open('rb') as stream:
        magic, size, scale = (stream.readline().strip() for _ in range(3))
        if magic != b'Pf':
            raise ValueError(f'{path}: not a one-channel PFM file')
        width, height = (int(number) for number in size.split())
        kind = '<f4' if float(scale) < 0 else '>f4'
        values = np.frombuffer(stream.read(), kind)
    if values.size != width * height:
        raise ValueError(f'{path}: expected {width * height} values, got {values.size}')
    bottom_up = values.reshape(height, width).astype(np.float32)
    return np.ascontiguousarray(np.where(np.isfinite(bottom_up), bottom_up, np.nan)[::-1])


def _match_name(name: str, root: Path) -> Path | None:
    if not root.is_dir():
        return None
    wanted = name.casefold()
    return next((path.parent for path in sorted(root.glob('*/meta.json'))
                 if path.parent.name.casefold() == wanted), None)


def _read_meta(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text(encoding='utf-8')))
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from error


def _read_truth(folder: Path, stem: str, meta: dict[str, Any], shape: tuple[int, int]
                ) -> tuple[FloatMap | None, float]:
    """Return the truth in pixels and, where it is stored in 8 bits, its levels per pixel."""
    pfm, png = folder / f'{stem}.pfm', folder / f'{stem}.png'
    levels: NDArray[Any] | None = read_pfm(pfm) if pfm.is_file() else read_levels(png)
    if levels is None:
        return None, 1.0
    path = pfm if pfm.is_file() else png
    if levels.shape != shape:
        raise ValueError(f'{path}: shape {levels.shape}, the left view has {shape}')
    truth = _decode(path, levels, meta)
    return truth, float(meta['disp_scale']) if levels.dtype == np.uint8 else 1.0


def _decode(path: Path, levels: NDArray[Any], meta: dict[str, Any]) -> FloatMap:
    """Turn raw levels into pixels of disparity; what `meta.json` calls invalid becomes NaN."""
    scale = meta.get('disp_scale')
    if not isinstance(scale, (int, float)) or not 0 < scale < math.inf:
        raise ValueError(f'{path}: disp_scale in meta.json is {scale}; expected the levels per '
                         'pixel of disparity')
    invalid = meta.get('invalid_value')
    known = np.isfinite(levels)
    for mark in invalid if isinstance(invalid, list) else [invalid]:
        if mark is not None:
            known &= levels != float(mark)
    values = np.where(known, levels / float(scale), np.nan).astype(np.float32)
    largest = float(np.max(values, where=known, initial=0.0))
    if not known.any() or largest >= levels.shape[1]:
        raise ValueError(
            f'{path}: {np.count_nonzero(known)} known pixels, the largest disparity '
            f'{largest:g} px in a view {levels.shape[1]} px wide; do disp_scale and '
            'invalid_value in meta.json fit the file?')
    return values


def _read_masks(folder: Path, truth: FloatMap | None,
                truth_right: FloatMap | None) -> dict[str, Mask]:
    masks = {}
    for region, stems in (('nonocc', ('mask_nonocc', 'mask_nonocc_derived')),
                          ('all', ('mask_all',)), ('disc', ('mask_disc',))):
        for stem in stems:
            levels = read_levels(folder / f'{stem}.png')
            if levels is not None and region not in masks:
                masks[region] = levels == np.iinfo(levels.dtype).max
    if truth is not None:
        masks.setdefault('all', np.isfinite(truth))
        if truth_right is not None and 'nonocc' not in masks:
            masks['nonocc'] = visible_in_both(truth, truth_right)
    return masks


def _geometry(meta: dict[str, Any]) -> StereoGeometry | None:
    """Take the published calibration; an unpublished principal point is the image centre."""
    focal, baseline = meta.get('focal_px'), meta.get('baseline_mm')
    if focal is None or baseline is None:
        return None
    cx_left = float(meta.get('cx0', (meta['width'] - 1) / 2))
    cx_right = float(meta.get('cx1', cx_left + (meta.get('doffs_px') or 0.0)))
    cy = float(meta.get('cy', (meta['height'] - 1) / 2))
    return StereoGeometry(float(focal), float(baseline) / 1e3, cx_left, cy, cx_right)
