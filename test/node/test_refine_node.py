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

"""The real node in its own process, over DDS: values, bad input, accounting."""

import time

from harness import (
    camera_info, floats, image_message, stamp_of, stereo_messages, textured_pair)
from live_node import (
    diagnosis, GEOMETRY, good_pair, settled_health, stamps, values_of)
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from stereo_msgs.msg import DisparityImage
from stereo_refine_ros.messages.images import fill_image
from stereo_refine_ros.messages.outputs import color_map, depth_map, point_cloud
from stereo_refine_ros.messages.plane_markers import large_planes, plane_markers
from stereo_refine_ros.node.views import sure_part
from stereo_refine_ros.quality.frame import measure_frame
from stereo_refine_ros.types import StereoPair
from visualization_msgs.msg import MarkerArray

pytestmark = pytest.mark.ros


def test_disparity_is_the_cores_with_the_fields_of_the_camera(client, core):
    sent = good_pair()
    message, = client.exchange(sent)
    assert message.header == sent['left/camera_info'].header
    assert message.image.header == message.header
    assert (message.f, message.delta_d) == (200.0, 1 / 16)
    assert message.t == pytest.approx(0.1)
    assert (message.min_disparity, message.max_disparity) == (-1.5, 29.5)
    window = message.valid_window
    assert (window.x_offset, window.y_offset, window.width, window.height) == (0, 0, 160, 96)
    published = sure_part(core, 0.5)
    expected = np.where(published.valid, published.values - 2.5, -2.5)
    np.testing.assert_array_equal(floats(message.image), expected.astype(np.float32))
    assert np.median(floats(message.image)) == pytest.approx(3.5, abs=0.2)


def test_metrics_are_those_computed_offline(client, core):
    sent = good_pair()
    message, = client.exchange(sent, ('metrics',))
    assert message.header == sent['left/camera_info'].header
    sent_values = values_of(message)
    expected = measure_frame(core, StereoPair(*textured_pair()))
    assert sent_values.keys() >= expected.keys() | {
        'frame_latency_ms', 'fps', 'frames_dropped', 'pairs_unmatched', 'confidence_mean',
        'published_ratio', 'row_offset_px', 'gain_ratio', 'noise_sigma'}
    for key, value in expected.items():
        if not key.endswith('_ms'):
            assert sent_values[key] == pytest.approx(value, rel=1e-12, nan_ok=True), key
    assert all(sent_values[f'{s}_ms'] >= 0 for s in (
        'matching', 'segmentation', 'planes', 'filter', 'total'))


@pytest.mark.parametrize('comes', ['first', 'last'])
def test_ground_truth_adds_error_metrics(client, core, comes):
    client.connect(['ground_truth/disparity'])
    client.exchange_until(lambda: with_truth(good_pair()), ('metrics',),
                          lambda answers: 'mse_refined' in values_of(answers[0]))
    sent = with_truth(good_pair())
    message = sent.pop('ground_truth/disparity')
    in_order = {'ground_truth/disparity': message, **sent} if comes == 'first' else {
        **sent, 'ground_truth/disparity': message}
    answer, = client.exchange(in_order, ('metrics',))
    expected = measure_frame(core, StereoPair(*textured_pair()), truth_values(), 8.0)
    for key in ('mse', 'psnr', 'ssim', 'bad_1_0', 'bad_2_0', 'avg_error'):
        for stage in ('preliminary', 'refined'):
            name = f'{key}_{stage}'
            assert values_of(answer)[name] == pytest.approx(expected[name], rel=1e-12), name


def truth_values():
    truth = np.full((96, 160), 6.0, np.float32)
    truth[:10] = np.nan
    return truth


def with_truth(sent):
    message = DisparityImage(min_disparity=0.0, max_disparity=29.0, delta_d=0.125)
    message.header = sent['left/camera_info'].header
    fill_image(message.image, truth_values() - np.float32(2.5), '32FC1')
    return {**sent, 'ground_truth/disparity': message}


def test_every_output_is_made_from_the_cores_result(client, core):
    topics = {'disparity/preliminary': DisparityImage, 'disparity/color': Image,
              'confidence': Image, 'segments': Image, 'depth': Image,
              'depth/camera_info': CameraInfo, 'points': PointCloud2, 'planes': MarkerArray}
    for topic, kind in topics.items():
        client.subscribe(topic, kind)
    sent, found = complete_answer(client, tuple(topics))
    answers = dict(zip(topics, found, strict=True))
    header = sent['left/camera_info'].header
    assert all(answers[topic].header == header for topic in topics if topic != 'planes')
    preliminary = core.preliminary.values
    np.testing.assert_array_equal(
        floats(answers['disparity/preliminary'].image),
        np.where(np.isfinite(preliminary), preliminary - np.float32(2.5), np.float32(-2.5)))
    np.testing.assert_array_equal(pixels(answers['disparity/color'], 'bgr8', np.uint8),
                                  color_map(sure_part(core, 0.5)))
    np.testing.assert_array_equal(
        pixels(answers['segments'], '32SC1', np.int32), core.segments.labels)
    np.testing.assert_array_equal(floats(answers['confidence']), core.confidence)
    assert answers['depth/camera_info'] == sent['left/camera_info']
    depth = floats(answers['depth'])
    np.testing.assert_array_equal(depth, depth_map(sure_part(core, 0.5), GEOMETRY))
    assert np.nanmedian(depth) == pytest.approx(200 * 0.1 / 3.5, rel=0.05)
    cloud = point_cloud(header, depth, GEOMETRY, textured_pair()[0])
    assert answers['points'] == cloud and np.isfinite(depth).any()
    planes = plane_markers(header, large_planes(core.segments, GEOMETRY))
    assert shapes(answers['planes']) == shapes(planes) and len(planes.markers) > 1


