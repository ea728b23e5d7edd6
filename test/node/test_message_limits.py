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

"""Messages at the limits of what is taken, and what a refusal says."""

from harness import camera_info
import numpy as np
import pytest
from sensor_msgs.msg import Image
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.camera_info import FOCAL_PX, is_within, stereo_geometry
from stereo_refine_ros.encodings import BadMessage, decode_image, MAX_PIXELS, MAX_SIDE
from stereo_refine_ros.messages.disparity import check_disparity, read_disparity
from stereo_refine_ros.messages.images import fill_image

pytestmark = pytest.mark.ros


def image(width, height, encoding, step=None, size=None):
    message = Image(width=width, height=height, encoding=encoding,
                    step=width if step is None else step)
    message.data.frombytes(bytes(message.step * height if size is None else size))
    return message


def infos():
    return camera_info(160, 96, 1), camera_info(160, 96, 1, baseline=0.1)


def refusal(task, *args):
    with pytest.raises(BadMessage) as refused:
        task(*args)
    return refused.value.reason, str(refused.value)


@pytest.mark.parametrize('width,height', [(MAX_SIDE, 1), (1, MAX_SIDE)])
def test_the_longest_side_is_taken_and_one_more_is_not(width, height):
    assert decode_image('left', image(width, height, 'mono8')).shape == (height, width)
    longer = image(width + (width > 1), height + (height > 1), 'mono8')
    assert refusal(decode_image, 'left', longer)[0] == 'too_large'


def test_the_largest_image_is_refused_for_its_data_alone():
    height = MAX_PIXELS // MAX_SIDE
    assert MAX_SIDE * height == MAX_PIXELS
    largest = image(MAX_SIDE, height, 'mono8', size=0)
    assert refusal(decode_image, 'left', largest)[0] == 'data_size'
    larger = image(MAX_SIDE, height + 1, 'mono8', size=0)
    assert refusal(decode_image, 'left', larger)[0] == 'too_large'


def test_the_smallest_bayer_image():
    assert decode_image('left', image(4, 4, 'bayer_rggb8')).shape == (4, 4, 3)
    assert refusal(decode_image, 'left', image(3, 4, 'bayer_rggb8'))[0] == 'encoding'


def test_refusals_say_what_was_expected():
    assert refusal(decode_image, 'left', image(8, 2, 'mono16', step=8)) == (
        'step', 'left: step 8, a row of 8 mono16 needs 16 bytes')
    assert refusal(decode_image, 'left', image(8, 2, 'mono8', size=15)) == (
        'data_size', 'left: 15 bytes of data, step 8 x height 2 is 16')
    _, text = refusal(decode_image, 'left', image(8, 2, 'y' * 41))
    assert f"encoding '{'y' * 40}' is none of mono8, 8UC1, mono16," in text
    message = DisparityImage(image=image(8, 2, 'z' * 41, step=32))
    assert refusal(check_disparity, 'd', message) == (
        'encoding', f"d: encoding '{'z' * 40}' is none of 32FC1, 16SC1, 16UC1")
    message = DisparityImage(image=image(8, 2, '32FC1'))
    assert refusal(read_disparity, 'd', message)[1].startswith('d: step 8')


@pytest.mark.parametrize('side,name', [(0, 'left/camera_info'), (1, 'right/camera_info')])
def test_refusals_name_the_camera_info(side, name):
    pair = infos()
    pair[side].width, pair[side].binning_x = 321, 1
    assert refusal(stereo_geometry, *pair, 160, 96) == (
        'camera_info_size', f'{name}: for 321 x 96, the image is 160 x 96')
    pair = infos()
    pair[side].p[0] = 0.0
    reason, text = refusal(stereo_geometry, *pair, 160, 96)
    assert reason == 'focal_length' and text.startswith(f'{name}: P has fx 0, fy 200')
    assert text.endswith('is the camera calibrated and rectified?')
    pair = infos()
    pair[side].p = [1.0] * 11
    assert refusal(stereo_geometry, *pair, 160, 96) == (
        'focal_length', f'{name}: P has 11 values instead of 12')


def test_a_baseline_of_the_wrong_sign_is_explained():
    left, right = infos()
    right.p[3] = 20.0
    assert refusal(stereo_geometry, left, right, 160, 96) == (
        'baseline', 'right/camera_info: baseline -P[3] / P[0] is -0.1 m; it must be positive '
        'and plausible (are left and right swapped?)')


def test_binning_rounds_odd_sizes_down():
    pair = infos()
    for info in pair:
        info.width, info.height, info.binning_x, info.binning_y = 321, 193, 2, 2
    assert stereo_geometry(*pair, 160, 96).focal_px == 100.0


@pytest.mark.parametrize('cx', [0.0, -5.0])
def test_a_principal_point_at_or_left_of_the_first_column(cx):
    left, right = infos()
    left.p[2] = right.p[2] = cx
    assert stereo_geometry(left, right, 160, 96).cx_left == cx


def test_limits_are_within():
    assert [is_within(value, FOCAL_PX) for value in (0.00999, 0.01, 1e6, 1.01e6)] == [
        False, True, True, False]


def disparity(values, is_bigendian=0, order='<', **fields):
    message = DisparityImage(**fields)
    fill_image(message.image, np.asarray(values, f'{order}f4'), '32FC1')
    message.image.is_bigendian = is_bigendian
    return message


def test_the_largest_plausible_disparity_and_range():
    message = disparity([[1e5, 100001.0]], min_disparity=-1e5, max_disparity=1e5, delta_d=0.125)
    back = read_disparity('d', message)
    np.testing.assert_array_equal(back.values, np.float32([[1e5, np.nan]]))
    assert (back.min_disparity, back.max_disparity, back.delta_d) == (-1e5, 1e5, 0.125)


@pytest.mark.parametrize('order,flag', [('<', 0), ('>', 1)])
def test_where_both_byte_orders_make_sense_the_flag_decides(order, flag):
    value = np.uint32(0x41000042).view(np.float32)  # 8.00006; with its bytes reversed 32.0002
    back = read_disparity('d', disparity([[value, value]], flag, order))
    np.testing.assert_array_equal(back.values, [[value, value]])
    assert back.values.dtype == np.float32
