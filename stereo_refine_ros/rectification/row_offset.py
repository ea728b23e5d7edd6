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

"""The vertical disagreement of two views that should be rectified: found, and undone."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_grey
from stereo_refine_ros.rectification import tuning
from stereo_refine_ros.rectification.point_matching import match_points
from stereo_refine_ros.rectification.robust_fit import fit_rows
from stereo_refine_ros.rectification.warp import warp_rows
from stereo_refine_ros.threads import run_bands
from stereo_refine_ros.types import FloatMap, Image


@dataclass(frozen=True)
class RowOffset:
    """
    How far below its row in the left view a point lies in the right one, over the right view.

    Attributes
    ----------
    offset_px : float
        At the centre of the image, pixels.
    tilt_px : float
        Change from the left to the right border. One camera is turned about its axis.
    stretch_px : float
        Change from the upper to the lower border. The focal lengths differ.
    twist_px : float
        Change of the tilt from the upper to the lower border. One camera looks more to the side.
    points : int
        On how many points of the images this rests; 0 where nothing was found.

    """

    offset_px: float = 0.0
    tilt_px: float = 0.0
    stretch_px: float = 0.0
    twist_px: float = 0.0
    points: int = 0

    @classmethod
    def of(cls, terms: Iterable[float], points: int) -> RowOffset:
        """Build from offset, tilt, stretch and twist."""
        offset, tilt, stretch, twist = (float(term) for term in terms)
        return cls(offset, tilt, stretch, twist, points)

    @property
    def terms(self) -> tuple[float, float, float, float]:
        """Offset, tilt, stretch, twist."""
        return self.offset_px, self.tilt_px, self.stretch_px, self.twist_px

    @property
    def largest_px(self) -> float:
        """Largest disagreement in the image: that of one of its corners, pixels."""
        return max(abs(self._at(across, down)) for across in (-0.5, 0.5) for down in (-0.5, 0.5))

    @property
    def is_zero(self) -> bool:
        """Whether there is nothing to undo."""
        return not any(self.terms)

    def turn(self, width: int) -> float:
        """Return the turn of the camera that the tilt in `width` columns stands for, radian."""
        return _turn(self.tilt_px / max(width - 1, 1))

    def bend_px(self, width: int) -> float:
        """Return what is left of the tilt in `width` columns once the turn is undone, pixels."""
        return self.tilt_px - max(width - 1, 1) * self.turn(width)

    def at(self, shape: tuple[int, int]) -> FloatMap:
        """Return the offset of every pixel of the right view, float32 (H, W), pixels."""
        down, across = _grid(*shape)
        return np.broadcast_to(self._at(across, down), shape).astype(np.float32)

    def _at(self, across: Any, down: Any) -> Any:
        return (self.offset_px + self.tilt_px * across + self.stretch_px * down
                + self.twist_px * across * down)


NO_OFFSET = RowOffset()


def measure_row_offset(left: Image, right: Image, min_disparity: int, num_disparities: int
                       ) -> RowOffset:
    """
    Find the row offset however small it is; see `find_row_offset`.

    Notes
    -----
    For an average over many frames, each of which says too little.

    """
    grey = _grey(left), _grey(right)
    height, width = grey[0].shape
    points = match_points(*grey, min_disparity, num_disparities)
    fit = fit_rows(points.x / (width - 1) - 0.5, points.y / (height - 1) - 0.5,
                   points.dy, points.sigma)
    if not fit.is_fitted:
        return NO_OFFSET
    return RowOffset.of(fit.terms, fit.points)


def find_row_offset(left: Image, right: Image, min_disparity: int, num_disparities: int
                    ) -> RowOffset:
    """
    Find how far the rows of two views disagree, from the views alone.

    Corners of the left view are found in the right one, and a smooth surface is laid through
    their rows. The same views give the same bits.

    Parameters
    ----------
    left, right : uint8 ndarray of shape (H, W) or (H, W, 3) BGR
        Grey is faster.
    min_disparity, num_disparities : int
        Pixels; where along the row a point may be.

    Returns
    -------
    RowOffset
        All 0 where the views agree, or show too little to tell.

    """
    return significant(measure_row_offset(left, right, min_disparity, num_disparities))


def significant(offset: RowOffset, least_px: float = tuning.LEAST_PX) -> RowOffset:
    """Return the offset, or one of 0 where it is nowhere as large as `least_px`."""
    return offset if offset.largest_px >= least_px else RowOffset(points=offset.points)


def undo_row_offset(right: Image, offset: RowOffset, threads: int = 1) -> Image:
    """
    Warp the right view so that its rows are those of the left.

    What turns the rows turns the columns: a clear tilt is undone as the turn of a camera that
    causes it. A slight tilt, stretch and twist move pixels up and down only, since their cause,
    and what it did to the columns, is unknown.

    Parameters
    ----------
    right : uint8 ndarray of shape (H, W) or (H, W, 3)
        The view to warp.
    offset : RowOffset
        From `find_row_offset`.
    threads : int
        The result does not depend on it.

    Returns
    -------
    uint8 ndarray of the shape of `right`
        `right` itself, not a copy, where the offset is 0. Beyond the border its pixels repeat.

    """
    if offset.is_zero:
        return right
    height, width = right.shape[:2]
    image = np.ascontiguousarray(right).reshape(height, width, -1)
    out = np.empty_like(image)
    run_bands(warp_rows, height, threads, image, np.array(offset.terms), offset.turn(width), out)
    return out.reshape(right.shape)


def _turn(tilt: float) -> float:
    """Return the turn of the camera that a tilt stands for, radian: none for a slight one."""
    slight, clear = np.radians(tuning.SLIGHT_TURN_DEG), np.radians(tuning.CLEAR_TURN_DEG)
    return tilt * min(max((abs(tilt) - slight) / (clear - slight), 0.0), 1.0)


def _grid(height: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the position down (H, 1) and across (1, W) the image, -0.5..0.5."""
    return (np.linspace(-0.5, 0.5, height)[:, None] if height > 1 else np.zeros((1, 1)),
            np.linspace(-0.5, 0.5, width)[None, :] if width > 1 else np.zeros((1, 1)))


def _grey(image: Image) -> Image:
    return np.ascontiguousarray(to_grey(image))
