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

"""Compiled kernels: apart by sources and processor, used from where nothing can be written."""

import ctypes
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile

import pytest
from stereo_refine_ros import KERNELS
from stereo_refine_ros.kernel_cache import use_versioned_cache

pytestmark = pytest.mark.compiled
ROOT = Path(__file__).resolve().parents[2]
OTHER_PROCESSOR = {'NUMBA_CPU_NAME': 'nehalem', 'NUMBA_CPU_FEATURES': ''}

MEASURE = """
import numpy as np
import stereo_refine_ros
from stereo_refine_ros.quality.image_metrics import mse
black = np.zeros((4, 5), np.uint8)
print(mse(black, black + 3), stereo_refine_ros.KERNELS.folder)
"""

# One vector addition that LLVM lowers to what the processor has.
INTRINSIC = """
import sys
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
import numpy as np

@intrinsic
def add_16(context, out, values):
    def lower(context, builder, signature, arguments):
        vector = ir.VectorType(ir.FloatType(), 16).as_pointer()
        places = []
        for kind, argument in zip(signature.args, arguments):
            array = context.make_array(kind)(context, builder, argument)
            places.append(builder.bitcast(array.data, vector))
        total = builder.fadd(*(builder.load(place, align=4) for place in places))
        builder.store(total, places[0], align=4)
        return context.get_dummy_value()
    return types.void(out, values), lower

@njit(cache=True)
def add(out, values):
    add_16(out, values)

out = np.arange(16, dtype=np.float32)
add(out, np.ones(16, np.float32))
print(out.sum())
"""


def drop_the_rights_of_root() -> None:
    """Let a file's permissions count for root as for anybody else."""
    libc = ctypes.CDLL(None)
    for capability in (1, 2, 3):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH, CAP_FOWNER
        libc.prctl(24, capability)  # PR_CAPBSET_DROP, which takes effect where Python starts


def run(code, **variables):
    """Run code as somebody whom permissions bind, with numba's report of its cache."""
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME')}
    return subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, timeout=120,
        preexec_fn=drop_the_rights_of_root, cwd='/',
        env={**environment, 'PYTHONPATH': str(ROOT), 'NUMBA_DEBUG_CACHE': '1',
             'PYTHONDONTWRITEBYTECODE': '1', **variables})


def measure(**variables):
    """Measure a known error; return the folder in use, and how many kernels came out of it."""
    done = run(MEASURE, **variables)
    assert done.returncode == 0, done.stderr
    value, folder = re.search(r'^([\d.]+) (/.*)$', done.stdout, re.MULTILINE).groups()
    assert float(value) == 9.0
    return Path(folder), loaded(done.stdout)


def loaded(report):
    """Count what was taken from a cache and what was compiled."""
    return report.count('[cache] data loaded'), report.count('[cache] data saved')


def protect(folder):
    """Take away the right to write, as in an image that is read-only or made by root."""
    for path in [folder, *folder.rglob('*')]:
        path.chmod(path.stat().st_mode & ~0o222)


@pytest.fixture
def removable(tmp_path):
    """Give a folder whose protected parts pytest can remove again."""
    yield tmp_path
    for path in [tmp_path, *tmp_path.rglob('*')]:
        if path.is_dir():
            path.chmod(0o755)


@pytest.fixture
def image(removable):
    """Give a home and a package that cannot be written, and a folder for temporary files."""
    for name in ('stereo_refine_ros', 'config'):
        shutil.copytree(ROOT / name, removable / 'package' / name,
                        ignore=shutil.ignore_patterns('__pycache__'))
    for name in ('home', 'tmp'):
        (removable / name).mkdir()
    protect(removable / 'home')
    protect(removable / 'package')
    return {'HOME': str(removable / 'home'), 'TMPDIR': str(removable / 'tmp'),
            'PYTHONPATH': str(removable / 'package')}


def test_where_home_and_package_are_read_only_a_private_folder_is_used_and_kept(image):
    folder, first = measure(**image)
    assert folder.is_relative_to(image['TMPDIR']) and first == (0, 1)
    assert folder.parent.stat().st_mode & 0o777 == 0o700
    assert measure(**image) == (folder, (1, 0))


def test_kernels_that_cannot_be_added_to_are_used(image, removable):
    made = removable / 'made'
    measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})
    (made / f'compiled-{KERNELS.state}-0').touch()
    protect(made)
    folder, taken = measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})
    assert folder.is_relative_to(image['TMPDIR']) and taken == (1, 0)


def test_kernels_of_other_sources_that_cannot_be_added_to_are_left(image, removable):
    made = removable / 'made'
    measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})
    (made / 'compiled-0123-4567-0').touch()
    protect(made)
    assert measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})[1] == (0, 1)


def test_a_cache_with_one_folder_of_root_in_it_is_not_written(image, removable):
    made = removable / 'made'
    measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})
    inside, = (path for path in made.iterdir() if path.is_dir())
    protect(inside)
    folder, _ = measure(**{**image, 'NUMBA_CACHE_DIR': str(made)})
    assert folder.is_relative_to(image['TMPDIR'])


def test_a_planted_folder_is_not_used(image, removable):
    planted = Path(image['TMPDIR']) / f'stereo_refine_ros-{os.geteuid()}'
    planted.mkdir()
    planted.chmod(0o777)
    folder, taken = measure(**image)
    assert not folder.is_relative_to(planted) and taken == (0, 1)
    assert not any(planted.iterdir()) and not folder.exists()


def test_where_nothing_can_be_written_it_says_what_to_do(monkeypatch, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path / 'file' / 'cache'))
    (tmp_path / 'file').touch()

    def refuse(*arguments, **options):
        raise OSError(30, 'Read-only file system')
    monkeypatch.setattr(os, 'mkdir', refuse)
    monkeypatch.setattr(tempfile, 'mkdtemp', refuse)
    with pytest.raises(OSError, match='set NUMBA_CACHE_DIR to one that can.*--tmpfs /tmp'):
        use_versioned_cache()


def test_another_processor_has_a_folder_of_its_own(tmp_path):
    here, _ = measure(HOME=str(tmp_path))
    there, _ = measure(HOME=str(tmp_path), **OTHER_PROCESSOR)
    assert here.parent == there.parent == tmp_path / '.cache' / 'stereo_refine_ros'
    assert here.name.rpartition('-')[0] == there.name.rpartition('-')[0] and here != there


def test_vector_steps_are_compiled_anew_for_another_processor(tmp_path):
    source = tmp_path / 'vectors.py'
    source.write_text(INTRINSIC, encoding='utf-8')
    call = f'import runpy, sys; sys.path.insert(0, {str(tmp_path)!r}); import vectors'
    cache = {'NUMBA_CACHE_DIR': str(tmp_path / 'cache')}
    reports = [run(call, **cache), run(call, **cache, **OTHER_PROCESSOR), run(call, **cache)]
    assert [report.returncode for report in reports] == [0, 0, 0], reports[0].stderr
    assert all('136.0' in report.stdout for report in reports)
    assert [loaded(report.stdout) for report in reports] == [(0, 1), (0, 1), (1, 0)]
