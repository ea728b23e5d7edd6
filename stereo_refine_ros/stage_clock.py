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

"""Wall times of the stages of a frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import time


class StageClock:
    """Wall times of the stages of one frame, milliseconds."""

    def __init__(self) -> None:
        """Start the clock."""
        self._begin = time.perf_counter()
        self.stage_ms = dict.fromkeys(('matching', 'segmentation', 'planes', 'filter'), 0.0)

    @contextmanager
    def timing(self, stage: str) -> Iterator[None]:
        """Add what the block takes to a stage."""
        begin = time.perf_counter()
        yield
        self.stage_ms[stage] += (time.perf_counter() - begin) * 1e3

    def total_ms(self) -> float:
        """Return the milliseconds since the start."""
        return (time.perf_counter() - self._begin) * 1e3
