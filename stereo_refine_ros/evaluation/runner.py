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

"""Run the pipeline over scenes, matchers, filters and projections, and measure every stage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
import math
from statistics import median
from typing import Any

import numpy as np

from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.params import load_preset, Params
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.confidence import ConfidenceQuality, measure_confidence
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.quality.image_metrics import default_scale
from stereo_refine_ros.quality.summary import measure_against_truth
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.types import FloatMap, RefinementResult

Row = dict[str, Any]

STAGES = ('preliminary', 'before', 'after')
REGIONS = ('nonocc', 'all', 'disc')
CONFIDENCE = tuple(item.name for item in fields(ConfidenceQuality))
_STAGES_OF_NORMAL_FLOW = ('matching', 'filter')


@dataclass(frozen=True)
class Combination:
    """One cell of the paper's tables: which matcher, which filter, which projection."""

    matching: str
    filter: str  # noqa: A003
    projection: str

    def __str__(self) -> str:
        """Name the combination for people."""
        return f'{self.matching} + {self.filter}, {self.projection}'


@dataclass(frozen=True)
class Plan:
    """
    What to evaluate.

    Attributes
    ----------
    preset : str
    overrides : dict of str to value
        Parameters by dotted name, on top of the preset.
    matchings, filters, projections : sequence of str
        Every combination of the three runs.
    repeat : int
        Runs of each; the stage times are medians over them.

    """

    preset: str = 'live'
    overrides: dict[str, Any] = field(default_factory=dict)
    matchings: Sequence[str] = ()
    filters: Sequence[str] = ()
    projections: Sequence[str] = ()
    repeat: int = 3

    def __post_init__(self) -> None:
        """Fill empty choices from the preset and refuse wrong ones before anything runs."""
        params = load_preset(self.preset, self.overrides)
        own = {'matchings': params.matching.method, 'filters': params.filter.method,
               'projections': params.planes.projection}
        for name, value in own.items():
            object.__setattr__(self, name, tuple(getattr(self, name)) or (value,))
        for combination in self.combinations():
            self.params(combination, None)
        if 'external' in self.matchings:
            raise ValueError('matching.method: external has no matcher to evaluate')

    def combinations(self) -> list[Combination]:
        """List what runs on every scene, projection fastest."""
        return [Combination(matching, filter_method, projection)
                for matching in self.matchings for filter_method in self.filters
                for projection in self.projections]

    def params(self, combination: Combination, num_disparities: int | None) -> Params:
        """Build the parameters of one run; the scene's search range yields to an override."""
        values = dict(self.overrides)
        if num_disparities is not None:
            values.setdefault('matching.num_disparities', num_disparities)
        values.update({'matching.method': combination.matching,
                       'filter.method': combination.filter,
                       'planes.projection': combination.projection})
        return load_preset(self.preset, values)


@dataclass(frozen=True, eq=False)
class Outcome:
    """One combination on one scene: the paper's normal flow, its new framework, their rows."""

    scene: Scene
    combination: Combination
    before: RefinementResult
    after: RefinementResult
    rows: list[Row]


def evaluate_scene(scene: Scene, plan: Plan) -> Iterator[Outcome]:
    """
    Run every combination of `plan` on `scene`.

    Raises
    ------
    ValueError
        When the scene has no ground truth.

    """
    if scene.truth is None:
        raise ValueError(f'scene {scene.name}: no ground truth')
    normal_flow: dict[tuple[str, str], tuple[RefinementResult, dict[str, float]]] = {}
    for combination in plan.combinations():
        params = plan.params(combination, scene.num_disparities)
        key = combination.matching, combination.filter
        if key not in normal_flow:
            without_planes = params.updated({'planes.projection': 'off'})
            normal_flow[key] = _run(scene, without_planes, plan.repeat)
        before, before_ms = normal_flow[key]
        after, after_ms = _run(scene, params, plan.repeat)
        times = {'preliminary': {'matching': before_ms['matching']},
                 'before': {name: before_ms[name] for name in _STAGES_OF_NORMAL_FLOW},
                 'after': after_ms}
        maps = {'preliminary': before.preliminary.values, 'before': before.disparity.values,
                'after': after.disparity.values}
        confidence = {'preliminary': None, 'before': before.confidence, 'after': after.confidence}
        rows = [{**_row(scene, combination, stage, maps[stage], times[stage]),
                 **judge_confidence(confidence[stage], maps[stage], scene)} for stage in STAGES]
        yield Outcome(scene, combination, before, after, rows)


def scene_scale(scene: Scene) -> float:
    """
    Choose the grey levels per pixel of the 8-bit maps.

    The data set's own scale; where its truth is in plain pixels (scale 1), the largest whole
    number that keeps the search range within 8 bits.
    """
    if scene.scale > 1 or scene.num_disparities is None:
        return float(scene.scale)
    return default_scale(scene.num_disparities)


def measure_stage(values: FloatMap, scene: Scene) -> dict[str, float | None]:
    """
    Measure one map against the truth of its scene, its holes filled from the background first.

    Returns
    -------
    dict
        The figures of `measure_against_truth`, and 'nonocc', 'all', 'disc': bad-1.0 percent in
        the evaluation regions, None where the scene has no such mask.

    """
    assert scene.truth is not None
    figures: dict[str, float | None] = {
        **measure_against_truth(values, scene.truth, scene_scale(scene))}
    filled = fill_from_background(values)
    for region in REGIONS:
        mask = scene.masks.get(region)
        figures[region] = (
            None if mask is None else bad_percent(filled, scene.truth, 1.0, mask))
    return figures


def judge_confidence(confidence: FloatMap | None, values: FloatMap, scene: Scene
                     ) -> dict[str, float | None]:
    """
    Measure the confidence of a map at 1 px, over the region `all` of its scene.

    Returns
    -------
    dict
        The fields of `ConfidenceQuality`; None where there is no confidence of this map.

    """
    if confidence is None or confidence.shape != values.shape:
        return dict.fromkeys(CONFIDENCE)
    assert scene.truth is not None
    return asdict(measure_confidence(
        confidence, values, scene.truth, 1.0, scene.masks.get('all')))


def _run(scene: Scene, params: Params, repeat: int
         ) -> tuple[RefinementResult, dict[str, float]]:
    refiner = StereoRefiner(params)
    results = [refiner.process(scene.pair.left, scene.pair.right) for _ in range(repeat)]
    stage_ms = {name: median(result.stage_ms[name] for result in results)
                for name in results[0].stage_ms}
    return results[0], stage_ms


def _row(scene: Scene, combination: Combination, stage: str, values: FloatMap,
         stage_ms: dict[str, float]) -> Row:
    return {'scene': scene.name, 'matching': combination.matching,
            'filter': combination.filter, 'projection': combination.projection,
            'stage': stage, **measure_stage(values, scene),
            'ms': {name: round(time, 3) for name, time in stage_ms.items()}}


def as_json(rows: Sequence[Row]) -> list[Row]:
    """Make rows strict JSON: NaN and the infinite PSNR of a perfect map become null."""
    return [{key: _finite(value) for key, value in row.items()} for row in rows]


def _finite(value: Any) -> Any:
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
