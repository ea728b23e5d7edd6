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

"""Arrays into image messages; the way back is in `stereo_refine_ros.encodings`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image


def fill_image(message: Image, pixels: NDArray, encoding: str) -> Image:
    """Fill a fresh image message with an array of shape (H, W[, C]) in native byte order."""
    packed = np.ascontiguousarray(pixels)
    message.height, message.width = packed.shape[:2]
    message.encoding = encoding
    message.is_bigendian = 0
    message.step = packed.nbytes // packed.shape[0]
    # `frombytes` of a flat view: no other way of filling the array comes near its speed.
    message.data.frombytes(packed.reshape(-1).data.cast('B'))
    return message
