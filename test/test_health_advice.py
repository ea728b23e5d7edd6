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

"""What the health of a pair means: every fault is named, healthy pairs stay OK."""

import cv2
from real_scenes import real_scene_folder
import numpy as np  # noqa: I100
import pytest

from stereo_refine_ros.health_advice import (  # noqa: I101
    advise, Advice, FRAMES_LOOKED_AT, FRAMES_NEEDED, Level, Observation, Settled)
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.types import PairHealth

GOOD = {'row_offset_px': 0.2, 'gain_ratio': 1.05, 'noise_sigma': 1.5, 'matched_ratio': 0.85,
        'last_disparity_ratio': 0.01, 'upside_down_ratio': 0.1, 'swapped_ratio': 0.1,
        'sharpness_ratio': 0.9, 'saturated_ratio': 0.1, 'contrast_left': 45.0,
        'contrast_right': 44.0, 'given_agreement': 0.9}


def seen(ratio=0.85, frozen='', distortion=False, external=False, corrected=True, **health):
    return Observation(
        PairHealth(**{**GOOD, **health}), ratio, frozen, distortion, external, corrected)


def said(observation):
    return [(item.key, item.level, item.text) for item in advise(observation)]


@pytest.mark.parametrize('observation', [
    seen(), seen(distortion=True), seen(0.4), seen(0.56, distortion=True),
    seen(0.27, matched_ratio=0.44), seen(0.08, matched_ratio=0.74, noise_sigma=4.9),
    seen(external=True), seen(row_offset_px=2.03), seen(corrected=False, row_offset_px=0.49),
    seen(0.39, matched_ratio=0.57, upside_down_ratio=0.42, swapped_ratio=0.39),
    seen(gain_ratio=0.8), seen(gain_ratio=1.25),
    seen(contrast_left=4.0, contrast_right=4.2), seen(last_disparity_ratio=0.09),
    seen(nearer_ratio=0.02),
    seen(given_agreement=0.0), seen(float('nan'), external=True),
    seen(0.6, contrast_left=10.0, contrast_right=50.0),
    Observation(PairHealth()), Observation(PairHealth(), is_external=True)])
def test_what_is_well_is_left_alone(observation):
    assert said(observation) == []


@pytest.mark.parametrize('observation,key,level,words', [
    (seen(0.07, contrast_right=0.2), 'black', Level.ERROR, 'the right image shows nothing'),
    (seen(0.0, contrast_left=0.0, contrast_right=0.0), 'black', Level.ERROR,
     'the left and the right image shows nothing'),
    (seen(0.01, contrast_right=6.0), 'covered', Level.ERROR, 'the right image has only 13 %'),
    (seen(0.01, contrast_left=6.0), 'covered', Level.ERROR, 'the left image has only 14 %'),
    (seen(0.3, 'right'), 'frozen', Level.ERROR, 'restart that camera'),
    (seen(1.0, is_same_image=True), 'same_image', Level.ERROR, 'remap right/image_rect'),
    (seen(0.1, matched_ratio=0.1, upside_down_ratio=0.6), 'upside_down', Level.ERROR, '180'),
    (seen(0.12, matched_ratio=0.12, swapped_ratio=0.7), 'exchanged', Level.ERROR,
     'swap the topics'),
    (seen(0.83, matched_ratio=0.04, swapped_ratio=0.63), 'exchanged', Level.ERROR,
     'swap the topics'),
    (seen(0.05, matched_ratio=0.33, swapped_ratio=0.85, upside_down_ratio=0.5), 'exchanged',
     Level.ERROR, 'swap the topics'),
    (seen(0.11, matched_ratio=float('nan'), upside_down_ratio=0.6), 'upside_down', Level.ERROR,
     '180'),
    (seen(0.11, matched_ratio=0.2), 'unrelated', Level.ERROR, 'only 11 % of the pixels match'),
    (seen(0.06, noise_sigma=9.5, matched_ratio=0.49), 'noisy', Level.WARN,
     'the noise is 10 grey levels'),
    (seen(0.15, distortion=True, matched_ratio=0.2, row_offset_px=9.0, corrected=True), 'raw',
     Level.WARN, 'set inputs.rectify'),
    (seen(0.45, distortion=True, row_offset_px=float('nan')), 'raw', Level.WARN,
     'set inputs.rectify'),
    (seen(0.3, matched_ratio=float('nan')), 'doubtful', Level.WARN,
     'check that the images are rectified'),
    (seen(0.39, row_offset_px=3.04), 'rows_off', Level.WARN, '3.0 px apart: calibrate'),
    (seen(corrected=False, row_offset_px=0.5), 'rows_off', Level.WARN, '0.5 px apart'),
    (seen(gain_ratio=0.79), 'gain', Level.WARN, '0.79 times as bright'),
    (seen(gain_ratio=1.26), 'gain', Level.WARN, '1.26 times as bright'),
    (seen(sharpness_ratio=0.3), 'blurred', Level.WARN, 'dirty, fogged'),
    (seen(last_disparity_ratio=0.2), 'too_near', Level.WARN, '20 % of the matches'),
    (seen(nearer_ratio=0.17), 'too_near', Level.WARN, '17 % of the matches'),
    (seen(nearer_ratio=0.03, last_disparity_ratio=float('nan')), 'too_near', Level.WARN, '3 %'),
    (seen(external=True, fits_right_better=True, given_agreement=0.1), 'given_right',
     Level.WARN, 'fits the right image better'),
    (seen(external=True, given_agreement=0.1), 'given_wrong', Level.ERROR, '10 % of the sure')])
