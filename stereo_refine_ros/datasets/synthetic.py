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

"""
Slanted textured planes, rendered in code with exact ground truth.

A plane d = a x + b y + c maps a point x of the left view to x - d in the right view, and that
map can be inverted: x = (x_right + b y + c) / (1 - a). Texture and outline of every surface are
functions of the left view's coordinates, so both views are sampled from the same surface and
the truth, the occlusions included, is exact to the last bit of float32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.datasets.scene import Mask, Scene
from stereo_refine_ros.types import FloatMap, Image, LabelMap, StereoGeometry, StereoPair

Floats = NDArray[np.float64]

_LATTICE = 64
# Wavelength in pixels and share of the contrast of each layer of texture. The shortest is kept
# above two pixels: a finer one could not be sampled in both views without aliasing.
_OCTAVES = ((29.0, 0.35), (11.0, 0.35), (4.5, 0.30))


@dataclass(frozen=True, eq=False, kw_only=True)
class SyntheticScene(Scene):
    """
    A rendered scene, with the surface behind every pixel.

    Attributes
    ----------
    labels, labels_right : int32 ndarray of shape (H, W)
        Index of the surface seen in the left and in the right view.
    planes : float64 ndarray of shape (N, 3)
        d(x, y) = a x + b y + c of every surface, in the left view.

    """

    labels: LabelMap
    labels_right: LabelMap
    planes: Floats


@dataclass(frozen=True, eq=False)
class _Surface:
    """One plane: its disparity, its outline (None for endless) and its texture."""

    plane: Floats
    outline: tuple[float, float, float, float, float, bool] | None
    color: Floats
    lattice: Floats
    contrast: float

    def disparity(self, x: Floats, y: Floats) -> Floats:
        a, b, c = self.plane
        return a * x + b * y + c

    def unproject(self, x_right: Floats, y: Floats) -> Floats:
        """Return the left column of the surface's point seen at `x_right`."""
        a, b, c = self.plane
        return (x_right + b * y + c) / (1.0 - a)

    def covers(self, x: Floats, y: Floats) -> Mask:
        if self.outline is None:
            return np.ones(np.broadcast_shapes(x.shape, y.shape), bool)
        cx, cy, rx, ry, angle, is_round = self.outline
        u = ((x - cx) * np.cos(angle) + (y - cy) * np.sin(angle)) / rx
        v = ((y - cy) * np.cos(angle) - (x - cx) * np.sin(angle)) / ry
        return u * u + v * v <= 1.0 if is_round else np.maximum(abs(u), abs(v)) <= 1.0

    def shade(self, x: Floats, y: Floats) -> Floats:
        """Return the colours of N points, shape (N, 3) BGR, unrounded."""
        waves = sum(share * _noise(self.lattice, x / length, y / length)
                    for length, share in _OCTAVES)
        return self.color + self.contrast * np.asarray(waves)


