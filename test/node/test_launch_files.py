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

"""Launch files, the rviz and Fast DDS profiles name what exists; launching needs ROS's launch."""

import ast
from pathlib import Path
import re
import runpy
import sys
from types import SimpleNamespace
from unittest.mock import MagicMock
from xml.etree import ElementTree

from builtin_interfaces.msg import Time
import pytest
from stereo_refine_ros.node.inputs import TYPES
from stereo_refine_ros.node.publishers import TOPICS
from stereo_refine_ros.messages.scene import scene_header  # noqa: I100
from stereo_refine_ros.params import check_values, PRESETS, SPEC_BY_NAME
import yaml

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
CAMERA = ROOT / 'launch' / 'stereo_refine.launch.py'


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_define_a_description(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert 'generate_launch_description' in functions


def strings(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    return {node.value for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)}


@pytest.fixture
def launch_file(monkeypatch):
    """Run the launch file as a module; what it takes from launch is made up."""
    for name in ('launch', 'launch.actions', 'launch.conditions', 'launch.substitutions',
                 'launch_ros', 'launch_ros.actions'):
        monkeypatch.setitem(sys.modules, name, MagicMock())
    module = SimpleNamespace(**runpy.run_path(str(CAMERA)))
    module.defaults = {name: default for name, (default, _) in module.ARGUMENTS.items()}
    return module


def chosen_topics(launch_file, **chosen):
    return dict(launch_file.remappings({**launch_file.defaults, **chosen}))


def test_by_default_every_topic_has_its_own_name(launch_file):
    topics = chosen_topics(launch_file)
    assert all(name == topic for name, topic in topics.items())
    assert set(topics) == set(TYPES) - {'ground_truth/disparity'} | {'disparity'}
    assert 'disparity' in TOPICS


@pytest.mark.parametrize('chosen', [
    {'left': '/zed/left', 'right': '/zed/right', 'image': 'image_rect_color'},
    {'left': '/zed/left/', 'right': '/zed/right/', 'image': 'image_rect_color'},
    {'left_image': '/zed/left/image_rect_color', 'right_image': '/zed/right/image_rect_color'}])
def test_a_camera_is_named_by_its_namespaces_or_its_topics(launch_file, chosen):
    topics = chosen_topics(launch_file, **chosen)
    for side in 'left', 'right':
        assert topics[f'{side}/image_rect'] == f'/zed/{side}/image_rect_color'
        assert topics[f'{side}/camera_info'] == f'/zed/{side}/camera_info'


def test_camera_info_is_beside_its_image_unless_it_is_named(launch_file):
    assert launch_file.beside('image') == 'camera_info'
    assert launch_file.beside('/image') == '/camera_info'
    topics = chosen_topics(launch_file, left_image='a/b/c', right_camera_info='/calibration/right')
    assert topics['left/camera_info'] == 'a/b/camera_info'
    assert topics['right/camera_info'] == '/calibration/right'


def test_what_the_command_line_says_stands_over_the_parameter_file(launch_file):
    file, values = launch_file.parameters(launch_file.defaults)
    assert file == str(ROOT / 'config' / 'live.yaml') and values == {'use_sim_time': False}
    file, values = launch_file.parameters({
        **launch_file.defaults, 'preset': 'accurate', 'method': 'sgbm',
        'num_disparities': '100', 'use_sim_time': 'True'})
    assert file == str(ROOT / 'config' / 'accurate.yaml')
    assert values.pop('use_sim_time') is True
    assert values == {
        'preset': 'accurate', 'matching.method': 'sgbm', 'matching.num_disparities': 100}
    assert check_values(values) == values
    assert launch_file.parameters(
        {**launch_file.defaults, 'preset': 'paper', 'params_file': 'mine.yaml'})[0] == 'mine.yaml'


@pytest.mark.parametrize('chosen', [{'num_disparities': '64.5'}, {'use_sim_time': 'maybe'}])
def test_what_cannot_be_meant_is_named(launch_file, chosen):
    (name, text), = chosen.items()
    with pytest.raises(ValueError, match=f'{name}:={text}: expected'):
        launch_file.parameters({**launch_file.defaults, **chosen})


def test_the_page_for_those_who_come_from_stereo_image_proc_names_what_exists(launch_file):
    text = (ROOT / 'docs' / 'from_stereo_image_proc.md').read_text(encoding='utf-8')
    groups = '|'.join({name.split('.')[0] for name in SPEC_BY_NAME if '.' in name})
    named = set(re.findall(rf'`((?:{groups})\.[a-z_]+)', text))
    assert {'sync.approximate', 'matching.nearest', 'output.max_depth'} <= named
    assert named <= set(SPEC_BY_NAME)
    launched = re.findall(r'stereo_refine\.launch\.py (.*)', text)
    assert {name for line in launched for name in re.findall(r'(\w+):=', line)} <= set(
        launch_file.ARGUMENTS)
    assert len(launched) == 2
    assert {*TYPES, *TOPICS} - {'ground_truth/disparity', 'preliminary/disparity'} <= set(
        re.findall(r'`([a-z_/]+)`', text))


@pytest.mark.parametrize('preset', PRESETS)
def test_every_preset_has_its_file(preset):
    assert (ROOT / 'config' / f'{preset}.yaml').is_file()


def test_the_launch_of_two_cameras_passes_declared_arguments():
    declared = strings(CAMERA)
    assert {'namespace', 'params_file'} <= declared & strings(
        ROOT / 'launch' / 'two_cameras.launch.py')


def rviz():
    config = yaml.safe_load((ROOT / 'config' / 'stereo_refine.rviz').read_text(encoding='utf-8'))
    return config['Visualization Manager']


def test_rviz_shows_our_topics():
    shown = {display['Topic']['Value'] for display in rviz()['Displays'] if 'Topic' in display}
    assert shown == {'disparity/color', 'confidence', 'depth', 'points', 'planes'}
    assert shown <= {*TOPICS, 'confidence'}


def test_rviz_shows_confidence_from_0_to_1():
    confidence, = (display for display in rviz()['Displays']
                   if display.get('Topic', {}).get('Value') == 'confidence')
    assert confidence['Normalize Range'] is False
    assert (confidence['Min Value'], confidence['Max Value']) == (0, 1)


def test_rviz_is_fixed_to_the_frame_that_replay_sends():
    frame = rviz()['Global Options']['Fixed Frame']
    assert scene_header(Time()).frame_id == frame


def test_the_shared_memory_profile_holds_large_images():
    root = ElementTree.parse(ROOT / 'config' / 'fastdds_shm.xml').getroot()
    space = {'p': root.tag[1:].split('}')[0]}
    assert int(root.findtext('.//p:segment_size', namespaces=space)) == 32 * 1024 * 1024
    assert root.findtext('.//p:useBuiltinTransports', namespaces=space) == 'false'
    types = [item.text for item in root.iterfind('.//p:type', space)]
    assert types == ['SHM', 'UDPv4']


def test_the_profile_of_two_hosts_sends_packets_that_fit_a_frame():
    root = ElementTree.parse(ROOT / 'config' / 'fastdds_two_hosts.xml').getroot()
    space = {'p': root.tag[1:].split('}')[0]}
    udp, = (item for item in root.iterfind('.//p:transport_descriptor', space)
            if item.findtext('p:type', namespaces=space) == 'UDPv4')
    assert int(udp.findtext('p:maxMessageSize', namespaces=space)) <= 1500 - 28
    shm, = (item for item in root.iterfind('.//p:transport_descriptor', space)
            if item.findtext('p:type', namespaces=space) == 'SHM')
    # Shared memory is fed packets of that size too: its queue has to hold a large image's.
    assert int(shm.findtext('p:port_queue_capacity', namespaces=space)) * 1400 > 8e6
