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

"""The manifest names what is imported; the locks pin everything and name no place."""

import ast
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()
LOCKS = sorted((ROOT / 'requirements').glob('*.txt'))
# Import name: rosdep key. rich and rosbags are imported only by the demo and the bag commands.
ROSDEP = {
    'cv2': 'python3-opencv', 'numpy': 'python3-numpy', 'numba': 'python3-numba',
    'yaml': 'python3-yaml'}
OPTIONAL = {'rich', 'rosbags', 'apsw'}


def _imported() -> set[str]:
    names = set()
    for folder in ('stereo_refine_ros', 'launch'):
        for path in (ROOT / folder).rglob('*.py'):
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
                if isinstance(node, ast.Import):
                    names |= {alias.name.split('.')[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names.add((node.module or '').split('.')[0])
    return names - set(sys.stdlib_module_names) - {'stereo_refine_ros', '__future__'} - OPTIONAL


def test_manifest_names_every_import():
    declared = {depend.text for depend in MANIFEST.findall('exec_depend')}
    assert {ROSDEP.get(name, name) for name in _imported()} <= declared


def test_manifest_is_of_format_3_and_ament_python():
    assert MANIFEST.attrib['format'] == '3'
    assert MANIFEST.findtext('export/build_type') == 'ament_python'
    assert MANIFEST.findtext('license') == 'Apache-2.0'
    assert re.fullmatch(r'\d+\.\d+\.\d+', MANIFEST.findtext('version'))


def test_requirements_name_no_ros_package():
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    requires = text.split('install_requires=')[1].split('],')[0]
    assert not re.search(r'rclpy|ros-|_msgs', requires)


@pytest.mark.parametrize('lock', LOCKS, ids=lambda lock: lock.name)
def test_lock_pins_every_package_with_hashes(lock):
    entries = re.split(r'\n(?=\S)', lock.read_text(encoding='utf-8').strip())
    for entry in entries:
        assert re.match(r'[a-z0-9-]+==[^ ;]+( ;.*)? \\\n', entry), entry
        hashes = entry.split(' \\\n')[1:]
        assert hashes
        assert all(re.fullmatch(r'    --hash=sha256:[0-9a-f]{64}', line) for line in hashes)


@pytest.mark.parametrize('lock', LOCKS, ids=lambda lock: lock.name)
def test_every_lock_has_its_source(lock):
    assert lock.with_suffix('.in').is_file()


def test_both_ros_packages_are_those_of_the_contract():
    text = (ROOT / 'requirements' / 'ros.txt').read_text(encoding='utf-8')
    assert 'ros-jazzy-rclpy==7.1.6 ' in text
    assert 'ros-jazzy-common-interfaces==5.3.6 ' in text
