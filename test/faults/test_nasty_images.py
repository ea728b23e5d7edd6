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

"""Images that are legal and nasty: a usable result or a clear refusal, in bounded time."""

import subprocess
import sys
import time

import numpy as np
import pytest

from stereo_refine_ros.params import load_preset, MATCHERS, PRESETS, PROJECTIONS
from stereo_refine_ros.pipeline import StereoRefiner

HEIGHT, WIDTH = 40, 56
SECONDS = 60.0  # compiling included, where a test is the first to need a kernel
METHODS = [name for name in MATCHERS if name != 'external']


def texture(height=HEIGHT, width=WIDTH, seed=3):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)


def flat(value, height=HEIGHT, width=WIDTH):
    return np.full((height, width, 3), value, np.uint8)


def checkers():
    rows, columns = np.indices((HEIGHT, WIDTH))
    return ((rows + columns) % 2 * 255).astype(np.uint8)


wide = texture(width=WIDTH + 6)
PAIRS = {
    'constant': (flat(127), flat(127)),
    'black': (flat(0), flat(0)),
    'saturated': (flat(255), flat(255)),
    'black and white': (flat(0), flat(255)),
    'noise': (texture(seed=1), texture(seed=2)),
    'identical': (texture(), texture()),
    'swapped': (wide[:, 6:].copy(), wide[:, :WIDTH].copy()),
    '8x8': (texture(8, 8), texture(8, 8)),
    '1x1': (texture(1, 1), texture(1, 1)),
    'one row': (texture(1, WIDTH), texture(1, WIDTH)),
    'one column': (texture(HEIGHT, 1), texture(HEIGHT, 1)),
    'two rows': (texture(2, WIDTH), texture(2, WIDTH)),
    'checkers': (checkers(), checkers()),
    'not contiguous': (wide[:, :WIDTH], wide[:, 6:]),
}


def assert_usable(result, shape, span):
    for disparity in (result.disparity, result.preliminary):
        values = disparity.values
        assert values.shape == shape and values.dtype == np.float32
        assert not np.isinf(values).any()
        # Whatever claims to be valid lies within the search range or a plane's overshoot.
        valid = values[disparity.valid]
        assert valid.size == 0 or np.abs(valid).max() <= span, np.abs(valid).max()
    labels, planes = result.segments.labels, result.segments.planes
    assert labels.shape == shape and labels.dtype == np.int32
    assert labels.min() == 0 and labels.max() == len(planes) - 1
    assert np.isfinite(planes[result.segments.is_fitted]).all()
    assert np.isin(np.isnan(planes).sum(axis=1), (0, 3)).all()


def refine(preset, left, right, preliminary=None, **values):
    params = load_preset(preset, {
        'matching.num_disparities': 16,
        **{name.replace('__', '.'): value for name, value in values.items()}})
    began = time.monotonic()
    result = StereoRefiner(params).process(left, right, preliminary)
    assert time.monotonic() - began < SECONDS
    span = 2 * (params.matching.num_disparities + abs(params.matching.min_disparity))
    assert_usable(result, left.shape[:2], span)
    return result


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('preset', PRESETS)
@pytest.mark.parametrize('name', PAIRS)
def test_every_matcher_and_preset(name, preset, method):
    before = [image.copy() for image in PAIRS[name]]
    refine(preset, *PAIRS[name], matching__method=method)
    for image, copy in zip(PAIRS[name], before, strict=True):
        np.testing.assert_array_equal(image, copy)


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('values', [
    {'matching__num_disparities': 1},
    {'matching__num_disparities': WIDTH + 40},
    {'matching__num_disparities': 2048},
    {'matching__min_disparity': -20},
    {'matching__min_disparity': 2048},
    {'matching__min_disparity': -2048, 'matching__num_disparities': 7}], ids=str)
