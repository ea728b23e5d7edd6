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

"""A rendered scene written to disk in the Middlebury layout, for tests."""

import json
from pathlib import Path

import cv2
import numpy as np

from stereo_refine_ros.datasets import render_scene


def small_scene(seed=0):
    """Render the scene that `write_scene` writes."""
    return render_scene(seed, 64, 96, 16, 2)


def write_scene(root: Path, name='rendered', seed=0):
    """Write one scene folder below `root`; return the scene as rendered."""
    scene = small_scene(seed)
    folder = root / name
    folder.mkdir(parents=True)
    cv2.imwrite(str(folder / 'left.png'), scene.pair.left)
    cv2.imwrite(str(folder / 'right.png'), scene.pair.right)
    scale = 15
    levels = np.rint(scene.truth * scale).astype(np.uint8)
    cv2.imwrite(str(folder / 'disp_left.png'), levels)
    nonocc = np.where(scene.masks['nonocc'], 255, 128).astype(np.uint8)
    cv2.imwrite(str(folder / 'mask_nonocc.png'), nonocc)
    meta = {'scene': name, 'width': 96, 'height': 64, 'disp_scale': scale, 'ndisp': 16,
            'invalid_value': 0}
    (folder / 'meta.json').write_text(json.dumps(meta))
    return scene
