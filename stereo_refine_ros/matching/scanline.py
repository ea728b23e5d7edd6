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

"""Scanline optimisation on the truncated colour, census and gradient cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.matching import scanline_kernels as kernels
from stereo_refine_ros.matching.robust_cost import COST_UNIT
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image, StereoPair

# Penalties in units of cost, and what is left of them where one view or both show an edge.
_P1, _P2 = 2.0, 4.5
_EDGE_FACTORS = (0.1, 0.15, 1.0)
_EDGE_THRESHOLD = 20


@dataclass(frozen=True, eq=False)
class ScanlineResult:
    """
    Winners of both views.

    Attributes
    ----------
    total : int16 ndarray of shape (H, W, D)
        Sum of the four paths.
    left, right : int32 ndarray of shape (H, W)
        Index of the best disparity; -1 in `right` where no left pixel reaches.
    subpixel : float32 ndarray of shape (H, W)
        `left` with its parabola offset, as index.

    """

    total: NDArray[np.int16]
    left: NDArray[np.int32]
    right: NDArray[np.int32]
    subpixel: FloatMap


def optimize_scanlines(pair: StereoPair, cost: NDArray[np.uint8], min_disparity: int,
                       threads: int = 1) -> ScanlineResult:
    """Run four paths over the cost volume and take the winners of both views."""
    assert pair.right is not None
    height, width, depth = cost.shape
    limits = _limits()
    total = np.empty(cost.shape, np.int16)
    run_bands(kernels._horizontal_kernel, height, threads, cost,
              _flat(pair.left, 1), _mirrored(_flat(pair.right, 1), min_disparity, depth),
              limits, total)
    run_bands(kernels._vertical_kernel, width, threads, cost,
              _flat(pair.left, 0), _mirrored(_flat(pair.right, 0), min_disparity, depth),
              limits, total)
    left = np.empty((height, width), np.int32)
    right = np.empty((height, width), np.int32)
    subpixel = np.empty((height, width), np.float32)
    run_bands(kernels._winner_kernel, height, threads, total, left, subpixel)
    run_bands(kernels._right_winner_kernel, height, threads, total, min_disparity, right)
    return ScanlineResult(total, left, right, subpixel)


def _limits() -> NDArray[np.int16]:
    """P1, what a flat right view adds to it, the same of P2; row 0 for a flat left view."""
    both, one, none = (np.array([_P1, _P2]) * COST_UNIT * factor for factor in _EDGE_FACTORS)
    rows = [(low[0], high[0] - low[0], low[1], high[1] - low[1])
            for low, high in ((one, none), (both, one))]
    return np.rint(rows).astype(np.int16)


def _flat(image: Image, axis: int) -> NDArray[np.int16]:
    """Mark with -1 the steps along `axis` that cross no edge; entry i is the step from i - 1."""
    wide = image.astype(np.int16)
    change = np.abs(np.diff(wide, axis=axis))
    if change.ndim == 3:
        change = change.max(axis=2)
    pad = [(0, 0), (0, 0)]
    pad[axis] = (1, 1)
    return np.pad(-(change < _EDGE_THRESHOLD).astype(np.int16), pad, constant_values=-1)


def _mirrored(flags: NDArray[np.int16], min_disparity: int, depth: int) -> NDArray[np.int16]:
    """Mirror columns and pad, so that entry (width - 1 - x) + i is column x - d of `flags`."""
    width = flags.shape[1]
    columns = np.clip(width - 1 - min_disparity - np.arange(width + depth), 0, width - 1)
    return np.ascontiguousarray(flags[:, columns])
