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

"""Pairs in which noise is heavy beside what there is to see: blurred a little, and stretched."""

from __future__ import annotations

import cv2
import numpy as np

from stereo_refine_ros.health.tuning import (
    CLEAR_BLUR_PX, CLEAR_CONTRAST, CLEAR_GAIN, CLEAR_NOISE)
from stereo_refine_ros.images import to_grey
from stereo_refine_ros.types import Image, PairHealth, StereoPair


def clear_pair(pair: StereoPair, views: PairHealth) -> StereoPair:
    """
    Clear a pair for matching where its noise asks for it; else return it as it is.

    Both views become grey, are blurred, and a dim pair is brightened before it is rounded again,
    by one factor for both.

    Parameters
    ----------
    pair : StereoPair
        With a right view.
    views : PairHealth
        Noise and contrast of the two images.

    """
    assert pair.right is not None
    contrast = max(min(views.contrast_left, views.contrast_right), 1e-3)
    if not views.noise_sigma / contrast >= CLEAR_NOISE:
        return pair
    brightest = max(np.percentile(view[::4, ::4], 99) for view in (pair.left, pair.right))
    gain = min(CLEAR_CONTRAST / contrast, CLEAR_GAIN, 250 / max(brightest, 1.0))
    gain = max(gain, 1.0)
    return StereoPair(_cleared(pair.left, gain), _cleared(pair.right, gain))


def _cleared(image: Image, gain: float) -> Image:
    grey = to_grey(image).astype(np.float32) * np.float32(gain)
    blurred = cv2.GaussianBlur(grey, (0, 0), CLEAR_BLUR_PX).reshape(grey.shape)
    return np.clip(np.rint(blurred), 0, 255).astype(np.uint8)