def test_search_ranges_that_leave_the_image(method, values):
    # A range of 2048 takes seconds, and presets match alike.
    for preset in PRESETS[:1] if 2048 in values.values() else PRESETS:
        refine(preset, wide[:, :WIDTH].copy(), wide[:, 6:].copy(),
               matching__method=method, **values)


@pytest.mark.parametrize('projection', PROJECTIONS)
@pytest.mark.parametrize('segments', [
    {'segmentation__min_size': 1_000_000, 'segmentation__k': 1e6},
    {'segmentation__min_size': 1, 'segmentation__k': 0.0, 'segmentation__sigma': 0.0}],
    ids=['one', 'many'])
@pytest.mark.parametrize('preset', PRESETS)
def test_one_giant_segment_and_every_pixel_its_own(preset, segments, projection):
    result = refine(preset, wide[:, :WIDTH].copy(), wide[:, 6:].copy(),
                    planes__projection=projection, **segments)
    count = len(result.segments.planes)
    assert count == 1 if segments['segmentation__min_size'] > 1 else count > HEIGHT * WIDTH / 2


@pytest.mark.parametrize('right', [True, False], ids=['pair', 'left alone'])
@pytest.mark.parametrize('preset', PRESETS)
def test_all_invalid_preliminary_stays_invalid(preset, right):
    nothing = np.full((HEIGHT, WIDTH), np.nan, np.float32)
    result = refine(preset, texture(), texture() if right else None, nothing)
    assert not result.preliminary.valid.any()
    assert not result.disparity.valid.any()


@pytest.mark.parametrize('preset', PRESETS)
def test_one_valid_pixel_and_one_disparity(preset):
    values = np.full((HEIGHT, WIDTH), np.nan, np.float32)
    values[20, 20] = 5.0
    refine(preset, texture(), None, values)
    result = refine(preset, texture(), None, np.full((HEIGHT, WIDTH), 5.0, np.float32))
    np.testing.assert_allclose(result.disparity.values, 5.0, atol=1e-3)


@pytest.mark.parametrize('left,right', [
    (texture(), texture(height=HEIGHT + 1)), (texture(), texture()[..., 0]),
    (np.zeros((0, 5, 3), np.uint8), np.zeros((0, 5, 3), np.uint8)),
    (texture().astype(np.float32), texture().astype(np.float32)),
    (texture()[..., :2], texture()[..., :2]), (None, texture())])
def test_what_is_no_pair_is_refused(left, right):
    with pytest.raises(ValueError, match='left|right'):
        StereoRefiner(load_preset('live')).process(left, right)


@pytest.mark.parametrize('method', ['segment_tree', 'non_local', 'scanline'])
def test_a_cost_volume_beyond_the_memory_is_refused_at_once(method):
    huge = np.broadcast_to(np.uint8(0), (16384, 16384))  # of one byte
    params = load_preset('accurate', {
        'matching.method': method, 'matching.num_disparities': 2048})
    with pytest.raises(ValueError, match='16384 x 16384 with 2048 disparities needs about'):
        StereoRefiner(params).process(huge, huge)


LARGE = """
import resource, sys, time
import numpy as np
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
wide = np.random.default_rng(0).integers(0, 256, (3072, 4096 + 8, 3), np.uint8)
left, right = np.ascontiguousarray(wide[:, :4096]), np.ascontiguousarray(wide[:, 8:])
refiner = StereoRefiner(load_preset('live'))
refiner.process(left[:64, :256], right[:64, :256])
began = time.monotonic()
values = refiner.process(left, right).disparity.values
print(time.monotonic() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
      np.median(values[np.isfinite(values)]))
"""


@pytest.mark.compiled
def test_twelve_megapixels_in_bounded_time_and_memory():
    done = subprocess.run(
        [sys.executable, '-c', LARGE], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    seconds, memory_mb, median = map(float, done.stdout.split())
    assert seconds < 60 and memory_mb < 2000
    assert median == pytest.approx(8.0, abs=0.1)
