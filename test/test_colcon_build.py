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

"""`colcon build` and `colcon test` of a copy of the checkout; what they install starts."""

import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys

from printed import own_lines
import pytest

ROOT = Path(__file__).resolve().parents[1]
EXECUTABLES = ('refine_node', 'replay', 'evaluate')
NOT_SOURCES = shutil.ignore_patterns(
    '.git', '.venv*', '.*_cache', '.hypothesis', '__pycache__', 'build', 'install', 'log',
    'demo_output', 'report', '*.egg-info')
COLCON = (
    'import sys; from colcon_core.command import main; sys.argv[0] = "colcon"; sys.exit(main())')


def _colcon(workspace: Path, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, '-c', COLCON, *arguments], cwd=workspace,
        capture_output=True, text=True, timeout=120)


def _in_workspace(workspace: Path, command: str) -> list[str]:
    return ['sh', '-c', f'. {workspace}/install/setup.sh && exec {command}']


@pytest.fixture(scope='module', params=[(), ('--symlink-install',)], ids=['plain', 'symlink'])
def workspace(request, tmp_path_factory) -> Path:
    """Build a workspace that holds a copy of the checkout."""
    root = tmp_path_factory.mktemp('workspace')
    shutil.copytree(ROOT, root / 'src' / 'stereo_refine_ros', ignore=NOT_SOURCES)
    built = _colcon(root, 'build', *request.param)
    assert built.returncode == 0, built.stderr
    assert 'Finished <<< stereo_refine_ros' in built.stdout
    return root


def test_executables_stand_where_ros2_run_looks(workspace):
    folder = workspace / 'install' / 'stereo_refine_ros' / 'lib' / 'stereo_refine_ros'
    for name in EXECUTABLES:
        assert os.access(folder / name, os.X_OK), name


def test_share_holds_marker_manifest_config_and_launch(workspace):
    share = workspace / 'install' / 'stereo_refine_ros' / 'share'
    assert (share / 'ament_index/resource_index/packages/stereo_refine_ros').is_file()
    assert (share / 'stereo_refine_ros' / 'package.xml').is_file()
    for kind in ('config', 'launch'):
        shipped = {path.name for path in (ROOT / kind).iterdir() if path.is_file()}
        assert {path.name for path in (share / 'stereo_refine_ros' / kind).iterdir()} == shipped


def test_package_is_the_installed_one_and_finds_its_presets(workspace):
    code = ('import stereo_refine_ros, stereo_refine_ros.params as p; '
            'print(stereo_refine_ros.__file__); '
            'print([p.load_preset(name).preset for name in p.PRESETS])')
    done = subprocess.run(
        _in_workspace(workspace, f"{sys.executable} -c '{code}'"),
        cwd=workspace, capture_output=True, text=True)
    path, presets = done.stdout.splitlines()
    assert Path(path).is_relative_to(workspace)
    assert presets == "['live', 'accurate', 'paper']"


@pytest.mark.parametrize('name', ['replay', 'evaluate'])
def test_command_line_tells_its_options(workspace, name):
    executable = workspace / 'install/stereo_refine_ros/lib/stereo_refine_ros' / name
    done = subprocess.run(
        _in_workspace(workspace, f'{executable} --help'),
        cwd=workspace, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('usage:')


@pytest.mark.ros
def test_node_starts_and_ends_on_interrupt(workspace):
    executable = workspace / 'install/stereo_refine_ros/lib/stereo_refine_ros/refine_node'
    node = subprocess.Popen(
        _in_workspace(workspace, str(executable)), cwd=workspace, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        assert node.stdout is not None
        first_line = next(line for line in node.stdout if own_lines(line))
        node.send_signal(signal.SIGINT)
        rest = node.communicate(timeout=20)[0]
    finally:
        node.kill()
    assert 'refine_node' in first_line
    assert 'Traceback' not in rest, rest
    assert node.returncode == 0


def test_colcon_test_passes(workspace):
    tested = _colcon(
        workspace, 'test', '--return-code-on-test-failure', '--pytest-args', 'test/quality')
    assert tested.returncode == 0, tested.stdout + tested.stderr
    results = _colcon(workspace, 'test-result')
    assert results.returncode == 0, results.stdout
    assert ' 0 errors, 0 failures, 0 skipped' in results.stdout
    assert int(results.stdout.split('Summary: ')[1].split()[0]) > 20
