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

"""Parameters that would pass in silence are named, with what was meant."""

import pytest

from stereo_refine_ros.node.parameter_advice import explain, is_foreign, unused_files

pytestmark = pytest.mark.ros


@pytest.mark.parametrize('name,meant', [
    ('matching.num_disparites', 'did you mean matching.num_disparities?'),
    ('num_disparities', 'did you mean matching.num_disparities?'),
    ('filter.radios', 'did you mean filter.radius?'),
    ('approximate_sync', 'use sync.approximate'),
    ('stereo_algorithm', 'use matching.method: bm for 0, sgbm for 1'),
    ('disparity_range', 'use matching.num_disparities'),
    ('min_disparity', 'use matching.min_disparity'),
    ('use_system_default_qos', 'use qos_overrides.<topic>.subscription.reliability'),
    ('image_transport', 'use inputs.image_transport'),
    ('processing.max_cells', 'use processing.refine_pixels'),
    ('processing.min_rows', 'use processing.refine_pixels'),
    ('planes.spread', 'leave it out; planes.projection guarded'),
    ('P1', 'has no counterpart here'), ('zzzz', '`ros2 param list` shows')])
def test_the_right_name_is_given(name, meant):
    text = explain(name)
    assert text.startswith(f'parameter {name!r} is not known and does nothing')
    assert meant in text


@pytest.mark.parametrize('name,foreign', [
    ('filter.radius', False), ('use_sim_time', False), ('filter.radios', True),
    ('qos_overrides./left/image_rect.subscription.depth', False)])
def test_which_names_are_foreign(name, foreign):
    assert is_foreign(name) == foreign


@pytest.mark.parametrize('section,used', [
    ('/**', True), ('refine_node', True), ('/refine_node', True), ('/*', True),
    ('/robot/refine_node', False), ('/**/refine_node', True), ('stereo_node', False)])
def test_a_file_for_another_node_is_named(tmp_path, section, used):
    path = tmp_path / 'robot.yaml'
    path.write_text(f'{section}:\n  ros__parameters:\n    filter:\n      radius: 3\n',
                    encoding='utf-8')
    arguments = ['node', '--ros-args', '--params-file', str(path), '-p', 'x:=1']
    found = list(unused_files(arguments, '/refine_node'))
    assert len(found) == (not used)
    if found:
        assert found[0].startswith(f'{path}: parameters are for /{section.strip("/")}, this')
        assert 'write `/refine_node:` or `/**:` instead' in found[0]


def test_a_namespace_may_be_a_level_of_the_file(tmp_path):
    path = tmp_path / 'robot.yaml'
    path.write_text('robot:\n  refine_node:\n    ros__parameters:\n      filter.radius: 3\n',
                    encoding='utf-8')
    arguments = ['--params-file', str(path)]
    assert list(unused_files(arguments, '/robot/refine_node')) == []
    assert 'parameters are for /robot/refine_node, this node is /refine_node' in list(
        unused_files(arguments, '/refine_node'))[0]


@pytest.mark.parametrize('text', [
    'other_node:\n  ros__parameters:\n    gain: 3\n', 'no yaml: [', '7', ''])
def test_files_that_set_nothing_of_ours_are_left_alone(tmp_path, text):
    path = tmp_path / 'robot.yaml'
    path.write_text(text, encoding='utf-8')
    assert list(unused_files(['--params-file', str(path)], '/refine_node')) == []
    assert list(unused_files(['--params-file', str(tmp_path / 'none')], '/refine_node')) == []
