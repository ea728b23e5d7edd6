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
from xml.etree import ElementTree

import pytest
from stereo_refine_ros.node.inputs import TYPES
from stereo_refine_ros.node.publishers import TOPICS
import yaml

ROOT = Path(__file__).resolve().parents[2]
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.launch.py'))


@pytest.mark.parametrize('path', LAUNCH_FILES, ids=lambda path: path.name)
def test_launch_files_define_a_description(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert 'generate_launch_description' in functions


def strings(path):
    tree = ast.parse(path.read_text(encoding='utf-8'))
    return {node.value for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str)}


def test_remapped_topics_and_named_files_exist():
    named = strings(ROOT / 'launch' / 'stereo_refine.launch.py')
    remapped = {'left/image_rect', 'left/camera_info', 'right/image_rect', 'right/camera_info',
                'preliminary/disparity', 'disparity'}
    assert remapped <= named and remapped <= {*TYPES, *TOPICS}
    for name in named:
        if name.endswith(('.yaml', '.xml')):
            assert (ROOT / 'config' / name).is_file()


def test_the_launch_of_two_cameras_passes_declared_arguments():
    declared = strings(ROOT / 'launch' / 'stereo_refine.launch.py')
    assert {'namespace', 'params_file'} <= declared & strings(
        ROOT / 'launch' / 'two_cameras.launch.py')


def test_rviz_shows_our_topics():
    config = yaml.safe_load((ROOT / 'config' / 'stereo_refine.rviz').read_text(encoding='utf-8'))
    shown = {display['Topic']['Value'] for display in config['Visualization Manager']['Displays']
             if 'Topic' in display}
    assert shown == {'disparity/color', 'depth', 'points', 'planes'}
    assert shown <= set(TOPICS)


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
