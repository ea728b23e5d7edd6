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

"""Compiling before the first frame: in a child, once, everything that a frame needs."""

import os
import signal
import subprocess
import sys

import numba
import numpy as np
import psutil
import pytest
from stereo_refine_ros import warm_up
from stereo_refine_ros.matching.scanline import LANES
from stereo_refine_ros.params import load_preset

pytestmark = pytest.mark.compiled

FRAME = """
import cv2
import numpy as np
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import measure_frame
from stereo_refine_ros.types import StereoPair
refiner, rng = StereoRefiner(load_preset('live')), np.random.default_rng(0)
for height, width in (480, 640), (240, 320):
    left = cv2.blur(rng.integers(0, 256, (height, width, 3), np.uint8), (5, 3))
    given = np.full((height, width), 7, np.float32)
    for view in left, left[..., 0].copy():
        pair = StereoPair(view, np.roll(view, -7, 1))
        measure_frame(refiner.process(pair.left, pair.right), pair)
        measure_frame(refiner.process(view, None, given), StereoPair(view, None))
"""

LONG = "'live', {'matching.num_disparities': 200}"

# A parent that says which child it waits for, and is then killed.
PARENT = """
from stereo_refine_ros import warm_up
from stereo_refine_ros.params import load_preset
warm_up.compile_apart(load_preset('live'), lambda text: print(text, flush=True))
"""


def kernels(folder):
    return {path.relative_to(folder): path.stat().st_mtime_ns for path in folder.rglob('*.nb?')}


def named(steps):
    """Leave out how many kernels were done meanwhile, which depends on the machine."""
    return [step for step in steps if not step.endswith(' are done')]


def test_what_was_compiled_is_counted():
    @numba.njit
    def next_number(value):
        return value + 1

    told = []
    with warm_up.compiled_counted(told.append, every_s=0):
        assert next_number(1) == 2 and next_number(2) == 3 and next_number(1.5) == 2.5
    assert told == ['kernels: 1 are done', 'kernels: 2 are done']
    next_number(1j)
    assert len(told) == 2
    with warm_up.compiled_counted(told.append, every_s=3600):
        next_number(np.float32(1))
    assert len(told) == 2


def test_the_watch_knows_when_something_was_compiled():
    watch = warm_up.CompilerWatch()
    assert not watch.has_worked()
    numba.njit(lambda value: value + 2)(3)
    assert watch.has_worked() and not watch.has_worked()
    watch.on_start(None)
    assert watch.has_worked() and watch.has_worked()  # it still does
    watch.on_end(None)
    assert not watch.has_worked()


@pytest.mark.parametrize('values, expected', [
    ({}, (32, 64)), ({'matching.num_disparities': 128}, (64, 128)),
    ({'matching.num_disparities': 300}, (32, 256)), ({'matching.nearest': 0.3}, LANES),
    ({'matching.num_disparities': 600}, (32, 256)), ({'matching.method': 'external'}, LANES)])
def test_lanes_are_those_of_both_sizes_and_all_where_the_range_comes_later(values, expected):
    assert warm_up.lanes_needed(load_preset('live', values)) == expected


@pytest.fixture(scope='module')
def compiled(tmp_path_factory):
    """Let a child compile `live` into an empty folder, as a node does at its first start."""
    folder, steps = tmp_path_factory.mktemp('kernels'), []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('NUMBA_CACHE_DIR', str(folder))
        warm_up.compile_apart(load_preset('live'), steps.append)
    assert named(steps) == [
        'kernels for colour images (1 of 2)', 'kernels for grey images (2 of 2)']
    return folder


def test_a_child_compiles_all_that_a_frame_needs_and_only_once(compiled, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(compiled))
    made, steps = kernels(compiled), []
    assert len(made) > 50
    warm_up.compile_apart(load_preset('live'), steps.append)
    assert steps == []
    subprocess.run([sys.executable, '-c', FRAME], check=True, timeout=60)
    assert kernels(compiled) == made


