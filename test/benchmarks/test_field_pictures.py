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

"""The pictures of maps that became worse."""

from types import SimpleNamespace

from field_pictures import draw_changes, MENDED, SPOILT, WRONG
import numpy as np

from stereo_refine_ros.types import DisparityMap


def test_what_was_mended_and_what_was_spoilt_have_their_colours():
    truth = np.full((1, 5), 10, np.float32)
    given, after = np.float32([[10, 4, 10, 4, 10]]), np.float32([[10, 10, 4, 4, 10]])
    truth[0, 4] = np.nan
    after[0, 4] = 30  # unknown truth: neither
    scene = SimpleNamespace(
        left=np.full((1, 5), 80, np.uint8), truth=truth, group='eth3d')
    result = SimpleNamespace(
        preliminary=DisparityMap(given, 0, 32), disparity=DisparityMap(after, 0, 32))
    picture = draw_changes(scene, result)
    assert picture.shape == (1, 15, 3) and picture.dtype == np.uint8
    assert picture[0, :5].tolist() == [
        [40, 40, 40], list(MENDED), list(SPOILT), list(WRONG), [40, 40, 40]]
    np.testing.assert_array_equal(picture[0, 5], picture[0, 10])  # 10 px before and after
    assert (picture[0, 6] != picture[0, 11]).any()
