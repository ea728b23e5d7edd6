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

"""Bags and sequences over time: rows, temporal noise, CSV and plot."""

import csv
import json
import math
from xml.etree import ElementTree

from bag_writer import image, pair_messages, raw_camera_info, write_messages
import cv2
import numpy as np
import pytest
from scene_folder import small_scene

from stereo_refine_ros.camera_info import CameraModel
from stereo_refine_ros.datasets import iterate_folder
from stereo_refine_ros.evaluation.plot import PANELS, plot_svg
from stereo_refine_ros.evaluation.video import (
    average, bag_frames, CameraAdvice, Frame, measure_video, sequence_frames,
    suggested_disparities, write_csv)
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import confidence_figures, measure_frame
from stereo_refine_ros.quality.temporal import temporal_noise

PARAMS = load_preset('live', {'matching.num_disparities': 16})


@pytest.fixture(scope='module')
def scenes():
    return [small_scene(seed) for seed in (0, 0, 1)]


@pytest.fixture(scope='module')
def rows(scenes):
    frames = [Frame(number * 0.5, scene.pair) for number, scene in enumerate(scenes)]
    return list(measure_video(frames, PARAMS))


def test_what_the_images_say_of_the_cameras_is_collected(scenes):
    left, right = scenes[0].pair.left, scenes[0].pair.right
    views = [right, np.zeros_like(right), np.zeros_like(right), right]
    advice = CameraAdvice(PARAMS)
    for view in views[:3]:
        advice.add(StereoRefiner(PARAMS).process(left, view))
    line, = advice.lines()
    assert line.startswith('cameras: the right image shows nothing')
    assert line.endswith('cable (2 of 3 pairs)')
    for view in views[3:] * 2:
        advice.add(StereoRefiner(PARAMS).process(left, view))
    assert advice.lines() == []


def test_rows_hold_the_cores_figures(scenes, rows):
    result = StereoRefiner(PARAMS).process(scenes[2].pair.left, scenes[2].pair.right)
    expected = {**measure_frame(result, scenes[2].pair), **confidence_figures(result, 0.5)}
    assert 0 < expected['published_ratio'] <= 1 and expected['gain_ratio'] > 0
    for name, value in expected.items():
        if not name.endswith('_ms'):
            assert rows[2][name] == value or math.isnan(value)
    assert [row['time'] for row in rows] == [0, 0.5, 1]


def test_temporal_noise_by_frame(rows):
    assert math.isnan(rows[0]['temporal_noise_refined'])
    assert rows[1]['temporal_noise_preliminary'] == 0
    assert rows[1]['temporal_noise_refined'] == 0
    assert rows[1]['unchanged_ratio'] == rows[1]['valid_ratio_preliminary']
    assert rows[2]['unchanged_ratio'] < 0.1


def test_both_maps_are_compared_over_the_same_pixels(scenes):
    quiet = scenes[0].pair
    noisy = type(quiet)(quiet.left, np.roll(quiet.right, 1, axis=0))
    row = list(measure_video([Frame(0, quiet), Frame(1, noisy)], PARAMS))[1]
    refiner = StereoRefiner(PARAMS)  # one, as for the film: it may know the last frame
    first, second = (refiner.process(pair.left, pair.right) for pair in (quiet, noisy))
    counted = first.preliminary.valid & second.preliminary.valid
    assert row['unchanged_ratio'] == counted.mean()
    for name, old, new in (('preliminary', first.preliminary, second.preliminary),
                           ('refined', first.disparity, second.disparity)):
        assert row[f'temporal_noise_{name}'] == temporal_noise(old.values, new.values, counted)
        assert row[f'temporal_noise_{name}'] > 0


def test_a_change_of_size_starts_anew(scenes):
    small = scenes[0].pair
    cropped = type(small)(small.left[:48], small.right[:48])
    row = list(measure_video([Frame(0, small), Frame(1, cropped)], PARAMS))[1]
    assert math.isnan(row['temporal_noise_preliminary'])