def test_the_compiler_ends_with_its_parent(tmp_path):
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)}
    with subprocess.Popen([sys.executable, '-c', PARENT], env=environment,
                          stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout.readline() == 'kernels for colour images (1 of 2)\n'
        child, = psutil.Process(parent.pid).children()
        parent.send_signal(signal.SIGKILL)
    child.wait(10)
    assert not list(tmp_path.glob('compiled-*'))


def test_a_child_without_its_parent_does_nothing(tmp_path):
    mark = tmp_path / 'mark'
    done = subprocess.run(
        [sys.executable, '-m', 'stereo_refine_ros.warm_up', '--for-process', '1', str(mark), '{}'],
        timeout=60)
    assert done.returncode == 1 and not mark.exists()


def test_where_no_process_may_be_started_the_first_call_compiles(tmp_path, monkeypatch):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    monkeypatch.setattr(sys, 'executable', str(tmp_path / 'nothing'))
    steps = []
    warm_up.compile_apart(load_preset('live'), steps.append)
    assert 'nothing' in steps[0] and not any(tmp_path.iterdir())


def test_the_command_compiles_a_preset_once_for_this_processor(compiled, tmp_path):
    command = [sys.executable, '-u', '-m', 'stereo_refine_ros.warm_up', '--preset', 'live']
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(compiled)}
    # The node compiled what a search of 64 disparities needs; the command adds the others.
    runs = [subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
            for _ in range(2)]
    assert [done.returncode for done in runs] == [0, 0], runs[0].stderr
    assert named(runs[0].stdout.splitlines()) == [
        'live: kernels for colour images (1 of 2)', 'live: kernels for grey images (2 of 2)',
        f'kernels are in {compiled}']
    assert runs[1].stdout.splitlines() == ['live: kernels are there', f'kernels are in {compiled}']
    made = kernels(compiled)
    subprocess.run([sys.executable, '-c', FRAME.replace("'live'", LONG)], check=True, timeout=60,
                   env=environment)
    assert kernels(compiled) == made
    started = subprocess.run(
        [sys.executable, '-c', PARENT], env=environment, capture_output=True, text=True)
    assert started.stdout == ''
    of_another = {**environment, 'NUMBA_CPU_NAME': 'nehalem', 'NUMBA_CPU_FEATURES': ''}
    elsewhere = {**environment, 'NUMBA_CACHE_DIR': str(tmp_path)}
    for call, found, said in (
            ([sys.executable, '-c', PARENT], of_another, 'kernels for colour images (1 of 2)\n'),
            (command, elsewhere, 'live: kernels for colour images (1 of 2)\n')):
        with subprocess.Popen(call, stdout=subprocess.PIPE, text=True, env=found) as other:
            assert other.stdout.readline() == said
            other.kill()


def test_the_command_compiles_every_preset_by_default(monkeypatch):
    compiled = []
    monkeypatch.setattr(warm_up, 'compile_presets', lambda names, _: compiled.extend(names))
    assert warm_up.main([]) == 0
    assert compiled == ['live', 'accurate', 'paper']


def test_the_command_fails_where_nothing_would_be_kept(tmp_path):
    (tmp_path / 'file').touch()
    done = subprocess.run(
        [sys.executable, '-m', 'stereo_refine_ros.warm_up'], capture_output=True, text=True,
        env={**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path / 'file' / 'cache'),
             'TMPDIR': str(tmp_path)}, timeout=60)
    assert done.returncode == 1
    assert done.stderr.startswith(f'warm_up: {tmp_path}/file/cache cannot be written by user ')
    assert 'set NUMBA_CACHE_DIR' in done.stderr


def test_the_log_says_that_a_private_folder_is_used(tmp_path):
    (tmp_path / 'file').touch()
    wanted = str(tmp_path / 'file' / 'cache')
    done = subprocess.run(
        [sys.executable, '-c', PARENT.replace('compile_apart', '_mark = lambda *_: None\n'
                                              'warm_up.compile_apart')],
        capture_output=True, text=True, timeout=60,
        env={**os.environ, 'NUMBA_CACHE_DIR': wanted, 'TMPDIR': str(tmp_path)})
    folder = next((tmp_path / f'stereo_refine_ros-{os.geteuid()}').iterdir())
    assert done.stdout == f'kernels for {folder}, since {wanted} cannot be written\n'


def test_without_a_cache_no_child_is_started(monkeypatch):
    monkeypatch.delenv('NUMBA_CACHE_DIR')
    monkeypatch.setattr(subprocess, 'Popen', None)
    warm_up.compile_apart(load_preset('live'))
