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

"""Maps of other matchers as their drivers publish them: signs, units, crops, lateness."""

from harness import image_message, textured_pair
import numpy as np
import pytest
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.messages.disparity import check_disparity, read_disparity
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.node.calibration import Calibration
from stereo_refine_ros.node.frame import check_frame, decode_frame
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import CameraParams

pytestmark = pytest.mark.ros
NOTHING = CameraParams()
NAN = np.float32(np.nan)


def given(values, encoding='32FC1', dtype=np.float32, **fields):
    message = DisparityImage(**fields)
    fill_image(message.image, np.asarray(values, dtype), encoding)
    return message


@pytest.mark.parametrize('low,high', [(-40.0, -2.0), (-2.0, -40.0), (2.0, 40.0), (40.0, 2.0)])
def test_a_zed_publishes_negative_disparities(low, high):
    message = given([[-5.0, -20.0, NAN, -39.0]], f=500.0, t=0.12, min_disparity=low,
                    max_disparity=high)
    back = read_disparity('d', message)
    np.testing.assert_array_equal(back.values, np.float32([[5.0, 20.0, NAN, 39.0]]))
    assert (back.min_disparity, back.max_disparity) == (2.0, 40.0)
    assert (back.focal_px, back.baseline_m) == (500.0, pytest.approx(0.12))


def test_one_negative_value_is_a_mark_and_no_sign():
    back = read_disparity('d', given([[-1.0, -1.0, -1.0, 5.0]], max_disparity=31.0))
    np.testing.assert_array_equal(back.values, np.float32([[NAN, NAN, NAN, 5.0]]))
    back = read_disparity('d', given([[-1.0, -1.0, -1.0, -1.0]], max_disparity=31.0))
    assert np.isnan(back.values).all()
    back = read_disparity('d', given([[-3.0, -2.0, 5.0, 6.0]], min_disparity=-4.0,
                                     max_disparity=31.0))
    np.testing.assert_array_equal(back.values, np.float32([[-3.0, -2.0, 5.0, 6.0]]))


@pytest.mark.parametrize('encoding,dtype,order', [
    ('16SC1', '<i2', 0), ('16UC1', '<u2', 0), ('16SC1', '>i2', 1)])
def test_whole_numbers_are_steps_of_delta_d(encoding, dtype, order):
    mark = -16 if encoding == '16SC1' else 0
    message = given([[mark, 16, 100, 401]], encoding, dtype, delta_d=1 / 16, min_disparity=0.5,
                    max_disparity=31.0)
    message.image.is_bigendian = order
    back = read_disparity('d', message)
    np.testing.assert_array_equal(back.values, np.float32([[NAN, 1.0, 6.25, 25.0625]]))


@pytest.mark.parametrize('delta_d', [0.0, -1.0, 2.0, float('nan')])
def test_whole_numbers_without_delta_d_are_refused(delta_d):
    with pytest.raises(BadMessage, match='16SC1 needs delta_d, the pixels that 1 stands for'):
        check_disparity('d', given([[5]], '16SC1', np.int16, delta_d=delta_d))


def frame_with(shape, camera=NOTHING, **fields):
    left = image_message(textured_pair()[0], 'bgr8', 1)
    values = np.linspace(4, 20, shape[0] * shape[1]).reshape(shape)
    message = given(values, min_disparity=0.0, max_disparity=31.0, **fields)
    found = MessageSet(1, {'left/image_rect': left, 'preliminary/disparity': message})
    return decode_frame(check_frame(found, Calibration(), camera))


@pytest.mark.parametrize('shape', [(96, 160), (48, 80), (32, 54), (192, 320)])
def test_a_map_of_the_same_view_at_any_scale_is_taken(shape):
    decoded = frame_with(shape, f=200.0, t=0.1)
    assert decoded.preliminary.shape == (96, 160)
    assert decoded.rescaled == (shape != (96, 160)) and decoded.has_depth
    assert np.nanmax(decoded.preliminary) == pytest.approx(20.0 * 160 / shape[1], rel=0.01)


@pytest.mark.parametrize('shape', [(80, 160), (96, 128), (48, 96), (40, 80)])
def test_a_map_of_another_aspect_ratio_is_a_crop(shape):
    with pytest.raises(BadMessage) as refused:
        frame_with(shape, f=200.0, t=0.1)
    assert refused.value.reason == 'aspect_ratio'
    assert f'{shape[1]} x {shape[0]}, the left image 160 x 96: another' in str(refused.value)


def test_a_map_without_focal_length_and_baseline_has_no_depth_unless_told():
    assert not frame_with((96, 160)).has_depth
    told = frame_with((96, 160), CameraParams(baseline=0.2, focal_length=300.0))
    assert (told.geometry.focal_px, told.geometry.baseline_m) == (300.0, 0.2)