def test_each_fault_is_named_with_what_to_do(observation, key, level, words):
    (found, found_level, text), = said(observation)
    assert (found, found_level) == (key, level)
    assert words in text


def test_causes_silence_their_symptoms_and_the_worst_comes_first():
    dead = seen(0.07, contrast_right=0.2, row_offset_px=9.0, gain_ratio=0.01, external=True,
                given_agreement=0.0)
    assert [key for key, *_ in said(dead)] == ['black', 'given_wrong']
    assert [key for key, *_ in said(seen(0.1, gain_ratio=2.0, matched_ratio=0.1))] == [
        'unrelated']
    assert [key for key, *_ in said(seen(gain_ratio=2.0, sharpness_ratio=0.5))] == [
        'gain', 'blurred']
    assert [key for key, *_ in said(seen(gain_ratio=2.0, external=True, given_agreement=0.0))
            ] == ['given_wrong', 'gain']


def test_one_odd_frame_raises_nothing_and_one_good_frame_ends_nothing():
    settled, odd = Settled(), [Advice('gain', Level.WARN, 'brighter')]
    assert [settled.add(odd) for _ in range(FRAMES_NEEDED - 1)] == [[]] * (FRAMES_NEEDED - 1)
    newest = [Advice('gain', Level.WARN, 'brighter still'), Advice('raw', Level.WARN, 'once')]
    assert settled.add(newest) == newest[:1]
    good = FRAMES_LOOKED_AT - FRAMES_NEEDED
    assert [len(settled.add([])) for _ in range(good + 1)] == [1] * good + [0]


def test_errors_come_before_warnings_when_settled():
    settled = Settled()
    both = [Advice('gain', Level.WARN, 'b'), Advice('frozen', Level.ERROR, 'a')]
    for _ in range(FRAMES_NEEDED):
        found = settled.add(both)
    assert [item.key for item in found] == ['frozen', 'gain']


HEALTHY = (
    'field/eth3d/delivery_area_1l', 'field/eth3d/delivery_area_2s', 'field/eth3d/electro_1s',
    'field/eth3d/electro_2l', 'field/eth3d/forest_1s', 'field/eth3d/playground_1s',
    'field/eth3d/terrace_1s', 'field/kitti2012/000000_10', 'field/kitti2012/000032_10',
    'field/kitti2012/000056_10', 'field/kitti2012/000120_10', 'field/kitti2012/000168_10',
    'field/middlebury/Lampshade1', 'field/middlebury/Midd1', 'field/middlebury/Bowling1',
    'field/middlebury/Motorcycle', 'field/middlebury/Playroom', 'middlebury/Art',
    'middlebury/teddy', 'middlebury/tsukuba', 'middlebury/venus')


def scene(name, width=400):
    """Return a pair of a set, as wide as makes the test quick, and its search range."""
    folder = real_scene_folder(f'../{name}')
    pair = [cv2.imread(str(folder / f'{side}.png')) for side in ('left', 'right')]
    scale = width / pair[0].shape[1]
    pair = [cv2.resize(view, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            for view in pair]
    return pair[0], pair[1]


def observe(left, right):
    refiner = StereoRefiner(load_preset('live', {'matching.num_disparities': 96}))
    result = refiner.process(left, right)
    return Observation(result.health, result.lr_consistent_ratio)


@pytest.mark.parametrize('name', HEALTHY)
def test_healthy_pairs_of_all_sets_are_left_alone(name):
    assert said(observe(*scene(name))) == []


@pytest.mark.parametrize('name', ['field/eth3d/terrace_1s', 'middlebury/teddy'])
def test_a_dark_pair_is_left_alone(name):
    rng = np.random.default_rng(2)
    dark = [np.clip(view * 0.12 + rng.normal(0.0, 0.6, view.shape), 0, 255).astype(np.uint8)
            for view in scene(name)]
    assert said(observe(*dark)) == []


def test_the_right_view_of_another_scene_is_an_error():
    left = scene('middlebury/teddy')[0]
    right = cv2.resize(scene('middlebury/venus')[1], left.shape[1::-1])
    assert [(key, level) for key, level, _ in said(observe(left, right))] == [
        ('unrelated', Level.ERROR)]
