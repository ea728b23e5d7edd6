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

"""Pairs whose cameras are exposed differently: the right view made like the left one."""

from __future__ import annotations

import cv2
import numpy as np

from stereo_refine_ros.health.tuning import EVERY_COLUMN, EVERY_ROW, EXPOSURES, PLAIN
from stereo_refine_ros.types import Image, StereoPair


def even_exposure(pair: StereoPair) -> StereoPair:
    """
    Give the right view the contrast and brightness of the left one where they differ much.

    Matching compares gradients, which a gain scales. Every channel has a gain and an offset of
    its own, so that another white balance is undone too. Views that are alike stay as they are;
    so do such as are too far apart to be of one scene, and plain ones.

    Parameters
    ----------
    pair : StereoPair
        With a right view.

    """
    assert pair.right is not None
    (mean, deviation), (mean_right, deviation_right) = (
        _mean_and_deviation(view) for view in (pair.left, pair.right))
    if min(deviation.min(), deviation_right.min()) < PLAIN:
        return pair
    gain = deviation / deviation_right
    least, most = EXPOSURES
    furthest = max(gain.max(), 1 / gain.min())
    if not least < furthest <= most:
        return pair
    levels = np.arange(256)[:, np.newaxis]
    table = np.clip(np.rint(mean + gain * (levels - mean_right)), 0, 255).astype(np.uint8)
    right = cv2.LUT(pair.right, np.ascontiguousarray(table.reshape(256, 1, -1)))
    return pair.with_right(np.asarray(right).reshape(pair.right.shape))


def _mean_and_deviation(view: Image) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean and the standard deviation of each channel, float64 (C,)."""
    mean, deviation = cv2.meanStdDev(np.ascontiguousarray(view[::EVERY_ROW, ::EVERY_COLUMN]))
    return mean.ravel(), deviation.ravel()
