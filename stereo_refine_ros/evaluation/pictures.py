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

"""Pictures of disparities, errors and segments, and their colour bars."""

from __future__ import annotations

import base64
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.images import to_bgr, to_grey
from stereo_refine_ros.types import FloatMap, Image, PlaneSegmentation, RefinementResult

ERROR_LIMIT = 4.0  # px, the end of the error colours

_UNKNOWN = (128, 128, 128)
_ERROR_STOPS = np.array([[245, 247, 247], [158, 212, 253], [72, 101, 239], [0, 0, 127]])
_WEBP_QUALITY = 88
_CONFIDENCE_COLORS = cv2.COLORMAP_MAGMA


def color_disparity(values: FloatMap, low: float, high: float) -> Image:
    """
    Colour disparities from `low` (dark violet) to `high` (yellow); holes are black.

    Viridis keeps its order for colour-blind readers and in grey print.
    """
    valid = np.isfinite(values)
    level = (np.where(valid, values, low) - low) / max(high - low, 1e-6) * 255.0
    picture = cv2.applyColorMap(np.clip(level, 0, 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)
    picture[~valid] = 0
    return np.asarray(picture, np.uint8)


def color_error(values: FloatMap, truth: FloatMap) -> Image:
    """Colour |d - t| from white (0) to dark red (4 px and more); holes black, unknown grey."""
    error = np.abs(values - truth)
    level = np.clip(np.nan_to_num(error) / ERROR_LIMIT * 255.0, 0, 255).astype(np.uint8)
    picture = _error_colors()[level]
    picture[~np.isfinite(values)] = 0
    picture[~np.isfinite(truth)] = _UNKNOWN
    return picture


def color_confidence(confidence: FloatMap) -> Image:
    """
    Colour a confidence from 0 (black) over purple and orange to 1 (light yellow).

    Parameters
    ----------
    confidence : float32 ndarray of shape (H, W), 0..1
        NaN counts as 0. Magma keeps its order for colour-blind readers and in grey print, and
        looks like none of the other pictures.

    """
    level = np.clip(np.rint(np.nan_to_num(confidence, nan=0.0) * 255), 0, 255)
    return np.asarray(cv2.applyColorMap(level.astype(np.uint8), _CONFIDENCE_COLORS), np.uint8)


def draw_segments(left: Image, segments: PlaneSegmentation) -> Image:
    """
    Tint every plane over the left view and draw the boundaries between planes in white.

    Segments that share a plane share its colour; those without a plane stay grey.
    """
    base = to_bgr(to_grey(left)).astype(np.float32)
    group = _plane_groups(segments)
    hue = (group * 0.61803399) % 1.0 * 180.0  # golden section: neighbours in number differ
    hsv = np.stack([hue, np.where(segments.is_fitted, 200, 0), np.full(len(group), 235)], 1)
    tint = cv2.cvtColor(hsv.astype(np.uint8)[None], cv2.COLOR_HSV2BGR)[0].astype(np.float32)
    picture = (0.5 * base + 0.5 * tint[segments.labels]).astype(np.uint8)
    picture[_boundaries(group[segments.labels])] = 255
    return picture


def frame_sheet(left: Image, result: RefinementResult) -> Image:
    """Draw the left view and its planes above the preliminary and the refined disparity."""
    searched = result.preliminary
    low, high = searched.min_disparity, searched.min_disparity + searched.num_disparities
    color = left if left.ndim == 3 else np.repeat(left[..., None], 3, axis=2)
    return np.vstack([
        np.hstack([color, draw_segments(left, result.segments)]),
        np.hstack([color_disparity(values, low, high) for values in (
            searched.values, result.disparity.values)])])


def write_picture(path: Path, picture: Image) -> None:
    """
    Write a picture, as the ending of its name says.

    Raises
    ------
    ValueError
        When it cannot be written.

    """
    if not cv2.imwrite(str(path), picture):
        raise ValueError(f'{path}: cannot be written')


def data_uri(picture: Image) -> str:
    """Encode a picture so that it can stand inside an HTML file."""
    ok, encoded = cv2.imencode('.webp', picture, [cv2.IMWRITE_WEBP_QUALITY, _WEBP_QUALITY])
    if not ok:
        raise RuntimeError('OpenCV cannot write WebP pictures')
    return 'data:image/webp;base64,' + base64.b64encode(encoded.tobytes()).decode('ascii')


def disparity_gradient() -> str:
    """Return the disparity colours as CSS colour stops."""
    return _map_stops(cv2.COLORMAP_VIRIDIS)


def confidence_gradient() -> str:
    """Return the confidence colours as CSS colour stops."""
    return _map_stops(_CONFIDENCE_COLORS)


def error_gradient() -> str:
    """Return the error colours as CSS colour stops."""
    return _css_stops(_ERROR_STOPS)


def _map_stops(color_map: int) -> str:
    ramp = np.linspace(0, 255, 9).astype(np.uint8)[None]
    return _css_stops(cv2.applyColorMap(ramp, color_map)[0])


def _css_stops(colors: NDArray) -> str:
    return ', '.join(f'rgb({r}, {g}, {b})' for b, g, r in colors.tolist())


def _error_colors() -> Image:
    position = np.linspace(0, 255, len(_ERROR_STOPS))
    level = np.arange(256)
    return np.stack([np.interp(level, position, _ERROR_STOPS[:, i]) for i in range(3)],
                    axis=1).astype(np.uint8)


def _plane_groups(segments: PlaneSegmentation) -> NDArray[np.int64]:
    """Give all segments of one plane one number, and each without a plane its own."""
    count = len(segments.planes)
    return np.where(segments.is_fitted, segments.plane_index, count + np.arange(count))


def _boundaries(labels: NDArray) -> NDArray[np.bool_]:
    edge = np.zeros(labels.shape, bool)
    edge[:, 1:] |= labels[:, 1:] != labels[:, :-1]
    edge[1:] |= labels[1:] != labels[:-1]
    return edge
