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

"""The vertical disagreement of two rectified views: found in them, undone, followed in time."""

from stereo_refine_ros.rectification.columns import columns_hold
from stereo_refine_ros.rectification.kernels import compile_kernels
from stereo_refine_ros.rectification.row_offset import (
    find_row_offset, measure_row_offset, NO_OFFSET, RowOffset, significant, undo_row_offset)
from stereo_refine_ros.rectification.tracker import RowOffsetTracker

__all__ = [
    'NO_OFFSET', 'RowOffset', 'RowOffsetTracker', 'columns_hold', 'compile_kernels',
    'find_row_offset', 'measure_row_offset', 'significant', 'undo_row_offset']
