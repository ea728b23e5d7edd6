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

"""The stereo pairs of the benchmarks: real scenes at the sizes of real cameras."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
from field_scenes import read_field_scene, scene_folders, THRESHOLDS
import numpy as np
from stereo_refine_ros.datasets.middlebury import load_scene
from stereo_refine_ros.types import FloatMap, Image


@dataclass(frozen=True, eq=False)
class Case:
    """
    A pair, its true disparity and the number of disparities to search.

    `group` names what it is averaged with, where sizes differ by a little; `threshold` is what
    counts as wrong, in pixels.
    """

    scene: str
    left: Image
    right: Image
    truth: FloatMap
    num_disparities: int
    group: str = ''
    threshold: float = 1.0

    @property
    def size(self) -> str:
        """Width x height x disparities; the group where there is one."""
        if self.group:
            return self.group
        height, width = self.truth.shape
        return f'{width}x{height}x{self.num_disparities}'


# Scene, width, height, disparities. A scene is stretched to the width and its middle rows taken
# (or stretched to the height, where it has too few).
CASES = (
    ('teddy', 450, 375, 60),
    ('cones', 450, 375, 60),
    ('Adirondack', 640, 480, 64),
    ('venus', 640, 480, 64),
    ('Adirondack', 1280, 720, 128),
    ('venus', 1280, 720, 128),
)


# Sets of field scenes, and how they are called in tables. Their smaller scenes are left out.
FIELD_SETS = {'middlebury': 'Middlebury, about 700x500', 'eth3d': 'ETH3D, about 900x450',
              'kitti2012': 'KITTI (3 px), about 1240x375'}
_CAMERA_WIDTH = 600


def field_cases(root: Path) -> Iterator[Case]:
    """
    Yield the field scenes of at least 600 columns as they are.

    Parameters
    ----------
    root : Path
        Holds `field/`.

    """
    for group, name in FIELD_SETS.items():
        for folder in scene_folders(root, group):
            scene = read_field_scene(folder, group)
            if scene.truth.shape[1] >= _CAMERA_WIDTH:
                yield Case(scene.name, scene.left, scene.right, scene.truth,
                           scene.num_disparities, name, THRESHOLDS[group])


def load_case(name: str, width: int, height: int, num_disparities: int) -> Case:
    """
    Load a scene at another size.

    Raises
    ------
    ValueError
        When the scene has no ground truth, or a disparity outside the search.

    """
    scene = load_scene(name)
    if scene.truth is None:
        raise ValueError(f'{name}: has no ground truth')
    factor = width / scene.truth.shape[1]
    rows = max(round(scene.truth.shape[0] * factor), height)
    first = (rows - height) // 2
    left, right = (
        cv2.resize(view, (width, rows), interpolation=cv2.INTER_AREA
                   if factor < 1 else cv2.INTER_CUBIC)[first:first + height]
        for view in (scene.pair.left, scene.pair.right))
    truth = cv2.resize(scene.truth, (width, rows), interpolation=cv2.INTER_NEAREST) * factor
    truth = truth[first:first + height].astype(np.float32)
    if np.nanmax(truth) >= num_disparities:
        raise ValueError(f'{name}: {np.nanmax(truth):.1f} px do not fit {num_disparities}')
    return Case(name, np.ascontiguousarray(left), np.ascontiguousarray(right), truth,
                num_disparities)
