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

"""Real pairs of views in grey, with nothing but their size of range, and the faults of cameras."""

from dataclasses import dataclass
import json

import cv2
import numpy as np
from real_scenes import real_scene_folder

LAB = tuple(f'middlebury/{name}' for name in (
    'Adirondack', 'Art', 'Dolls', 'cones', 'sawtooth', 'teddy', 'tsukuba', 'venus'))
FIELD = tuple(
    [f'field/middlebury/{name}' for name in (
        'Bowling1', 'Lampshade1', 'Midd1', 'Motorcycle', 'Pipes', 'Playroom', 'Reindeer_half',
        'Rocks1')]
    + [f'field/eth3d/{name}' for name in (
        'delivery_area_1l', 'delivery_area_2s', 'delivery_area_3l', 'electro_1s', 'electro_2l',
        'forest_1s', 'playground_1s', 'terrace_1s', 'terrains_1l')]
    + [f'field/kitti2012/{number}_10' for number in (
        '000000', '000032', '000056', '000072', '000096', '000120', '000144', '000168',
        '000184')])
CAMERAS = tuple(f'field/cameras/oak_{name}' for name in (
    'corridor', 'desk', 'living_room', 'pov_hands', 'stairs'))


@dataclass(frozen=True, eq=False)
class Pair:
    left: np.ndarray
    right: np.ndarray
    disparities: int


def load(name):
    folder = real_scene_folder(f'../{name}')
    meta = json.loads((folder / 'meta.json').read_text(encoding='utf-8'))
    left, right = (cv2.imread(str(folder / f'{side}.png'), cv2.IMREAD_GRAYSCALE)
                   for side in ('left', 'right'))
    return Pair(left, right, int(meta['ndisp']))


def lowered(view, rows):
    """Move a view down by a fraction of a row."""
    return _warped(view, np.float32([[1, 0, 0], [0, 1, rows]]))


def turned(view, degrees):
    """Turn a view about its centre."""
    height, width = view.shape[:2]
    return _warped(view, cv2.getRotationMatrix2D(
        ((width - 1) / 2, (height - 1) / 2), degrees, 1))


def noisy(view, sigma, seed):
    """Add noise to what need not be whole levels."""
    noise = np.random.default_rng(seed).normal(0, sigma, view.shape)
    return np.rint(view + noise).clip(0, 255).astype(np.uint8)


def darkened(view, seed):
    return noisy(0.12 * view, 1.2, seed)


def _warped(view, matrix):
    return cv2.warpAffine(view, matrix, view.shape[1::-1], flags=cv2.INTER_CUBIC,
                          borderMode=cv2.BORDER_REPLICATE)
