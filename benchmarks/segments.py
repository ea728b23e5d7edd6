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
How well segments fit the truth: is each one plane, and large enough to be found by matches.

`python -m benchmarks.segments --data ../shared/field/eth3d [--half] [-p segmentation.k=150]`
prints a row for every version of the scenes (grey, dark, haze, noise). No matcher takes part.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
import yaml

from stereo_refine_ros.datasets.middlebury import list_scenes, load_scene  # noqa: I100
from stereo_refine_ros.params import load_preset, PlaneParams, SegmentationParams
from stereo_refine_ros.refinement.planes import fit_planes
from stereo_refine_ros.refinement.tuning import MIN_DATA
from stereo_refine_ros.graph.segment_graph import group_pixels, PixelLists  # noqa: I100
from stereo_refine_ros.graph.segmentation import segment_image
from stereo_refine_ros.types import FloatMap, Image, LabelMap

_PLANES = PlaneParams(iterations=60, inlier_threshold=1.0)
# What a matcher makes of the truth: unmatched, matched anywhere, and noise in pixels.
_MISSING, _OUTLIERS, _NOISE_PX = 0.25, 0.15, 0.4
_SMALL_PX = 100


def main() -> None:
    """Print the table of one folder of scenes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--data', type=Path)
    parser.add_argument('--half', action='store_true', help='segment the halved image')
    parser.add_argument('--preset', default='live')
    parser.add_argument('-p', action='append', default=[], metavar='NAME=VALUE')
    options = parser.parse_args()
    values = dict(item.split('=', 1) for item in options.p)
    params = load_preset(options.preset, {
        name: yaml.safe_load(value) for name, value in values.items()}).segmentation
    print('| version | segments | off the plane % | in small segments % | off, from matches % |')
    print('|---|---|---|---|---|')
    for version, change in VERSIONS.items():
        rows = [measure(change, name, options.data, options.half, params)
                for name in list_scenes(options.data)]
        count, under, small, noisy = np.mean(rows, axis=0)
        print(f'| {version} | {count:.0f} | {under:.2f} | {small:.1f} | {noisy:.2f} |', flush=True)


def measure(change: Callable[[Image], Image], name: str, data: Path | None, half: bool,
            params: SegmentationParams) -> tuple[int, float, float, float]:
    """
    Segment a version of a scene and try its segments on the truth.

    Returns
    -------
    tuple
        Number of segments; share of known pixels more than 1 px off the plane that fits their
        segment's truth best; share of pixels in small segments; share of known pixels off the
        plane of truth as a matcher would find it, or without one. Shares in percent.

    """
    scene = load_scene(name, data)
    assert scene.truth is not None
    image, truth = change(scene.pair.left), scene.truth
    if half:
        height, width = (size // 2 for size in truth.shape)
        image = cv2.resize(image[:2 * height, :2 * width], (width, height),
                           interpolation=cv2.INTER_AREA)
        truth = np.ascontiguousarray(truth[:2 * height:2, :2 * width:2])
        params = replace(params, min_size=params.min_size // 2)
    labels, count = segment_image(image, params)
    lists, known = group_pixels(labels, count), np.isfinite(truth)
    size = np.diff(lists.starts)[labels]
    return (count, 100 * float(_off(lists, labels, truth, truth, 3)[known].mean()),
            100 * float((size < _SMALL_PX).mean()),
            100 * float(_off(lists, labels, _matched(truth), truth,
                             MIN_DATA * float(known.mean()))[known].mean()))


def _off(lists: PixelLists, labels: LabelMap, data: FloatMap, truth: FloatMap,
         fewest: float) -> NDArray[np.bool_]:
    """Tell which pixels are off their segment's plane; none is known from too few data."""
    fits = fit_planes(lists, data, _PLANES)
    y, x = np.indices(truth.shape)
    a, b, c = fits.planes[labels, :3].transpose(2, 0, 1)
    return np.asarray(~(np.abs(a * x + b * y + c - truth) <= 1)
                      | (fits.data_count < fewest)[labels])


def _matched(truth: FloatMap) -> FloatMap:
    rng = np.random.default_rng(0)
    found = truth + rng.normal(0, _NOISE_PX, truth.shape)
    wrong = rng.random(truth.shape) < _OUTLIERS
    found[wrong] = rng.uniform(np.nanmin(truth), np.nanmax(truth), np.count_nonzero(wrong))
    found[(rng.random(truth.shape) < _MISSING) | np.isnan(truth)] = np.nan
    return found.astype(np.float32)


def _levels(values: NDArray[np.floating[Any]]) -> Image:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _noisy(image: Image, sigma: float) -> Image:
    return _levels(image + np.random.default_rng(5).normal(0, sigma, image.shape))


VERSIONS: dict[str, Callable[[Image], Image]] = {
    'as it is': lambda image: image,
    'grey': lambda image: np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8),
    'dark, x 0.3': lambda image: _levels(image * 0.3),
    'haze, x 0.5 + 100': lambda image: _levels(image * 0.5 + 100),
    'noise of 5': lambda image: _noisy(image, 5),
    'noise of 10': lambda image: _noisy(image, 10),
}


if __name__ == '__main__':
    main()
