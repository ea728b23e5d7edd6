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

"""Parameters of the real node, described, set and refused while it runs."""

import itertools
import time

from harness import floats, textured_pair
from live_node import good_pair, settled_health
import numpy as np
import pytest
from rcl_interfaces.msg import ParameterType
from stereo_refine_ros.node.views import sure_part
from stereo_refine_ros.params import load_preset, SPECS
from stereo_refine_ros.pipeline import StereoRefiner

pytestmark = pytest.mark.ros


def test_parameters_are_described(client):
    by_name = {d.name: d for d in client.describe(*(spec.name for spec in SPECS))}
    for spec in SPECS:
        descriptor = by_name[spec.name]
        assert descriptor.description.startswith(spec.description)
        ranges = [*descriptor.integer_range, *descriptor.floating_point_range]
        if spec.low is not None:
            assert (ranges[0].from_value, ranges[0].to_value) == (spec.low, spec.high)
        for choice in spec.choices:
            assert choice in descriptor.additional_constraints
    assert by_name['planes.iterations'].type == ParameterType.PARAMETER_INTEGER


def test_a_batch_is_refused_whole_with_the_reason(client):
    before = client.get('filter.radius', 'filter.method')
    result = client.set_atomically(filter__radius=5, filter__method='magic')
    assert not result.successful and 'magic' in result.reason and 'box' in result.reason
    assert client.get('filter.radius', 'filter.method') == before


@pytest.mark.parametrize('name,value,reason', [
    ('filter__radius', 0, '0'), ('filter__radius', 2.5, 'int'), ('filter__eps', 'x', 'float'),
    ('planes__min_inlier_ratio', 1.5, '1.5'), ('sync__approximate', 1, 'bool'),
    ('matching__num_disparities', 0, '0'), ('filter__eps', float('nan'), 'nan')])
def test_bad_values_are_refused(client, name, value, reason):
    before = client.get(name.replace('__', '.'))
    result, = client.set(**{name: value})
    assert not result.successful and reason in result.reason
    assert client.get(name.replace('__', '.')) == before


def test_an_integer_is_taken_for_a_float(client):
    assert client.set(segmentation__k=200)[0].successful
    value, = client.get('segmentation.k')
    assert value == 200.0 and type(value) is float


def test_values_set_while_running_reach_the_core(client):
    assert client.set(matching__num_disparities=20)[0].successful
    message, = client.exchange(good_pair())
    assert message.max_disparity == -1.5 + 19
    params = load_preset('live', {
        'matching.num_disparities': 20, 'matching.min_disparity': 1, 'segmentation.k': 200})
    expected = sure_part(StereoRefiner(params).process(*textured_pair()), 0.5)
    np.testing.assert_array_equal(floats(message.image) == -2.5, ~expected.valid)


def test_a_preset_changes_what_came_from_a_preset_and_nothing_else(node, client):
    mine = {'matching.num_disparities': 20, 'matching.min_disparity': 1, 'segmentation.k': 200.0}
    assert client.set(matching__num_disparities=20, segmentation__k=200)[0].successful
    assert client.set_atomically(preset='paper', filter__radius=4).successful
    expected = load_preset('paper', {**mine, 'filter.radius': 4}).as_dict()
    assert client.get(*expected) == list(expected.values())
    client.exchange(good_pair(), timeout_s=60.0)
    assert client.set(preset='live')[0].successful
    expected = load_preset('live', {**mine, 'filter.radius': 4}).as_dict()
    assert client.get(*expected) == list(expected.values())
    node.wait_log('preset live: now ')
    said = node.log[node.log.index('preset live: now '):]
    assert 'filter.method median' in said and 'stays filter.radius, matching' in said


def test_a_dump_loaded_one_by_one_ends_as_it_was_dumped(client):
    """As `ros2 param load` does, in the alphabet's order: the preset comes in the middle."""
    dumped = load_preset('accurate', {'filter.radius': 7, 'sync.slop': 0.02}).as_dict()
    assert client.set(preset='live')[0].successful
    for name in sorted(dumped):
        assert client.set(**{name.replace('.', '__'): dumped[name]})[0].successful
    assert client.get(*dumped) == list(dumped.values())
    back = load_preset('live', {'matching.num_disparities': 16}).as_dict()
    assert client.set_atomically(**{
        name.replace('.', '__'): value for name, value in back.items()}).successful


def test_off_is_taken_as_yaml_reads_it(client):
    assert client.set(planes__projection=False)[0].successful
    assert client.get('planes.projection') == ['off']
    assert not client.set(planes__projection=True)[0].successful
    assert client.set(planes__projection='guarded')[0].successful


def test_a_misspelt_name_is_refused_and_the_right_one_logged(node, client):
    result, = client.set(filter__radios=3)
    assert not result.successful
    node.wait_log("parameter 'filter.radios' is not known and does nothing: did you mean "
                  'filter.radius?')


def test_parameters_change_while_frames_flow(node, client):
    """Sets and frames at once: every pair is still published, superseded or refused."""
    end = time.monotonic() + 2.0
    radii = itertools.cycle((1, 2, 3))
    while time.monotonic() < end:
        client.send(good_pair())
        client.set(filter__radius=next(radii), matching__num_disparities=16)
    health = settled_health(client, lambda h: h['pairs_in_flight'] == 0)
    assert health['processing_failures'] == 0
    assert 'Traceback' not in node.log
