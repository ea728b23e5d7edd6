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

"""Other people's disparity maps, good and bad, for the refinement of external maps."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import FloatMap

_HOLES, _HOLE_SIDE = 60, 25
_SLOWLY_PX = 8.0


def external_maps(scene: Scene) -> dict[str, FloatMap]:
    """
    Disturb the semi-global matcher's map of `scene`, and the truth, as external maps are wrong.

    Returns
    -------
    dict of str to float32 ndarray of shape (H, W)
        'noise': Gaussian, 1 px, and 5 % of the pixels anywhere in the search range;
        'holes': squares without data; 'offset': 3 px too much everywhere; 'constant': one
        disparity, half the search range, for the whole image; 'network': the truth, dense, with
        an error of 0.2 px that varies slowly; 'blobs': the truth, dense, but for 5 % of the
        pixels in patches of one wrong disparity.

    """
    disparities = scene.num_disparities or 64
    params = load_preset('live', {
        'matching.method': 'sgbm', 'matching.num_disparities': disparities,
        'planes.projection': 'off', 'filter.method': 'none'})
    clean = StereoRefiner(params).process(scene.pair.left, scene.pair.right).preliminary.values
    rng = np.random.default_rng(0)
    noise = clean + rng.normal(0, 1, clean.shape).astype(np.float32)
    outliers = np.isfinite(clean) & (rng.random(clean.shape) < 0.05)
    noise[outliers] = rng.uniform(0, disparities - 1, np.count_nonzero(outliers))
    holes = clean.copy()
    for y, x in zip(*(rng.integers(0, size, _HOLES) for size in clean.shape), strict=True):
        holes[y:y + _HOLE_SIDE, x:x + _HOLE_SIDE] = np.nan
    constant = np.full_like(clean, disparities / 2)
    assert scene.truth is not None
    truth = fill_from_background(scene.truth)
    slow = slow_noise(rng, truth.shape, _SLOWLY_PX)
    return {'noise': np.clip(noise, 0, disparities - 1), 'holes': holes,
            'offset': np.minimum(clean + 3, np.float32(disparities - 1)), 'constant': constant,
            'network': network_map(truth, slow), 'blobs': map_with_blobs(truth, slow)}


def slow_noise(rng: np.random.Generator, shape: tuple[int, ...], sigma_px: float
               ) -> NDArray[np.float64]:
    """Return noise that varies slowly from place to place, float64 of the shape."""
    return cv2.GaussianBlur(rng.normal(size=shape), (0, 0), sigma_px)


def network_map(truth: FloatMap, slow: NDArray[np.float64]) -> FloatMap:
    """Return the dense truth with an error of 0.2 px that varies as `slow_noise`."""
    return (truth + 0.2 * slow / slow.std()).astype(np.float32)


def map_with_blobs(truth: FloatMap, slow: NDArray[np.float64]) -> FloatMap:
    """Return the dense truth with one wrong disparity where `slow_noise` is largest, 5 %."""
    wrong = slow > np.quantile(slow, 0.95)
    return np.where(wrong, 0.6 * np.nanmax(truth), truth).astype(np.float32)
