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

"""Steady in time: still where the image is, and no trace of what moved."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from stereo_refine_ros.refinement.steadying import FrameMemory
from stereo_refine_ros.refinement.tuning import FADE_OF_LAST

SHAPE = (40, 60)
SURE = np.full(SHAPE, 0.9, np.float32)


def image(seed=0):
    return np.random.default_rng(seed).integers(0, 256, SHAPE, dtype=np.uint8)


def shot(number):
    """Take the same picture with another grey level of one pixel: no sensor repeats itself."""
    taken = image()
    taken[0, 0] = taken[0, 0] // 2 + number % 2
    return taken


def flat(value):
    return np.full(SHAPE, value, np.float32)


def test_the_first_frame_stays_as_it_is():
    values, confidence = FrameMemory().steady(flat(5), SURE, image(), 1.0)
    np.testing.assert_array_equal(values, flat(5))
    np.testing.assert_array_equal(confidence, SURE)


def test_noise_on_a_still_image_is_averaged_away():
    rng, memory = np.random.default_rng(1), FrameMemory()
    noisy = [flat(10) + rng.normal(0, 0.2, SHAPE).astype(np.float32) for _ in range(8)]
    steady = [memory.steady(frame, SURE, shot(k), 1.0)[0] for k, frame in enumerate(noisy)]
    change = np.abs(noisy[7] - noisy[6]).mean()
    assert np.abs(steady[7] - steady[6]).mean() < 0.4 * change
    assert steady[7].mean() == pytest.approx(10, abs=0.02)


def test_what_moves_together_is_followed_at_once():
    memory = FrameMemory()
    for k in range(6):
        values, _ = memory.steady(flat(10 + 0.5 * k), SURE, shot(k), 1.0)
    np.testing.assert_allclose(values, flat(12.5), atol=0.01)


def test_a_less_sure_jump_on_a_still_image_does_not_show():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, shot(1), 1.0)
    values, confidence = memory.steady(flat(20), SURE * 0.5, shot(2), 1.0)
    np.testing.assert_array_equal(values, flat(10))
    np.testing.assert_allclose(confidence, SURE * FADE_OF_LAST)


def test_a_sure_jump_shows_at_once():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, shot(1), 1.0)
    np.testing.assert_array_equal(memory.steady(flat(20), SURE, shot(2), 1.0)[0], flat(20))


def test_what_was_kept_fades():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, shot(1), 1.0)
    shown = [memory.steady(flat(20), SURE * 0.5, shot(k), 1.0)[0][5, 5] for k in range(6)]
    assert shown[0] == 10 and shown[-1] == 20


def test_a_moved_object_leaves_no_trace():
    """An object of 16 px moves by 20; two frames later the map is that of the frame alone."""
    memory, background = FrameMemory(), image()

    def frame(at):
        left, values = background.copy(), flat(5)
        left[10:26, at:at + 16], values[10:26, at:at + 16] = 255 - background[10:26, 4:20], 25
        return left, values
    for at in (4, 4, 24, 24):
        left, values = frame(at)
        shown, _ = memory.steady(values, SURE, left, 1.0)
    np.testing.assert_allclose(shown, frame(24)[1], atol=0.01)


def test_a_cut_begins_anew():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, image(0), 1.0)
    values, confidence = memory.steady(flat(10.5), SURE * 0.2, image(9), 1.0)
    np.testing.assert_array_equal(values, flat(10.5))
    np.testing.assert_array_equal(confidence, SURE * np.float32(0.2))


def test_another_size_begins_anew():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, shot(1), 1.0)
    half = np.full((20, 30), 7, np.float32)
    np.testing.assert_array_equal(
        memory.steady(half, half * 0, image()[:20, :30], 1.0)[0], half)


def test_unknown_pixels_stay_unknown():
    memory, values = FrameMemory(), flat(10)
    values[5, 5] = np.nan
    memory.steady(values, SURE, image(), float('nan'))
    assert np.isnan(memory.steady(values, SURE, image(), float('nan'))[0][5, 5])


def test_threads_change_no_bit_and_may_share_a_memory():
    rng = np.random.default_rng(3)
    frames = [flat(10) + rng.normal(0, 2, SHAPE).astype(np.float32) for _ in range(4)]
    one, three, shared = FrameMemory(), FrameMemory(), FrameMemory()
    for values in frames:
        np.testing.assert_array_equal(one.steady(values, SURE, image(), 1.0, 1)[0],
                                      three.steady(values, SURE, image(), 1.0, 3)[0])
    with ThreadPoolExecutor(4) as pool:
        shown = list(pool.map(lambda v: shared.steady(v, SURE, image(), 1.0)[0], frames * 5))
    assert all(np.isfinite(values).all() for values in shown)


def test_the_same_frame_again_and_another_source_begin_anew():
    memory = FrameMemory()
    memory.steady(flat(10), SURE, shot(1), 1.0)
    again, _ = memory.steady(flat(10.5), SURE, shot(1), 1.0)
    np.testing.assert_array_equal(again, flat(10.5))
    given, _ = memory.steady(flat(10), SURE * 0.1, shot(2), 1.0, is_own=False)
    np.testing.assert_array_equal(given, flat(10))
