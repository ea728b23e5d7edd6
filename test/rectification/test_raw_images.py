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

"""Raw images are rectified by their camera_info: known points, every model, refusals."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.rectification.raw_images import Rectifier

WIDTH, HEIGHT = 320, 240
K = np.array([[250.0, 0, 158], [0, 252.0, 121], [0, 0, 1]])
P = np.array([[240.0, 0, 161, -24], [0, 240.0, 118, 0], [0, 0, 1, 0]])
R = cv2.Rodrigues(np.array([0.02, -0.03, 0.01]))[0]
MODELS = {
    'plumb_bob': [-0.28, 0.07, 2e-4, 1e-4, 0.01],
    'radial-tangential': [-0.28, 0.07, 2e-4, 1e-4],
    'rational_polynomial': [0.4, -0.1, 1e-4, 2e-4, 0.02, 0.7, -0.1, 0.05],
    'equidistant': [0.02, -0.01, 0.005, -0.001]}


def info_of(model='plumb_bob', d=None, **changes):
    fields = {
        'width': WIDTH, 'height': HEIGHT, 'distortion_model': model,
        'd': MODELS[model] if d is None else d, 'k': K.ravel(), 'r': R.ravel(),
        'p': P.ravel(), 'binning_x': 0, 'binning_y': 0,
        'roi': SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0)}
    return SimpleNamespace(**{**fields, **changes})


def raw_pixels(points, info):
    """Where rays of the rectified camera fall in the raw image."""
    rays = np.column_stack([(points[:, 0] - P[0, 2]) / P[0, 0],
                            (points[:, 1] - P[1, 2]) / P[1, 1], np.ones(len(points))])
    rays = rays @ R  # from the rectified to the raw camera: R transposed, on rows
    d = np.array(info.d, np.float64)
    if info.distortion_model == 'equidistant':
        flat = (rays[:, :2] / rays[:, 2:]).reshape(-1, 1, 2)
        return cv2.fisheye.distortPoints(flat, K, d).reshape(-1, 2)
    return cv2.projectPoints(rays.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), K, d)[0][:, 0]


def spot_image(centers, scale=1.0, offset=(0.0, 0.0), shape=(HEIGHT, WIDTH)):
    """Draw soft round spots at positions between the pixels."""
    y, x = np.mgrid[:shape[0], :shape[1]].astype(float)
    image = np.zeros(shape)
    for cx, cy in (centers - offset) * scale:
        image += 250 * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / 18)
    return np.rint(np.clip(image, 0, 255)).astype(np.uint8)


def spot_center(image, near):
    y, x = np.mgrid[:image.shape[0], :image.shape[1]].astype(float)
    weight = image * (np.hypot(x - near[0], y - near[1]) < 10).astype(float)
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()


POINTS = np.array([[60.0, 50], [160, 60], [250, 70], [70, 120], [161, 118], [240, 180], [90, 190]])


@pytest.mark.parametrize('model', MODELS)
def test_points_come_to_where_the_projection_matrix_puts_them(model):
    info = info_of(model)
    raw = raw_pixels(POINTS, info)
    assert np.abs(raw - POINTS).max() > 4  # the lens and the turn do something
    image = Rectifier().rectify('left/camera_info', spot_image(raw), info)
    for point in POINTS:
        assert np.hypot(*(spot_center(image, point) - point)) < 0.15


@pytest.mark.parametrize('offset, binning', [((40, 24), 1), ((0, 0), 2), ((40, 24), 2)])
def test_region_of_interest_and_binning(offset, binning):
    width, height = (WIDTH - 60) // binning, (HEIGHT - 40) // binning
    roi = SimpleNamespace(x_offset=offset[0], y_offset=offset[1], width=WIDTH - 60,
                          height=HEIGHT - 40)
    info = info_of(binning_x=binning, binning_y=binning, roi=roi)
    points = POINTS[[1, 3, 4]]
    raw = spot_image(raw_pixels(points, info), 1 / binning, offset, (height, width))
    image = Rectifier().rectify('left/camera_info', raw, info)
    assert image.shape == (height, width)
    for point in (points - offset) / binning:
        assert np.hypot(*(spot_center(image, point) - point)) < 0.2


def test_grey_and_colour_give_the_same_and_keep_their_shape():
    grey = spot_image(raw_pixels(POINTS, info_of()))
    rectifier = Rectifier()
    alone = rectifier.rectify('l', grey, info_of())
    colour = rectifier.rectify('l', np.dstack([grey] * 3), info_of())
    assert alone.shape == (HEIGHT, WIDTH) and colour.shape == (HEIGHT, WIDTH, 3)
    np.testing.assert_array_equal(colour, np.dstack([alone] * 3))


def test_maps_are_computed_once_for_a_calibration(monkeypatch):
    made = []
    original = cv2.initUndistortRectifyMap
    monkeypatch.setattr(cv2, 'initUndistortRectifyMap',
                        lambda *args: made.append(1) or original(*args))
    rectifier, image = Rectifier(), np.zeros((HEIGHT, WIDTH), np.uint8)
    other = info_of(p=(P * [[1.01], [1.01], [1]]).ravel())
    for info in (info_of(), info_of(), other, info_of(), other):
        rectifier.rectify('l', image, info)
    assert len(made) == 2
    for step in range(20):  # a calibration that never stays the same does not fill the memory
        rectifier.rectify('l', image, info_of(p=(P * [[1 + step / 100], [1], [1]]).ravel()))
    assert len(rectifier._maps) <= 4


def test_no_distortion_and_no_model_is_a_turn_alone():
    plain = info_of(model='plumb_bob', d=[0.0] * 5)
    image = spot_image(raw_pixels(POINTS, plain))
    expected = Rectifier().rectify('l', image, plain)
    for info in (info_of(model='plumb_bob', d=[]), SimpleNamespace(
            **{**vars(plain), 'distortion_model': '', 'd': []})):
        np.testing.assert_array_equal(Rectifier().rectify('l', image, info), expected)


@pytest.mark.parametrize('changes, reason, word', [
    ({'distortion_model': 'kannala'}, 'distortion', 'none of plumb_bob'),
    ({'d': [0.1, 0.2]}, 'distortion', 'D has 2 values'),
    ({'d': [np.nan] * 5}, 'distortion', 'finite'),
    ({'k': [0.0] * 9}, 'distortion', 'K has focal lengths 0'),
    ({'k': [1.0] * 4}, 'distortion', 'K has 4 values'),
    ({'r': [0.0] * 9}, 'distortion', 'R is no rotation'),
    ({'p': [0.0] * 12}, 'distortion', 'P has focal lengths 0'),
    ({'p': [np.inf] * 12}, 'distortion', 'not finite'),
    ({'width': WIDTH * 2}, 'camera_info_size', '640 x 240')])
def test_calibrations_that_cannot_be_used_are_refused_by_name(changes, reason, word):
    with pytest.raises(BadMessage, match=word) as error:
        Rectifier().rectify('left/camera_info', np.zeros((HEIGHT, WIDTH), np.uint8),
                            info_of(**changes))
    assert error.value.reason == reason
    assert str(error.value).startswith('left/camera_info: ')
