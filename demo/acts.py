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

"""What the demo shows: a scene of a camera's size, then a pair whose rows have slipped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stereo_refine_ros.datasets import find_data, load_scene, render_scene, Scene

# Of the sizes of small cameras, the first that is found: 699 x 476, 741 x 497 and 718 x 496.
CAMERA_SIZE_SCENES = ('Playroom', 'Motorcycle', 'Adirondack')
ROW_OFFSET_PX = 1.5
SYNTHETIC = 'synthetic'


@dataclass(frozen=True, eq=False)
class Act:
    """
    One scene, and how `replay` is told to play it.

    Attributes
    ----------
    scene : Scene
    source : tuple of str
        Options of `replay`.
    row_offset : float
        How much lower the right view lies, where that is known; pixels.

    """

    scene: Scene
    source: tuple[str, ...]
    row_offset: float = 0.0


def choose_acts(name: str | None, data: str | None) -> tuple[list[Act], str]:
    """
    Choose the scenes to show; the last is the synthetic one, whose rows are off.

    Parameters
    ----------
    name : str or None
        Of a Middlebury scene; `synthetic` for that one alone; None for one of a camera's size
        where there is one.
    data : str or None
        See `find_data`.

    Returns
    -------
    acts : list of Act
    note : str
        Why a scene is missing; empty where none is.

    """
    slipped = Act(render_scene(row_offset=ROW_OFFSET_PX),
                  ('--synthetic', '--row-offset', str(ROW_OFFSET_PX)), ROW_OFFSET_PX)
    if name == SYNTHETIC:
        return [slipped], ''
    try:
        real = _find_camera_size(data) if name is None else _load(name, data)
    except (OSError, ValueError) as error:
        return [slipped], f'{error}; taking the synthetic scene'
    return [real, slipped], ''


def row_report(act: Act, metrics: Mapping[str, float]) -> str:
    """Say what the node found of the offset that the act has; empty where it has none."""
    if not act.row_offset:
        return ''
    found = metrics.get('row_offset_px', 0.0)
    verdict = f'found {found:.2f} px, undone' if found > 0 else 'not found'
    return (f'{act.scene.name}: the right image is {act.row_offset:.2f} px lower than the left '
            f'one: {verdict}')


def _load(name: str, data: str | None) -> Act:
    scene = load_scene(name, data)
    return Act(scene, ('--scene', name, *(('--data', data) if data else ())))


def _find_camera_size(data: str | None) -> Act:
    """Look among the scenes and in `field/middlebury` beside them."""
    root = find_data(data)
    folders = (root.parent / 'field' / 'middlebury', root)
    for name in CAMERA_SIZE_SCENES:
        for folder in folders:
            if (folder / name / 'meta.json').is_file():
                return _load(name, str(folder))
    raise FileNotFoundError(f'no scene of a camera\'s size ({", ".join(CAMERA_SIZE_SCENES)}) in '
                            f'{" or ".join(map(str, folders))}; --data names another folder')
