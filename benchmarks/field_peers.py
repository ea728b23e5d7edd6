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

"""What others make of the same field scenes: OpenCV's matcher, and filters on its map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
import time

from contrib import run_contrib
from field_scenes import FieldScene, fill_along_rows
import numpy as np
from opencv_methods import match_padded, WLS_CONFIDENCE
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.refinement.filters import apply_filter
from stereo_refine_ros.types import DisparityMap, FloatMap

SGBM_MEDIAN = 'SGBM 3-way + weighted median'
# As OpenCV's own weighted median has them (radius 7, sigma 25.5): better here than the presets'.
MEDIAN = {'filter.method': 'weighted_median', 'filter.radius': 7, 'filter.sigma_color': 25.5}
CONTRIB = ('SGBM 3-way + WLS', 'SGBM 3-way + weighted median')


@dataclass(frozen=True, eq=False)
class Peer:
    """A map and what somebody else's filter made of it; `confidence` is (0, 0) without one."""

    preliminary: DisparityMap
    disparity: DisparityMap
    total_ms: float
    confidence: FloatMap = field(default_factory=lambda: np.zeros((0, 0), np.float32))


def peer_maps(scene: FieldScene, threads: int | None, contrib_python: str | None
              ) -> Iterator[tuple[str, Peer]]:
    """Yield name and maps of every peer: the package's SGBM 3-way and weighted median first."""
    params = load_preset('live', {
        'matching.method': 'sgbm', 'matching.num_disparities': scene.num_disparities,
        'planes.projection': 'off', **MEDIAN})
    result = StereoRefiner(params).process(scene.left, scene.right, threads=threads)
    given = fill_along_rows(result.preliminary.values)
    begin = time.perf_counter()
    filtered = apply_filter(given, scene.left, params.filter, threads or 1)
    filter_ms = (time.perf_counter() - begin) * 1e3
    yield SGBM_MEDIAN, Peer(result.preliminary, _map(filtered, scene),
                            result.stage_ms['matching'] + filter_ms)
    if contrib_python:
        yield from _contrib(scene, contrib_python)


def _contrib(scene: FieldScene, python: str) -> Iterator[tuple[str, Peer]]:
    views = scene.left, scene.right
    given = _map(match_padded(views, scene.num_disparities), scene)
    times, maps = run_contrib(python, views, scene.num_disparities, rounds=1, budget_s=0)
    for name in CONTRIB:
        confidence = ({'confidence': maps[WLS_CONFIDENCE]} if name.endswith('WLS') else {})
        yield f"{name}, OpenCV's", Peer(given, _map(maps[name], scene), times[name][-1],
                                        **confidence)


def _map(values: FloatMap, scene: FieldScene) -> DisparityMap:
    return DisparityMap(values, 0, scene.num_disparities)