def render_scene(seed: int = 0, height: int = 240, width: int = 320, num_disparities: int = 48,
                 num_patches: int = 6, contrast: float = 60.0, noise: float = 0.0,
                 doffs_px: float = 0.0, row_offset: float = 0.0) -> SyntheticScene:
    """
    Render a slanted wall, a floor and patches before them, from a seed.

    Parameters
    ----------
    seed : int
        Same seed and sizes, same pixels.
    height, width : int
        Pixels, at least 32.
    num_disparities : int
        All disparities lie in (0, num_disparities - 1); at least 16.
    num_patches : int
        Slanted rectangles and ellipses before the wall.
    contrast : float
        Reach of the texture in grey levels.
    noise : float
        Standard deviation of the sensor noise, in grey levels, of each view.
    doffs_px : float
        Difference of the principal points, cx_right - cx_left.
    row_offset : float
        How far below its row in the left view a point lies in the right one, pixels: a pair
        whose calibration has slipped. The left view and its truth stay as they are.

    Raises
    ------
    ValueError
        For a size too small to hold the scene.

    """
    if min(height, width) < 32 or num_disparities < 16:
        raise ValueError('render_scene: needs 32 x 32 pixels and 16 disparities, got '
                         f'{width} x {height} and {num_disparities}')
    rng = np.random.default_rng(seed)
    surfaces = _arrange(rng, height, width, num_disparities, num_patches, contrast)
    left, truth, labels = _render_left(surfaces, height, width)
    right, truth_right, labels_right = _render_right(surfaces, height, width, row_offset)
    visible = _visible(surfaces, truth, labels)
    pair = StereoPair(_expose(left, noise, rng), _expose(right, noise, rng))
    cx, cy = (width - 1) / 2, (height - 1) / 2
    return SyntheticScene(
        name='synthetic', pair=pair, truth=truth.astype(np.float32),
        scale=max(1, 255 // num_disparities), num_disparities=num_disparities,
        masks={'nonocc': visible, 'all': np.ones((height, width), bool)},
        geometry=StereoGeometry(0.9 * width, 0.12, cx, cy, cx + doffs_px),
        truth_right=truth_right.astype(np.float32), labels=labels, labels_right=labels_right,
        planes=np.array([surface.plane for surface in surfaces]))


def _arrange(rng: np.random.Generator, height: int, width: int, num_disparities: int,
             num_patches: int, contrast: float) -> list[_Surface]:
    """Place a wall, a floor that meets it, and patches between them and the cameras."""
    colors = _distinct_colors(rng, num_patches + 2)
    far = 0.18 * num_disparities
    wall = _plane_at(width / 2, height / 2, far, 0.08 * num_disparities / width, 0.0)
    rise = 0.45 * num_disparities / (0.4 * height)
    floor = _plane_at(width / 2, 0.6 * height, far, 0.0, rise)
    outlines: list[tuple[float, float, float, float, float, bool] | None] = [None, None]
    planes = [wall, floor]
    for index in range(num_patches):
        cx = width * (index + rng.uniform(0.3, 0.7)) / num_patches
        cy = height * rng.uniform(0.2, 0.7)
        rx, ry = width * rng.uniform(0.06, 0.12), height * rng.uniform(0.1, 0.22)
        depth = num_disparities * rng.uniform(0.45, 0.75)
        reach = 0.1 * num_disparities / max(rx, ry)
        a, b = rng.uniform(-reach, reach, 2)
        planes.append(_plane_at(cx, cy, depth, a, b))
        outlines.append((cx, cy, rx, ry, rng.uniform(-0.5, 0.5), bool(index % 2)))
    return [_Surface(plane, outline, color, _texture(rng), contrast)
            for plane, outline, color in zip(planes, outlines, colors, strict=True)]


def _texture(rng: np.random.Generator) -> Floats:
    """Draw a lattice of values in -1..1, mostly grey."""
    grey = rng.uniform(-0.75, 0.75, (_LATTICE, _LATTICE, 1))
    return np.asarray(grey + rng.uniform(-0.25, 0.25, (_LATTICE, _LATTICE, 3)))


def _plane_at(x: float, y: float, disparity: float, a: float, b: float) -> Floats:
    return np.array([a, b, disparity - a * x - b * y])


def _distinct_colors(rng: np.random.Generator, count: int) -> Floats:
    """Return `count` BGR colours whose hues lie evenly on a circle, shuffled."""
    phase = (rng.permutation(count)[:, None] / count + np.array([0.0, 1 / 3, 2 / 3])) * 2 * np.pi
    return 128.0 + 60.0 * np.cos(phase)


def _grid(height: int, width: int) -> tuple[Floats, Floats]:
    columns, rows = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    return columns[None, :], rows[:, None]


def _render_left(surfaces: list[_Surface], height: int,
                 width: int) -> tuple[Floats, Floats, LabelMap]:
    x, y = _grid(height, width)
    return _render(surfaces, [x] * len(surfaces), y, (height, width))


def _render_right(surfaces: list[_Surface], height: int, width: int,
                  row_offset: float) -> tuple[Floats, Floats, LabelMap]:
    x, rows = _grid(height, width)
    y = rows - row_offset
    columns = [surface.unproject(x, y) for surface in surfaces]
    return _render(surfaces, columns, y, (height, width))


def _render(surfaces: list[_Surface], columns: list[Floats], y: Floats,
            shape: tuple[int, int]) -> tuple[Floats, Floats, LabelMap]:
    """Return image, disparity and label of the nearest surface at every pixel."""
    image = np.zeros((*shape, 3))
    nearest = np.full(shape, -np.inf)
    labels = np.zeros(shape, np.int32)
    for label, (surface, x) in enumerate(zip(surfaces, columns, strict=True)):
        x, rows = np.broadcast_arrays(x, y)
        disparity = surface.disparity(x, rows)
        wins = surface.covers(x, rows) & (disparity > nearest)
        image[wins] = surface.shade(x[wins], rows[wins])
        nearest[wins] = disparity[wins]
        labels[wins] = label
    return image, nearest, labels


def _visible(surfaces: list[_Surface], truth: Floats, labels: LabelMap) -> Mask:
    """Mark the left pixels whose point lies in the right view with nothing before it."""
    x, y = _grid(*truth.shape)
    x_right = x - truth
    visible = (x_right >= 0) & (x_right <= truth.shape[1] - 1)
    for label, surface in enumerate(surfaces):
        other = surface.unproject(x_right, y)
        hides = surface.covers(other, y) & (surface.disparity(other, y) > truth)
        visible &= ~hides | (labels == label)
    return visible


def _expose(image: Floats, noise: float, rng: np.random.Generator) -> Image:
    grain = rng.normal(0.0, noise, image.shape) if noise > 0 else 0.0
    return np.clip(np.rint(image + grain), 0, 255).astype(np.uint8)


def _noise(lattice: Floats, u: Floats, v: Floats) -> FloatMap | Floats:
    """Interpolate the repeating lattice at (u, v) with smooth weights."""
    column, row = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
    s, t = (_smooth(u - column)[..., None], _smooth(v - row)[..., None])
    column, row = column % _LATTICE, row % _LATTICE
    after, below = (column + 1) % _LATTICE, (row + 1) % _LATTICE
    top = lattice[row, column] * (1 - s) + lattice[row, after] * s
    bottom = lattice[below, column] * (1 - s) + lattice[below, after] * s
    return top * (1 - t) + bottom * t


def _smooth(t: Floats) -> Floats:
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)
