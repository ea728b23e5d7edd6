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

"""Colours mean what the legend says."""

import base64
import re

import cv2
import numpy as np
import pytest

from stereo_refine_ros.evaluation.pictures import (
    color_confidence, color_disparity, color_error, confidence_gradient, data_uri,
    disparity_gradient, draw_segments, error_gradient, frame_sheet, write_picture)
from stereo_refine_ros.types import DisparityMap, PlaneSegmentation, RefinementResult

VIOLET, YELLOW = [84, 1, 68], [36, 231, 253]  # the ends of viridis, BGR


def test_disparity_colours_span_the_range_and_holes_are_black():
    values = np.array([[5, 10, 0, 40, np.nan]], np.float32)
    picture = color_disparity(values, 5, 10)
    expected = [VIOLET, YELLOW, VIOLET, YELLOW, [0, 0, 0]]
    np.testing.assert_allclose(picture[0], expected, atol=1)  # OpenCV rounds its ends by version
    np.testing.assert_array_equal(picture[0, 4], 0)


def test_disparity_colours_of_a_flat_scene():
    picture = color_disparity(np.full((1, 1), 7, np.float32), 7, 7)
    np.testing.assert_allclose(picture[0, 0], VIOLET, atol=1)


def test_error_colours():
    truth = np.array([[10, 10, 10, 10, np.nan]], np.float32)
    values = np.array([[10, 14, 3, np.nan, 9]], np.float32)
    picture = color_error(values, truth)
    np.testing.assert_array_equal(
        picture[0], [[245, 247, 247], [0, 0, 127], [0, 0, 127], [0, 0, 0], [128, 128, 128]])


def test_confidence_colours_run_from_dark_to_light():
    picture = color_confidence(np.array([[0, 0.25, 0.5, 0.75, 1, np.nan, 1.5]], np.float32))
    lightness = cv2.cvtColor(picture, cv2.COLOR_BGR2LAB)[0, :5, 0].astype(int)
    assert (np.diff(lightness) > 30).all()
    assert (lightness[0], lightness[-1]) == (pytest.approx(0, abs=3), pytest.approx(250, abs=5))
    np.testing.assert_array_equal(picture[0, 5], picture[0, 0])
    np.testing.assert_array_equal(picture[0, 6], picture[0, 4])


def test_segments_of_one_plane_look_alike_and_boundaries_are_white():
    labels = np.repeat(np.arange(4, dtype=np.int32), 6)[None].repeat(8, axis=0)
    planes = np.array([[0, 0, 5.0], [0, 0, 5], [0, 0.1, 2], [np.nan] * 3])
    segments = PlaneSegmentation(
        labels, planes, np.isfinite(planes[:, 0]), np.ones(4, np.float32),
        np.array([0, 0, 1, -1], np.int32))
    left = np.full((8, 24, 3), 100, np.uint8)
    row = draw_segments(left, segments)[4]
    np.testing.assert_array_equal(row[0], row[6])
    np.testing.assert_array_equal(row[7], row[11])
    np.testing.assert_array_equal(row[[12, 18]], 255)
    assert (row[13] != row[0]).any()
    assert row[20, 0] == row[20, 1] == row[20, 2]
    assert len(set(row[13].tolist())) > 1


def test_picture_survives_its_encoding():
    picture = cv2.resize(np.array([[0, 255], [128, 40]], np.uint8), (64, 64))
    picture = np.repeat(picture[..., None], 3, axis=2)
    kind, _, encoded = data_uri(picture).partition(',')
    assert kind == 'data:image/webp;base64'
    back = cv2.imdecode(np.frombuffer(base64.b64decode(encoded), np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(back.astype(int) - picture).mean() < 3


def test_colour_bars_start_and_end_like_the_colours():
    stops = re.findall(r'rgb\((\d+), (\d+), (\d+)\)', disparity_gradient())
    assert len(stops) == 9
    np.testing.assert_allclose(np.array(stops[0], int), VIOLET[::-1], atol=1)
    np.testing.assert_allclose(np.array(stops[-1], int), YELLOW[::-1], atol=1)
    first = [int(level) for level in re.findall(r'\d+', confidence_gradient())[:3]]
    np.testing.assert_array_equal(
        color_confidence(np.zeros((1, 1), np.float32))[0, 0], first[::-1])
    assert error_gradient().startswith('rgb(247, 247, 245)')


def test_sheet_of_a_frame(tmp_path):
    left = np.full((4, 6), 90, np.uint8)
    preliminary = np.full((4, 6), np.nan, np.float32)
    refined = np.full((4, 6), 10, np.float32)
    segments = PlaneSegmentation(np.zeros((4, 6), np.int32), np.array([[0.0, 0.0, 10.0]]),
                                 np.array([True]), np.ones(1, np.float32))
    sheet = frame_sheet(left, RefinementResult(
        DisparityMap(refined, 2, 8), DisparityMap(preliminary, 2, 8), segments, 1.0, {}))
    assert sheet.shape == (8, 12, 3)
    assert (sheet[:4, :6] == 90).all() and (sheet[4:, :6] == 0).all()
    np.testing.assert_array_equal(sheet[:4, 6:], draw_segments(left, segments))
    np.testing.assert_allclose(sheet[4:, 6:], np.broadcast_to(YELLOW, (4, 6, 3)), atol=1)
    write_picture(tmp_path / 'sheet.png', sheet)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / 'sheet.png')), sheet)
    with pytest.raises(ValueError, match='cannot be written'):
        write_picture(tmp_path / 'nowhere' / 'sheet.png', sheet)
