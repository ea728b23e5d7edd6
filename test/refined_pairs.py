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

"""One run of the whole method, and what must hold of whatever comes out of it."""

import numpy as np
import pytest

from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner

STAGES = {'matching', 'segmentation', 'planes', 'filter'}
RANGE = 24
# processing.refine_pixels for planes on the image itself, and on its half.
GRIDS = [1.0, 0.0]


def refiner(preset='live', **values):
    """Build a refiner; `a__b` stands for the parameter a.b."""
    dotted = {'matching.num_disparities': RANGE}
    dotted |= {name.replace('__', '.'): value for name, value in values.items()}
    return StereoRefiner(load_preset(preset, dotted))


def refine(pair, preset='live', preliminary=None, **values):
    """Run a preset once; `a__b` stands for the parameter a.b."""
    return refiner(preset, **values).process(*pair, preliminary=preliminary)


def views(scene):
    return scene.pair.left, scene.pair.right


def noisy_truth(scene, dtype=np.float32):
    """Return the truth with noise of 0.1 px, every tenth pixel and a block of them missing."""
    rng = np.random.default_rng(3)
    values = scene.truth + rng.normal(0, 0.1, scene.truth.shape)
    values[rng.random(values.shape) < 0.1] = np.nan
    values[40:60, 30:50] = np.nan
    return values.astype(dtype)


def assert_same(a, b):
    """Compare two results bit for bit, times aside."""
    np.testing.assert_array_equal(a.disparity.values, b.disparity.values)
    np.testing.assert_array_equal(a.preliminary.values, b.preliminary.values)
    np.testing.assert_array_equal(a.confidence, b.confidence)
    for name in ('labels', 'planes', 'is_fitted', 'inlier_ratio', 'plane_index'):
        np.testing.assert_array_equal(getattr(a.segments, name), getattr(b.segments, name), name)
    for name in ('row_offset_px', 'gain_ratio', 'noise_sigma', 'given_agreement',
                 'last_disparity_ratio'):
        np.testing.assert_array_equal(getattr(a.health, name), getattr(b.health, name), name)
    assert a.lr_consistent_ratio == pytest.approx(b.lr_consistent_ratio, abs=0, nan_ok=True)


def assert_sound(result, shape, first, count):
    """Check types, shapes, the range and that what is valid is finite."""
    for disparity in (result.disparity, result.preliminary):
        values = disparity.values
        assert values.dtype == np.float32 and values.shape == shape
        assert values.flags.c_contiguous and not np.isinf(values).any()
        known = values[np.isfinite(values)]
        assert known.size == 0 or first <= known.min() <= known.max() < first + count
        assert (disparity.min_disparity, disparity.num_disparities) == (first, count)
    confidence = result.confidence
    assert confidence.dtype == np.float32 and confidence.shape == shape
    assert confidence.flags.c_contiguous
    assert np.all((confidence >= 0) & (confidence <= 1))  # and so none is NaN
    assert_segments_sound(result.segments, shape)
    assert set(result.stage_ms) == STAGES
    assert all(0 <= ms <= result.total_ms for ms in result.stage_ms.values())


def assert_segments_sound(segments, shape):
    amount = len(segments.planes)
    assert segments.labels.dtype == np.int32 and segments.labels.shape == shape
    assert segments.planes.dtype == np.float64 and segments.planes.shape == (amount, 3)
    assert segments.is_fitted.shape == segments.inlier_ratio.shape == (amount,)
    assert 0 <= segments.labels.min() <= segments.labels.max() < amount
    assert np.isfinite(segments.planes[segments.is_fitted]).all()
    assert np.all((segments.inlier_ratio >= 0) & (segments.inlier_ratio <= 1))
    assert segments.plane_index.shape == (amount,)
    np.testing.assert_array_equal(segments.plane_index < 0, np.isnan(segments.planes[:, 0]))


def bad_ratio(values, truth, limit=1.0):
    """Share of pixels off by more than a limit; what is missing is off."""
    return 1 - np.mean(np.abs(values - truth) <= limit)
