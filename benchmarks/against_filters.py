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
Error of the live preset beside OpenCV's WLS filter and weighted median, on every scene.

All refine the same map, that of OpenCV's three-way SGBM; beside it the live preset with matchers
of its own. Figures are the share of pixels off by more than 1 px, of all with known truth, holes
filled from the background. `--check` ends with 1 where a filter is as good as the live preset.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from contrib import run_contrib
from opencv_methods import match_padded
from stereo_refine_ros.datasets import list_scenes, load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.evaluation.tables import format_number, markdown_table
from stereo_refine_ros.memory import keep_freed_memory
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import FloatMap

INPUT = 'SGBM 3-way, padded'
FILTERS = ('SGBM 3-way + WLS', 'SGBM 3-way + weighted median')


def scene_errors(scene: Scene, contrib_python: str) -> dict[str, float]:
    """Return the error of every method in percent: the input, the filters, then ours."""
    assert scene.truth is not None
    views = (scene.pair.left, scene.pair.right)
    disparities = scene.num_disparities or 64
    given = match_padded(views, disparities)
    _, filtered = run_contrib(contrib_python, views, disparities, rounds=1, budget_s=0)
    maps = {INPUT: given, **{name: filtered[name] for name in FILTERS},
            'live on that map': _live(scene, given),
            'live, sgbm': _live(scene, method='sgbm'), 'live': _live(scene)}
    mask = scene.masks.get('all')
    errors = {name: bad_percent(fill_from_background(values), scene.truth, 1.0, mask)
              for name, values in maps.items()}
    return {name: float('nan') if error is None else error for name, error in errors.items()}


def beaten(errors: dict[str, float]) -> list[str]:
    """Name the live methods that are no better than both filters, or worse than the input."""
    least = min(errors[name] for name in FILTERS)
    return [f'{name}: {error:.2f}' for name, error in errors.items()
            if name not in (INPUT, *FILTERS) and not (error < least and error <= errors[INPUT])]


def _live(scene: Scene, given: FloatMap | None = None, method: str = 'scanline') -> FloatMap:
    refiner = StereoRefiner(load_preset('live', {
        'matching.method': method, 'matching.num_disparities': scene.num_disparities or 64}))
    return refiner.process(scene.pair.left, scene.pair.right, given).disparity.values


def main() -> int:
    """Print the table; return 1 where `--check` found a filter that is as good."""
    keep_freed_memory()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--data', type=Path, help='folder that holds the scene folders')
    parser.add_argument('--contrib-python', required=True,
                        help='python of an environment with opencv-contrib')
    parser.add_argument('--check', action='store_true')
    options = parser.parse_args()
    table = {name: scene_errors(load_scene(name, options.data), options.contrib_python)
             for name in list_scenes(options.data)}
    methods = list(next(iter(table.values())))
    print(markdown_table(['bad-1.0 % all', *methods], [
        [scene, *(format_number(errors[name], 2) for name in methods)]
        for scene, errors in table.items()]))
    faults = [f'{scene} {text}' for scene, errors in table.items() for text in beaten(errors)]
    print(f'\nNot better than both filters: {len(faults)}')
    for text in faults:
        print(f'- {text}')
    return 1 if options.check and faults else 0


if __name__ == '__main__':
    sys.exit(main())