def test_bag_gives_its_pairs_and_times(tmp_path, scenes):
    views = [(scene.pair.left, scene.pair.right) for scene in scenes]
    write_messages(tmp_path / 'bag', 'mcap', pair_messages(views, scenes[0].geometry))
    frames = list(bag_frames(tmp_path / 'bag', PARAMS))
    assert [frame.time for frame in frames] == pytest.approx([0, 0.1, 0.2])
    np.testing.assert_array_equal(frames[2].pair.right, scenes[2].pair.right)
    swapped = next(bag_frames(tmp_path / 'bag', PARAMS, ('/right/image_rect', '/left/image_rect')))
    np.testing.assert_array_equal(swapped.pair.left, scenes[0].pair.right)
    with pytest.raises(ValueError, match='topics of left and right, got /alone'):
        next(bag_frames(tmp_path / 'bag', PARAMS, ('/alone',)))


def test_bag_of_raw_images_is_rectified_where_the_parameters_say_so(tmp_path, scenes):
    """A calibration that turns both views by half a turn."""
    scene = scenes[0]
    height, width = scene.pair.shape
    model = CameraModel(
        width, height, 'plumb_bob', [0.0] * 5, [90.0, 0, (width - 1) / 2, 0, 90.0,
                                               (height - 1) / 2, 0, 0, 1],  # noqa: E128
        [-1.0, 0, 0, 0, -1.0, 0, 0, 0, 1.0],
        [90.0, 0, (width - 1) / 2, 0, 0, 90.0, (height - 1) / 2, 0, 0, 0, 1, 0])
    stamp = 5 * 10 ** 9
    write_messages(tmp_path / 'bag', 'mcap', [
        item for side, view in (('left', scene.pair.left), ('right', scene.pair.right))
        for item in ((f'/{side}/camera_info', stamp, raw_camera_info(stamp, model)),
                     (f'/{side}/image_raw', stamp, image(stamp, view[::-1, ::-1])))])
    rectified = next(bag_frames(tmp_path / 'bag', PARAMS.updated({'inputs.rectify': True})))
    np.testing.assert_array_equal(rectified.pair.left, scene.pair.left)
    np.testing.assert_array_equal(rectified.pair.right, scene.pair.right)
    raw = next(bag_frames(tmp_path / 'bag', PARAMS))
    np.testing.assert_array_equal(raw.pair.left, scene.pair.left[::-1, ::-1])


def test_sequence_in_the_order_of_names(tmp_path, scenes):
    for side in ('left', 'right'):
        (tmp_path / side).mkdir()
        for number, scene in enumerate(scenes):
            cv2.imwrite(str(tmp_path / side / f'{number:06d}.png'), getattr(scene.pair, side))
    frames = list(sequence_frames(iterate_folder(tmp_path)))
    assert [frame.time for frame in frames] == [0, 1, 2]
    np.testing.assert_array_equal(frames[2].pair.left, scenes[2].pair.left)
    assert suggested_disparities(tmp_path) is None
    (tmp_path / 'meta.json').write_text(json.dumps({'suggested_ndisp': 96}))
    assert suggested_disparities(tmp_path) == 96


def test_csv_and_averages(tmp_path, rows):
    write_csv(tmp_path / 'deep' / 'metrics.csv', rows)
    with (tmp_path / 'deep' / 'metrics.csv').open() as stream:
        read = list(csv.DictReader(stream))
    assert list(read[0]) == list(rows[0])
    assert read[0]['temporal_noise_refined'] == ''
    assert float(read[2]['photometric_psnr_refined']) == pytest.approx(
        rows[2]['photometric_psnr_refined'], rel=1e-5)
    means = average([{'a': 1.0, 'b': math.nan}, {'a': math.nan, 'b': math.nan}])
    assert means['a'] == 1
    assert math.isnan(means['b'])


def test_plot_is_an_svg_with_a_line_for_every_figure():
    rows = [{'time': float(number), **{
        name: number * 2.0 if number != 2 else math.nan for _, names in PANELS for name in names}}
        for number in range(5)]
    root = ElementTree.fromstring(plot_svg(rows, 'a < b'))
    paths = [path for path in root.iter('{http://www.w3.org/2000/svg}path')
             if path.get('stroke') != '#999']
    assert len(paths) == sum(len(names) for _, names in PANELS)
    # The frame that could not be measured leaves a gap: two strokes of two points each.
    assert paths[0].get('d').count('M') == 2
    assert paths[0].get('d').count('L') == 2
    assert paths[0].get('d').startswith('M70.0 170.0L')
    texts = [text.text for text in root.iter('{http://www.w3.org/2000/svg}text')]
    assert 'a < b' in texts
    assert '8' in texts
