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

"""OpenCV's matchers: any range, any width, no dead border."""

import numpy as np
import pytest

from stereo_refine_ros.matching import compute_match, MATCHERS
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.types import StereoPair

METHODS = ('sgbm', 'bm')


def shifted_pair(shift, shape=(40, 100, 3)):
    """Make a smooth random pair whose every pixel has one disparity."""
    generator = np.random.default_rng(4)
    wide = generator.integers(0, 256, (shape[0], shape[1] + 200, *shape[2:]), dtype=np.uint8)
    columns = np.arange(100, 100 + shape[1])
    return StereoPair(wide[:, columns], wide[:, columns + shift])


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize(('low', 'count', 'shift'), [
    (0, 64, 10), (0, 7, 3), (3, 21, 17), (-20, 60, -8), (-30, 16, -25), (0, 1, 0)])
@pytest.mark.parametrize('shape', [(40, 100, 3), (40, 100)])
def test_shift_is_found_wherever_the_partner_is_in_view(method, low, count, shift, shape):
    pair = shifted_pair(shift, shape)
    matching = MatchingParams(method=method, min_disparity=low, num_disparities=count)
    match = compute_match(pair, matching)
    values = match.disparity.values
    assert values.dtype == np.float32 and values.shape == (40, 100)
    seen = values[:, max(shift, 0) + 8:100 + min(shift, 0) - 8]
    assert np.mean(np.abs(seen - shift) <= 0.25) > 0.95
    found = values[np.isfinite(values)]
    assert found.min() >= low and found.max() < low + count
    assert (match.disparity.min_disparity, match.disparity.num_disparities) == (low, count)
    assert match.lr_consistent_ratio == np.isfinite(values).mean()


@pytest.mark.parametrize('method', METHODS)
def test_first_columns_and_border_rows_are_matched(method):
    pair = shifted_pair(2)
    values = compute_match(pair, MatchingParams(method=method)).disparity.values
    assert np.isfinite(values[:, 3:10]).mean() > 0.9
    assert np.isfinite(values[[0, -1], 10:-10]).mean() > 0.8


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('shape', [(1, 1, 3), (5, 5), (3, 200, 3), (30, 20, 3)])
@pytest.mark.parametrize('low', [-10, 0, 40])
def test_small_images_give_a_map_of_their_size(method, shape, low):
    image = np.random.default_rng(5).integers(0, 256, shape, dtype=np.uint8)
    matching = MatchingParams(method=method, min_disparity=low, num_disparities=50)
    values = compute_match(StereoPair(image, image), matching).disparity.values
    assert values.shape == shape[:2]
    assert not np.any((values < low) | (values >= low + 50))


def test_a_missing_right_image_and_unknown_matchers_are_refused():
    image = np.zeros((4, 4), np.uint8)
    with pytest.raises(ValueError, match='matching.method sgbm: needs the right image'):
        compute_match(StereoPair(image, None), MatchingParams(method='sgbm'))
    names = ', '.join(MATCHERS)
    with pytest.raises(ValueError, match=f"'magic' is none of {names}"):
        compute_match(StereoPair(image, image), MatchingParams(method='magic'))
