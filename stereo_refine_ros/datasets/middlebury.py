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
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from stereo_refine_ros.datasets.download import can_download, download_scene
from stereo_refine_ros.datasets.locate import cache_dir, find_data
from stereo_refine_ros.datasets.scene import Mask, Scene, visible_in_both
from stereo_refine_ros.types import FloatMap, Image, StereoGeometry, StereoPair

_MASK_INSIDE = 255


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
    """Read the scene in `folder`: left and right view, truth, masks, `meta.json`."""
    meta = json.loads((folder / 'meta.json').read_text(encoding='utf-8'))
    pair = StereoPair(_read_color(folder / 'left.png'), _read_color(folder / 'right.png'))
    truth = _read_truth(folder, 'disp_left', meta)
    truth_right = _read_truth(folder, 'disp_right', meta)
    return Scene(
        name=folder.name, pair=pair, truth=truth, scale=int(meta['disp_scale']),
        num_disparities=int(meta['ndisp']), masks=_read_masks(folder, truth, truth_right),
        geometry=_geometry(meta), truth_right=truth_right)


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


def _read_color(path: Path) -> Image:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise FileNotFoundError(f'{path}: no readable image')
    return np.asarray(image, np.uint8)


def _read_grey(path: Path) -> Image | None:
    """Read the raw levels of a map; some are stored as three equal channels."""
    if not path.is_file():
        return None
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ValueError(f'{path}: no readable image')
    return np.asarray(image[..., 0] if image.ndim == 3 else image, np.uint8)


def _read_truth(folder: Path, stem: str, meta: dict[str, Any]) -> FloatMap | None:
    pfm = folder / f'{stem}.pfm'
    if pfm.is_file():
        return read_pfm(pfm) / np.float32(meta['disp_scale'])
    levels = _read_grey(folder / f'{stem}.png')
    if levels is None:
        return None
    truth = levels.astype(np.float32) / np.float32(meta['disp_scale'])
    if meta['invalid_value'] is not None:
        truth[levels == meta['invalid_value']] = np.nan
    return truth


def _read_masks(folder: Path, truth: FloatMap | None,
                truth_right: FloatMap | None) -> dict[str, Mask]:
    masks = {}
    for region, stems in (('nonocc', ('mask_nonocc', 'mask_nonocc_derived')),
                          ('all', ('mask_all',)), ('disc', ('mask_disc',))):
        for stem in stems:
            levels = _read_grey(folder / f'{stem}.png')
            if levels is not None and region not in masks:
                masks[region] = levels == _MASK_INSIDE
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
