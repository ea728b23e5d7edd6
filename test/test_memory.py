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

"""Freed memory stays with the process, where the C library can be told."""

import ctypes
import subprocess
import sys

import pytest

from stereo_refine_ros import memory

# Page faults of twenty rounds of arrays as a live frame has them, after a warm-up.
ROUNDS = """
import resource, sys
import numpy as np
from stereo_refine_ros.memory import keep_freed_memory
if sys.argv[1] == 'keep':
    assert keep_freed_memory()
def work():
    arrays = [np.ones(640 * 480, np.float32) for _ in range(20)]
for _ in range(3):
    work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(mode):
    done = subprocess.run([sys.executable, '-c', ROUNDS, mode], capture_output=True, text=True,
                          check=True)
    return int(done.stdout)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), 'gnu_get_libc_version'),
                    reason='only glibc can be told')
def test_a_frame_is_given_the_memory_of_the_last_one():
    assert faults('keep') < 500 < 5000 < faults('default')


def test_another_c_library_is_left_alone(monkeypatch):
    memory.keep_freed_memory.cache_clear()
    monkeypatch.setattr(memory.ctypes, 'CDLL', lambda _: object())
    assert memory.keep_freed_memory() is False
    memory.keep_freed_memory.cache_clear()
