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

"""Working memory that is lent and kept."""

from stereo_refine_ros.matching import scratch as module
from stereo_refine_ros.matching.scratch import scratch


def test_what_was_given_back_is_lent_again_to_one_at_a_time():
    with scratch(1001) as first, scratch(1001) as second:
        assert first is not second
        assert first.shape == second.shape == (1001,)
    with scratch(1001) as again:
        assert again is second or again is first
    assert all(array.ctypes.data % 64 == 0 for array in (first, second))
    with scratch(1002) as other:
        assert other.shape == (1002,)


def test_the_longest_unused_is_dropped(monkeypatch):
    monkeypatch.setattr(module, '_idle', [])
    for size in range(2000, 2100):
        with scratch(size):
            pass
    assert [array.size for array in module._idle] == list(range(2088, 2100))
