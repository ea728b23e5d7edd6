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
import shutil
import subprocess
import sys
import venv
from xml.etree import ElementTree

import pytest
import setuptools

ROOT = Path(__file__).resolve().parents[1]
MANIFEST = ElementTree.parse(ROOT / 'package.xml').getroot()
LOCKS = sorted((ROOT / 'requirements').glob('*.txt'))
# Import name: rosdep key. rich and rosbags are imported only by the demo and the bag commands;
# llvmlite is what numba compiles with, comes with it, and has no key of its own.
ROSDEP = {
    'cv2': 'python3-opencv', 'numpy': 'python3-numpy', 'numba': 'python3-numba',
    'llvmlite': 'python3-numba', 'yaml': 'python3-yaml'}
TEST_ROSDEP = {
    'hypothesis': 'python3-hypothesis', 'matplotlib': 'python3-matplotlib',
    'psutil': 'python3-psutil', 'pytest': 'python3-pytest', 'rich': 'python3-rich',
    'rosbags': 'python3-rosbags-pip', 'setuptools': 'python3-setuptools',
    'skimage': 'python3-skimage'}
OPTIONAL = {'rich', 'rosbags', 'apsw'}
OUTSIDE = ('demo', 'benchmarks', 'reliability', 'scripts')  # of what is installed


def _imported(*folders: str) -> set[str]:
    names, own = set(), {'stereo_refine_ros', '__future__', *OUTSIDE}
    for folder in folders:
        for path in (ROOT / folder).rglob('*.py'):
            for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
                if isinstance(node, ast.Import):
                    names |= {alias.name.split('.')[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names.add((node.module or '').split('.')[0])
            own.add(path.stem)
    return names - set(sys.stdlib_module_names) - own


def _declared(kind: str) -> set[str]:
    return {depend.text or '' for depend in MANIFEST.findall(kind)}


def test_manifest_names_every_import():
    needed = _imported('stereo_refine_ros', 'launch') - OPTIONAL
    assert {ROSDEP.get(name, name) for name in needed} <= _declared('exec_depend')


def test_manifest_names_every_import_of_the_tests_by_its_rosdep_key():
    keys = {**ROSDEP, **TEST_ROSDEP}
    needed = {keys.get(name, name) for name in _imported('test', *OUTSIDE)}
    assert set(TEST_ROSDEP.values()) <= needed
    assert needed <= _declared('exec_depend') | _declared('test_depend')


def test_pip_is_asked_for_a_test_dependency_only_where_it_may_install():
    for depend in MANIFEST.findall('test_depend'):
        by_pip = (depend.text or '').endswith('-pip')
        assert depend.get('condition') == (
            '$PIP_BREAK_SYSTEM_PACKAGES == 1' if by_pip else None)


def test_manifest_says_who_made_it_and_where_it_is_shown():
    assert MANIFEST.findtext('url') == 'https://index.ros.org/p/stereo_refine_ros/'
    assert MANIFEST.findtext('author') == 'stereo_refine_ros contributors'


@pytest.mark.parametrize('has_opencv', [True, False])
def test_pip_brings_opencv_only_where_there_is_none(tmp_path, has_opencv):
    for name in ('setup.py', 'setup.cfg', 'pyproject.toml', 'package.xml'):
        shutil.copy(ROOT / name, tmp_path)
    venv.create(tmp_path / 'venv', with_pip=False)
    python = tmp_path / 'venv' / 'bin' / 'python'
    if has_opencv:  # as apt has it too: without a pip name
        where = subprocess.run(
            [python, '-c', 'import sysconfig; print(sysconfig.get_path("purelib"))'],
            capture_output=True, text=True, check=True).stdout.strip()
        (Path(where) / 'cv2').mkdir()
        (Path(where) / 'cv2' / '__init__.py').touch()
    # As in pip's isolated build: setuptools can be imported, the environment cannot.
    built = subprocess.run(
        [python, '-c', 'from setuptools import build_meta as b; '
         'print(b.prepare_metadata_for_build_wheel("."))'],
        cwd=tmp_path, capture_output=True, text=True, timeout=60,
        env={'PYTHONPATH': str(Path(setuptools.__file__).parents[1])})
    assert built.returncode == 0, built.stderr
    metadata = next(tmp_path.glob('*.dist-info')) / 'METADATA'
    text = metadata.read_text()
    required = re.findall(r'^Requires-Dist: ([a-z-]+)[^;\n]*$', text, re.MULTILINE)
    assert set(required) == {'setuptools', 'numpy', 'numba', 'pyyaml'} | (
        set() if has_opencv else {'opencv-python-headless'})
    extra = re.findall(r'^Requires-Dist: ([a-z-]+)\b.*; extra == .test.$', text, re.MULTILINE)
    assert set(extra) == set(TEST_ROSDEP) - {'setuptools', 'skimage'} | {'scikit-image'}


def test_what_a_robot_does_not_need_is_not_installed(tmp_path):
    for path in ROOT.iterdir():
        if path.name in ('stereo_refine_ros', 'resource', 'config', 'launch', *OUTSIDE):
            (tmp_path / path.name).symlink_to(path)
        elif path.name in ('setup.py', 'setup.cfg', 'pyproject.toml', 'package.xml'):
            shutil.copy(path, tmp_path)
    built = subprocess.run(
        [sys.executable, 'setup.py', '--quiet', 'build_py', '--build-lib', 'installed'],
        cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert built.returncode == 0, built.stderr
    installed = tmp_path / 'installed'
    assert {path.name for path in installed.iterdir()} == {'stereo_refine_ros'}
    inside = {path.name for path in (installed / 'stereo_refine_ros').iterdir()}
    assert {'node', 'refine_node.py', 'py.typed'} <= inside and inside.isdisjoint(OUTSIDE)


def test_manifest_is_of_format_3_and_ament_python():
    assert MANIFEST.attrib['format'] == '3'
    assert MANIFEST.findtext('export/build_type') == 'ament_python'
    assert MANIFEST.findtext('license') == 'Apache-2.0'
    assert re.fullmatch(r'\d+\.\d+\.\d+', MANIFEST.findtext('version'))


def test_requirements_name_no_ros_package():
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    requires = text.split('install_requires=')[1].split(']')[0]
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
