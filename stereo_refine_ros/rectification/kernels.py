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

"""The kernels of this folder, compiled ahead of time."""

import cv2
import numpy as np

from stereo_refine_ros.rectification.columns import columns_hold
from stereo_refine_ros.rectification.row_offset import (
    measure_row_offset, RowOffset, undo_row_offset)


def compile_kernels() -> None:
    """Run every kernel once, so that the first frame does not wait for the compiler."""
    texture = np.random.default_rng(0).integers(0, 256, (96, 512), np.uint8)
    view = np.asarray(cv2.GaussianBlur(texture, (0, 0), 4))
    measure_row_offset(view, view, 0, 16)
    offset = RowOffset(tilt_px=1.0)
    undo_row_offset(view, offset)
    columns_hold(np.zeros((2, 2), np.float32), offset, 2)
