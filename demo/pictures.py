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

"""The pictures of the demo: one file each, and all of them on one sheet."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np

from stereo_refine_ros.datasets.scene import Scene
from demo.table import format_value, MEASURES  # noqa: I100
from stereo_refine_ros.evaluation.pictures import (
    color_confidence, color_disparity, color_error, draw_segments, ERROR_LIMIT)
from stereo_refine_ros.types import FloatMap, Image, LabelMap, PlaneSegmentation

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_INK, _PAPER, _MUTED = (30, 30, 30), (255, 255, 255), (110, 110, 110)
_LABEL_HEIGHT, _GAP = 34, 8
_SHEET_COLUMNS = 3
_BAR_STEP, _ROW_STEP = 34, 16
_SMALLEST_TILE = 440


def write_pictures(folder: Path, scene: Scene, preliminary: FloatMap, refined: FloatMap,
                   labels: LabelMap, confidence: FloatMap,
                   metrics: Mapping[str, float]) -> list[Path]:
    """
    Write every picture and the sheet into `folder`; return the files.

    Parameters
    ----------
    folder : Path
        Must exist.
    scene : Scene
        Views and, where known, ground truth.
    preliminary, refined : float32 ndarray of shape (H, W)
        Differences of image columns in pixels, NaN invalid.
    labels : int32 ndarray of shape (H, W)
        Segments.
    confidence : float32 ndarray of shape (H, W)
        Of the refined map, 0..1.
    metrics : mapping of str to float
        Of the same frame, for the figures on the sheet.

    """
    low, high = _range(scene, refined)
    share = f'{100 * np.mean(np.isfinite(refined)):.0f} %'
    tiles = {'left': ('left view', _bgr(scene.pair.left)),
             'preliminary': ('preliminary disparity', color_disparity(preliminary, low, high)),
             'refined': (f'refined, as published ({share})', color_disparity(refined, low, high))}
    if scene.truth is not None:
        tiles['ground_truth'] = ('ground truth', color_disparity(scene.truth, low, high))
        for name, values in (('preliminary', preliminary), ('refined', refined)):
            tiles[f'error_{name}'] = (f'error of {name}', color_error(values, scene.truth))
    tiles['segments'] = ('segments', _segments(scene.pair.left, labels))
    tiles['confidence'] = ('confidence of refined', color_confidence(confidence))
    files = []
    for name, (_, picture) in tiles.items():
        files.append(_write(folder / f'{name}.png', picture))
    panel = _legend(tiles['left'][1].shape, low, high, metrics)
    sheet = _sheet([*tiles.values(), (f'{scene.name}: colours and figures', panel)])
    return [*files, _write(folder / 'side_by_side.png', sheet)]


def _range(scene: Scene, refined: FloatMap) -> tuple[float, float]:
    """Return the disparities that the colours span, the same for every map."""
    reference = scene.truth if scene.truth is not None else refined
    known = reference[np.isfinite(reference)]
    if known.size == 0:
        return 0.0, 1.0
    return float(np.percentile(known, 0.5)), float(np.percentile(known, 99.5))


def _segments(left: Image, labels: LabelMap) -> Image:
    """Tint every segment; the labels alone do not say which of them share a plane."""
    count = int(labels.max()) + 1
    own = np.zeros((count, 3))
    own[:, 2] = np.arange(count)
    return draw_segments(left, PlaneSegmentation(
        labels, own, np.ones(count, bool), np.ones(count, np.float32)))


def _sheet(tiles: list[tuple[str, Image]]) -> Image:
    """Lay labelled tiles out in rows, enlarged to a width at which their labels are readable."""
    height, width = tiles[0][1].shape[:2]
    scale = max(1.0, _SMALLEST_TILE / width)
    size = (round(width * scale), round(height * scale))
    cells = [_cell(label, picture, size) for label, picture in tiles]
    blank = np.full_like(cells[0], 255)
    cells += [blank] * (-len(cells) % _SHEET_COLUMNS)
    rows = [np.hstack(cells[start:start + _SHEET_COLUMNS])
            for start in range(0, len(cells), _SHEET_COLUMNS)]
    return np.asarray(cv2.copyMakeBorder(
        np.vstack(rows), _GAP, 0, _GAP, 0, cv2.BORDER_CONSTANT, value=_PAPER), np.uint8)


def _cell(label: str, picture: Image, size: tuple[int, int]) -> Image:
    cell = np.full((size[1] + _LABEL_HEIGHT + _GAP, size[0] + _GAP, 3), 255, np.uint8)
    if picture.shape[1] != size[0]:
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST))
    cell[_LABEL_HEIGHT:_LABEL_HEIGHT + size[1], :size[0]] = picture
    _text(cell, label, (2, _LABEL_HEIGHT - 11), 0.68, _INK)
    return cell


def _legend(shape: tuple[int, ...], low: float, high: float,
            metrics: Mapping[str, float]) -> Image:
    """Draw the colour bars and the measures before and after."""
    scale = max(1.0, _SMALLEST_TILE / shape[1])
    height, width = round(shape[0] * scale), round(shape[1] * scale)
    panel = np.full((height, width, 3), 250, np.uint8)
    ramp = np.linspace(0.0, 1.0, width - 24, dtype=np.float32)[None, :].repeat(14, axis=0)
    bars = (('disparity', color_disparity(low + ramp * (high - low), low, high),
             f'{low:.0f} px', f'{high:.0f} px', 'black: none'),
            ('error', color_error(ramp * ERROR_LIMIT, np.zeros_like(ramp)), '0',
             f'{ERROR_LIMIT:.0f} px and more', 'grey: unknown'),
            ('confidence', color_confidence(ramp), '0', '1', 'of being within 1 px'))
    top = 24
    for name, bar, first, last, note in bars:
        _text(panel, f'{name}: {first} to {last} ({note})', (12, top), 0.48, _INK)
        panel[top + 7:top + 21, 12:width - 12] = bar
        top += _BAR_STEP
    _measures(panel, top + 4, metrics)
    return panel


def _measures(panel: Image, top: int, metrics: Mapping[str, float]) -> None:
    columns = (12, round(panel.shape[1] * 0.52), round(panel.shape[1] * 0.78))
    for x, heading in zip(columns[1:], ('preliminary', 'refined'), strict=True):
        _text(panel, heading, (x, top), 0.46, _MUTED)
    for name, label, unit, _ in MEASURES:
        before, after = metrics.get(f'{name}_preliminary'), metrics.get(f'{name}_refined')
        if before is None or after is None:
            continue
        top += _ROW_STEP
        texts = (f'{label} {f"({unit})" if unit else ""}', format_value(before),
                 format_value(after))
        for x, text in zip(columns, texts, strict=True):
            _text(panel, text, (x, top), 0.46, _INK)
    for text in _footnotes(metrics):
        top += _ROW_STEP
        _text(panel, text, (12, top), 0.46, _MUTED)


def _footnotes(metrics: Mapping[str, float]) -> Iterator[str]:
    def shown(name: str) -> str:
        return format_value(metrics.get(name))
    yield (f'right view: rows {shown("row_offset_px")} px off, {shown("gain_ratio")} times as '
           'bright')
    yield (f'mean confidence {shown("confidence_mean")}; {shown("published_ratio")} of the '
           'pixels published')
    yield (f'{shown("total_ms")} ms a frame, {shown("segments")} segments, '
           f'{shown("planes_fitted")} planes')


def _text(picture: Image, text: str, at: tuple[int, int], scale: float,
          color: tuple[int, int, int]) -> None:
    cv2.putText(picture, text, at, _FONT, scale, color, 1, cv2.LINE_AA)


def _bgr(image: Image) -> Image:
    return image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)


def _write(path: Path, picture: Image) -> Path:
    if not cv2.imwrite(str(path), picture):
        raise OSError(f'cannot write {path}')
    return path
