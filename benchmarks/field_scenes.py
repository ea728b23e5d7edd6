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

"""The scenes of the field benchmark: sets of pairs with truth, masks and a network's map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from stereo_refine_ros.datasets.middlebury import read_pfm
from stereo_refine_ros.types import FloatMap, Image

LAB = 'lab'
SETS = ('kitti2012', 'eth3d', 'middlebury', LAB)
# Pixels: what each data set itself counts as wrong.
THRESHOLDS = {'kitti2012': 3.0, 'eth3d': 1.0, 'middlebury': 1.0, LAB: 1.0}
NETWORK = 'hitnet'
_NETWORK_FILE, _NETWORK_SCALE = 'external_hitnet.png', 64.0
_INSIDE = 255


@dataclass(frozen=True, eq=False)
class FieldScene:
    """
    One pair of one set.

    Attributes
    ----------
    group, name : str
        Set and scene.
    left, right : uint8 ndarray of shape (H, W, 3) BGR
    truth : float32 ndarray of shape (H, W)
        Pixels, NaN unknown.
    masks : mapping of str to bool ndarray of shape (H, W)
        'all' with any truth; 'nonocc' where the data set has it.
    num_disparities : int
    network : float32 ndarray of shape (H, W), or None
        A real network's map in pixels, NaN invalid.

    """

    group: str
    name: str
    left: Image
    right: Image
    truth: FloatMap
    num_disparities: int
    masks: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    network: FloatMap | None = None


def scene_folders(root: Path, group: str) -> list[Path]:
    """
    List the folders of a set; the lab scenes are the `middlebury` beside `field`.

    Raises
    ------
    FileNotFoundError
        When there is none.

    """
    folder = root / 'middlebury' if group == LAB else root / 'field' / group
    found = sorted(path.parent for path in folder.glob('*/meta.json'))
    if not found:
        raise FileNotFoundError(f'{folder}: no scenes; --data names the folder that holds '
                                'field/ and middlebury/')
    return found


def read_field_scene(folder: Path, group: str) -> FieldScene:
    """Read one scene; truth may be PFM or PNG of 8 or 16 bits, at the scale of `meta.json`."""
    meta = json.loads((folder / 'meta.json').read_text(encoding='utf-8'))
    truth = _truth(folder, meta)
    masks = {'all': np.isfinite(truth), **_mask(folder, 'all', ('mask_all',)),
             **_mask(folder, 'nonocc', ('mask_nonocc', 'mask_nonocc_derived'))}
    return FieldScene(
        group, folder.name, _read(folder / 'left.png', cv2.IMREAD_COLOR),
        _read(folder / 'right.png', cv2.IMREAD_COLOR), truth, int(meta['ndisp']), masks,
        read_network(folder))


def read_network(folder: Path) -> FloatMap | None:
    """Read the network's map, d = (value - 1) / 64 px and 0 for none; None where there is none."""
    path = folder / _NETWORK_FILE
    if not path.is_file():
        return None
    raw = _read(path, cv2.IMREAD_UNCHANGED).astype(np.float32)
    return np.where(raw == 0, np.nan, (raw - 1) / _NETWORK_SCALE).astype(np.float32)


def fill_along_rows(values: FloatMap) -> FloatMap:
    """
    Fill holes with the smaller of the nearest disparities to the left and right, else 0.

    Written without the package, so that a change there cannot change how it is judged.
    """
    width = values.shape[1]
    valid, column = np.isfinite(values), np.arange(width)[None]
    left = np.maximum.accumulate(np.where(valid, column, -1), axis=1)
    right = np.minimum.accumulate(
        np.where(valid, column, width)[:, ::-1], axis=1)[:, ::-1]
    near = np.minimum(*(np.where(
        (index >= 0) & (index < width),
        np.take_along_axis(values, np.clip(index, 0, width - 1), axis=1), np.inf)
        for index in (left, right)))
    return np.where(valid, values, np.where(np.isfinite(near), near, 0)).astype(np.float32)


def _truth(folder: Path, meta: Mapping[str, Any]) -> FloatMap:
    scale = np.float32(meta.get('disp_scale') or 1)
    pfm = folder / 'disp_left.pfm'
    if pfm.is_file():
        truth = read_pfm(pfm) / scale
    else:
        raw = _one_channel(_read(folder / 'disp_left.png', cv2.IMREAD_UNCHANGED))
        truth = raw.astype(np.float32) / scale
        if meta.get('invalid_value') is not None:
            truth[raw == meta['invalid_value']] = np.nan
    return np.where(truth > 0, truth, np.float32(np.nan))


def _mask(folder: Path, region: str, stems: tuple[str, ...]) -> dict[str, NDArray[np.bool_]]:
    for path in (folder / f'{stem}.png' for stem in stems):
        if path.is_file():
            return {region: _one_channel(_read(path, cv2.IMREAD_UNCHANGED)) == _INSIDE}
    return {}


def _one_channel(image: NDArray[Any]) -> NDArray[Any]:
    """Take one channel: some maps are stored as three equal ones."""
    return image if image.ndim == 2 else image[..., 0]


def _read(path: Path, mode: int) -> NDArray[Any]:
    image = cv2.imread(str(path), mode)
    if image is None:
        raise FileNotFoundError(f'{path}: no readable image')
    return np.asarray(image)