def complete_answer(client, topics):
    """Send pairs until all of the topics answered one: subscribers may be found late."""
    end = time.monotonic() + 60.0
    while True:
        sent = good_pair()
        try:
            return sent, client.exchange(sent, topics, 3.0)
        except AssertionError:
            assert time.monotonic() < end, {
                topic: len(client.received[topic]) for topic in topics}


def shapes(array):
    return [(m.header, m.ns, m.id, m.type, m.action, m.points) for m in array.markers]


def pixels(message, encoding, dtype):
    assert message.encoding == encoding and not message.is_bigendian
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width, -1).squeeze()


def spoil(change):
    sent = good_pair()
    change(sent)
    return sent


def other_encoding(sent):
    sent['left/image_rect'].encoding = 'jpeg'


def short_data(sent):
    sent['right/image_rect'].data = sent['right/image_rect'].data[:-7]


def zero_size(sent):
    sent['left/image_rect'] = Image(header=sent['left/image_rect'].header, encoding='mono8')


def other_size(sent):
    small = textured_pair(width=100)[1]
    sent['right/image_rect'] = image_message(small, 'bgr8', 0)
    sent['right/image_rect'].header = sent['left/image_rect'].header


def absurd_size(sent):
    sent['left/image_rect'].width = sent['left/image_rect'].step = 2 ** 32 - 1


def swapped(sent):
    sent['right/camera_info'].p[3] *= -1


def calibrated_for_another_size(sent):
    stamp = sent['left/camera_info'].header
    sent['left/camera_info'] = camera_info(320, 240, 0)
    sent['left/camera_info'].header = stamp


@pytest.mark.parametrize('change,reason', [
    (other_encoding, 'encoding'), (short_data, 'data_size'), (zero_size, 'zero_size'),
    (other_size, 'size_differs'), (absurd_size, 'too_large'),
    (swapped, 'baseline'), (calibrated_for_another_size, 'camera_info_size')])
def test_bad_input_is_refused_warned_of_once_and_survived(node, client, change, reason):
    for _ in range(3):
        client.send(spoil(change))
        client.spin(0.05)
    message, = client.exchange(good_pair(), ('disparity',))
    assert message.image.width == 160
    answer, = client.exchange(good_pair(), ('metrics',))
    health = settled_health(client, lambda h: h.get(f'refused.{reason}', 0) >= 3)
    assert health[f'refused.{reason}'] == 3
    assert values_of(answer)['pairs_refused'] >= 3
    assert node.log.count('pair refused') == len(
        [key for key in health if key.startswith('refused.')])


def test_every_pair_is_accounted_for(client):
    before = client.health()['pairs_published']
    client.received['disparity'].clear()
    client.exchange(good_pair(), ('metrics',))
    for _ in range(40):
        newest = good_pair()
        client.send(newest)
        client.spin(0.002)
    client.until(lambda: client.received['disparity'][-1].header == newest[
        'left/camera_info'].header, 10.0, 'the newest frame')
    stamps = [(m.header.stamp.sec, m.header.stamp.nanosec)
              for m in client.received['disparity']]
    assert stamps == sorted(stamps)
    health = settled_health(client, lambda h: h['pairs_in_flight'] == 0 and (
        h['pairs_published'] >= before + len(client.received['disparity'])))
    assert health['pairs_received'] == (
        health['pairs_published'] + health['pairs_superseded'] + health['pairs_refused'])
    assert health['pairs_received'] >= before + 30


def test_stamps_that_never_match_are_counted_and_explained(node, client):
    def explained():
        sent = good_pair()
        sent['right/image_rect'].header.stamp = stamp_of(next(stamps) - 29_000_000)
        client.send(sent)
        client.spin(0.03)
        return 'pairs unmatched: stamps of one instant differ by 4.0 ms' in diagnosis(
            client).message
    before = client.health()['pairs_unmatched']
    client.until(explained, 10.0, 'a word on stamps')
    assert client.health()['pairs_unmatched'] > before
    node.wait_log('pairs are not complete: stamps of one instant differ by 4.0 ms: set sync.appr')
    client.exchange(good_pair())


def test_approximate_pairing_is_switched_on_while_running(client):
    assert client.set_atomically(sync__approximate=True, sync__slop=0.005).successful
    sent = good_pair()
    for name in ('right/image_rect', 'right/camera_info'):
        sent[name].header.stamp.nanosec += 4_000_000
    message, = client.exchange(sent)
    assert message.header == sent['left/camera_info'].header
    assert client.set_atomically(sync__approximate=False).successful


def test_time_that_jumps_back_is_survived(client):
    jumped = stereo_messages(*textured_pair(), 5_000)
    client.exchange(jumped)
    client.exchange(good_pair())
