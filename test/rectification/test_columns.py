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

"""How far columns are believed where rows are bent: by its formula, and on a real car."""

import math

import numpy as np
import pytest
from real_pairs import lowered, turned
from real_scenes import real_scene_folder

from stereo_refine_ros.datasets.middlebury import read_scene
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.rectification import columns_hold, find_row_offset, RowOffset

pytestmark = pytest.mark.compiled
WIDTH, HEIGHT = 640, 480
FLAT = np.full((HEIGHT, WIDTH), 40, np.float32)


@pytest.mark.parametrize('offset', [
    RowOffset(), RowOffset(offset_px=-7.0, points=200),
    RowOffset(tilt_px=WIDTH * math.radians(0.5))], ids=['none', 'shift', 'turn'])
def test_what_a_shift_or_a_turn_explains_says_nothing_against_columns(offset):
    np.testing.assert_array_equal(columns_hold(FLAT, offset, WIDTH), 1)


@pytest.mark.parametrize('scale', [1, 2])
def test_columns_are_as_unsure_as_rows_are_bent(scale):
    offset = RowOffset(2.0, tilt_px=0.3, stretch_px=-1.5, twist_px=6.0)
    disparity = FLAT[::scale, ::scale].copy()
    disparity[:, -20:] = 300
    disparity[0, 0] = np.nan
    hold = columns_hold(disparity, offset, WIDTH, scale)
    assert hold[0, 0] == 1 and hold.dtype == np.float32
    y, x = np.mgrid[:HEIGHT // scale, :WIDTH // scale]
    across = (x * scale - disparity) / (WIDTH - 1) - 0.5
    down = y / (HEIGHT // scale - 1) - 0.5
    bent = 0.3 * across - 1.5 * down + 6.0 * across * down
    expected = [[math.erf(1 / (math.sqrt(2) * max(abs(px), 1e-3))) if px == px else 1
                 for px in row] for row in bent]
    np.testing.assert_allclose(hold, expected, atol=2e-5)
    assert hold[-1, 8] < 0.6 < 0.99 < hold[HEIGHT // scale // 2, WIDTH // scale // 2]
    np.testing.assert_array_equal(hold, columns_hold(disparity, offset, WIDTH, scale, 3))


def refined(scene, preset, right=None):
    refiner = StereoRefiner(load_preset(preset, {
        'matching.num_disparities': scene.num_disparities, 'temporal.enabled': False}))
    return refiner.process(scene.pair.left, scene.pair.right if right is None else right)


@pytest.mark.parametrize('preset', ['live', 'accurate'])
def test_confidence_knows_of_a_bent_view(preset):
    scene = read_scene(real_scene_folder('../field/kitti2012/000184_10'))
    result = refined(scene, preset)
    offset = find_row_offset(scene.pair.left, scene.pair.right, 0, scene.num_disparities)
    hold = columns_hold(result.disparity.values, offset, scene.pair.left.shape[1])
    is_bent, known = hold < 0.8, np.isfinite(scene.truth)
    wrong = np.abs(result.disparity.values - scene.truth) > 1
    # 36 % of what is bent by more than 0.8 px is wrong here, 7 % of the rest.
    assert wrong[known & is_bent].mean() > 4 * wrong[known & ~is_bent].mean()
    assert result.confidence[known & is_bent].mean() == pytest.approx(
        1 - wrong[known & is_bent].mean(), abs=0.1)
    assert not np.any(result.confidence[is_bent] >= 0.9)


@pytest.mark.parametrize('fault', [lowered, turned])
def test_confidence_does_not_suffer_from_what_is_undone(fault):
    scene = read_scene(real_scene_folder('../field/eth3d/delivery_area_1l'))
    as_it_is = refined(scene, 'live').confidence.mean()
    amount = 2.0 if fault is lowered else 0.5
    with_fault = refined(scene, 'live', fault(scene.pair.right, amount))
    assert with_fault.confidence.mean() > as_it_is - 0.03
