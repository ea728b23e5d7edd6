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

"""The figures of one map on one field scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
import math
from typing import Any, Protocol

from field_scenes import FieldScene, fill_along_rows, THRESHOLDS
import numpy as np
from stereo_refine_ros.quality.confidence import ConfidenceQuality, measure_confidence
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.types import DisparityMap, FloatMap

BAD = (1.0, 2.0, 3.0)  # px
REGIONS = ('all', 'nonocc')
PEER = 'peer'  # stands for the preset where the method is not ours
CONFIDENCE = tuple(item.name for item in fields(ConfidenceQuality))
Figures = dict[str, float]


class Refined(Protocol):
    """What a refinement is measured by; the package's result is one."""

    preliminary: DisparityMap
    disparity: DisparityMap
    confidence: FloatMap
    total_ms: float


@dataclass(frozen=True)
class FieldRow:
    """
    One map, refined by one preset, on one scene.

    Attributes
    ----------
    group, scene, map, preset : str
    figures : dict of str to float
        'given_bad_1_all' and so on for given and after, 1, 2, 3 px, all and nonocc, in percent;
        'given_density', 'after_density'; 'ms'; the fields of `ConfidenceQuality` at 1 px. NaN
        where there is no mask or no confidence.

    """

    group: str
    scene: str
    map: str  # noqa: A003
    preset: str
    figures: Figures

    @property
    def threshold(self) -> float:
        """Pixels; what the set counts as wrong."""
        return THRESHOLDS[self.group]

    def bad(self, stage: str, region: str = 'all') -> float:
        """Percent of wrong pixels at the set's own threshold."""
        return self.figures[bad_key(stage, self.threshold, region)]

    @property
    def harm(self) -> float:
        """Points by which the refinement made the map worse; negative where it mended."""
        return self.bad('after') - self.bad('given')


def bad_key(stage: str, threshold: float, region: str) -> str:
    """Name a share of wrong pixels."""
    return f'{stage}_bad_{threshold:.0f}_{region}'


def measure_row(scene: FieldScene, name: str, preset: str, result: Refined) -> FieldRow:
    """Measure what was given and what became of it, and the confidence of that."""
    figures: Figures = {}
    for stage, values in (('given', result.preliminary.values),
                          ('after', result.disparity.values)):
        filled = fill_along_rows(values)
        for region in REGIONS:
            mask = scene.masks.get(region)
            for threshold in BAD:
                figures[bad_key(stage, threshold, region)] = math.nan if mask is None else (
                    bad_percent(filled, scene.truth, threshold, mask))
        figures[f'{stage}_density'] = float(np.mean(np.isfinite(values)))
    figures['ms'] = result.total_ms
    figures.update(_confidence(scene, result))
    return FieldRow(scene.group, scene.name, name, preset, figures)


def _confidence(scene: FieldScene, result: Refined) -> Figures:
    if result.confidence.shape != scene.truth.shape:  # a method that has none
        return dict.fromkeys(CONFIDENCE, math.nan)
    return asdict(measure_confidence(
        result.confidence, result.disparity.values, scene.truth, 1.0, scene.masks['all']))


def as_json(rows: Sequence[FieldRow]) -> list[dict[str, Any]]:
    """Make rows strict JSON; what could not be measured becomes null."""
    return [{'set': row.group, 'scene': row.scene, 'map': row.map, 'preset': row.preset,
             **{name: value if math.isfinite(value) else None
                for name, value in row.figures.items()}} for row in rows]
