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

"""Every vector step against its plain twin, on random bytes."""

import numba
from numba import njit
import numpy as np
import pytest

from stereo_refine_ros.matching import vector_steps, vector_twins

pytestmark = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason='there is only the twin without the compiler')

STEPS = ('match_column', 'step_both', 'step_column', 'step_last')


def arguments(name, width, seed):
    """Return the arguments of a step: arrays of random bytes, and places within them."""
    rng = np.random.default_rng(seed)

    def some(size, high=256):
        return rng.integers(0, high, size).astype(np.uint8)
    table, flags = np.repeat(some(8, 150), width), some(20, 2)
    state, row = some(4 * width + 40), some(8 * width + 64)
    down = (state, width, 2 * width + 30)
    along = (row, width, 2 * width + 16)
    offset = 3 * width + 32
    cost, total, up = some(3 * width, 35), some(2 * width + 10, 130), some(2 * width + 20, 130)
    return {
        'match_column': lambda: (some(11 * 64).astype(np.uint32) * np.uint32(0x01010101),
                                 some(8 * 2 * width), 2 * width,
                                 np.where(np.arange(width) < width - 3, 0, 255).astype(np.uint8),
                                 some(2 * width, 2) * np.uint8(22), 14, 20, 3, 5, 7, cost, 9,
                                 *down, table, flags, 4, up, 3),
        'step_both': lambda: (*along, *down, table, flags, some(20, 2), 6, cost, 11, total, 5,
                              offset),
        'step_column': lambda: (*down, table, flags, 8, cost, 7, up, 3),
        'step_last': lambda: (*along, table, flags, 2, cost, 11, total, 5, up, 8, offset),
    }[name]()


@pytest.mark.parametrize('name', STEPS)
@pytest.mark.parametrize('width', [32, 64, 128, 256])
def test_a_step_does_what_its_twin_does(name, width):
    step, twin = getattr(vector_steps, name), getattr(vector_twins, name)
    lanes = (0,) * (width // vector_steps.LANES_PER_ITEM)

    @njit
    def call(*args):
        return step(*args)
    for seed in range(20):
        ours = arguments(name, width, seed)
        theirs = [a.copy() if isinstance(a, np.ndarray) else a for a in ours]
        assert call(lanes, *ours) == twin(lanes, *theirs)
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b)
