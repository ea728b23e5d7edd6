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

"""Quality over time, without ground truth: bags and image sequences through the core."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
import csv
from dataclasses import dataclass
import json
import math
from pathlib import Path

import numpy as np

from stereo_refine_ros.datasets import Scene
from stereo_refine_ros.health_advice import advise, Observation
from stereo_refine_ros.params import Params
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import confidence_figures, measure_frame
from stereo_refine_ros.quality.temporal import compare_noise, TemporalNoise
from stereo_refine_ros.types import RefinementResult, StereoPair

FrameRow = dict[str, float]
Show = Callable[[int, StereoPair, RefinementResult], None]


@dataclass(frozen=True, eq=False)
class Frame:
    """One pair of a video; `time` in seconds from its first, or the frame's number."""

    time: float
    pair: StereoPair


def measure_video(frames: Iterable[Frame], params: Params,
                  show: Show | None = None) -> Iterator[FrameRow]:
    """
    Refine every frame and measure it.

    Parameters
    ----------
    frames : iterable of Frame
        In order of time.
    params : Params
        For all of them.
    show : callable of number, StereoPair and RefinementResult, optional
        Given every frame, to draw it.

    Yields
    ------
    dict of str to float
        'time', the figures of `measure_frame` and `confidence_figures`, and the temporal noise
        since the frame before: 'temporal_noise_preliminary' and 'temporal_noise_refined' in
        pixels, both over the same pixels (image unchanged, both maps valid in both frames), and
        their share 'unchanged_ratio'. These are NaN for the first frame and after a change of
        size.

    """
    refiner = StereoRefiner(params)
    previous: tuple[StereoPair, RefinementResult] | None = None
    for number, frame in enumerate(frames):
        result = refiner.process(frame.pair.left, frame.pair.right)
        if show is not None:
            show(number, frame.pair, result)
        row = {'time': frame.time, **measure_frame(result, frame.pair),
               **confidence_figures(result, params.output.min_confidence)}
        row.update(_flicker(previous, (frame.pair, result)))
        yield row
        previous = frame.pair, result


class CameraAdvice:
    """Collect over a video what its images say of the cameras."""

    def __init__(self, params: Params) -> None:
        """Start without frames."""
        self._corrected = params.rectification.correct
        self._texts: dict[str, str] = {}
        self._seen: Counter[str] = Counter()
        self._frames = 0

    def add(self, result: RefinementResult) -> None:
        """Judge a frame as the node does."""
        self._frames += 1
        for item in advise(Observation(result.health, result.lr_consistent_ratio,
                                       rows_are_corrected=self._corrected)):
            self._texts[item.key] = item.text
            self._seen[item.key] += 1

    def lines(self) -> list[str]:
        """Return what holds for half of the frames or more, the most frequent first."""
        return [f'cameras: {self._texts[key]} ({count} of {self._frames} pairs)'
                for key, count in self._seen.most_common() if 2 * count >= self._frames]


def bag_frames(path: Path, params: Params, topics: Sequence[str] = (),
               on_damaged: Callable[[str], None] = lambda text: None) -> Iterator[Frame]:
    """
    Yield the pairs of a bag, paired and rectified as the parameters say; needs `rosbags`.

    Parameters
    ----------
    path : Path
        The bag.
    params : Params
        For `sync` and `inputs.rectify`.
    topics : sequence of str
        Of the left and the right images; what ends in `left|right/image_rect` by default.
    on_damaged : callable of str
        Told of every message that cannot be used and is left out.

    """
    if len(topics) not in (0, 2):
        raise ValueError(f'bag: expected the topics of left and right, got {", ".join(topics)}')
    try:  # only bags need it
        from stereo_refine_ros.datasets.rosbag import BagOptions, iterate_pairs
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f'bag: {error}; pip install rosbags') from error

    left, right = topics or ('', '')
    options = BagOptions(
        left, right, slop_s=params.sync.slop if params.sync.approximate else 0.0,
        queue_size=params.sync.queue_size, rectify=params.inputs.rectify)
    start: int | None = None
    for item in iterate_pairs(path, options, on_damaged):
        start = item.stamp_ns if start is None else start
        yield Frame((item.stamp_ns - start) * 1e-9, item.pair)


def sequence_frames(scenes: Iterable[Scene]) -> Iterator[Frame]:
    """Yield the pairs of a folder, or of two patterns, in their order."""
    for number, scene in enumerate(scenes):
        yield Frame(float(number), scene.pair)


def suggested_disparities(folder: Path) -> int | None:
    """Read the search range that a sequence's `meta.json` suggests, if it does."""
    meta = folder / 'meta.json'
    if not meta.is_file():
        return None
    return json.loads(meta.read_text(encoding='utf-8')).get('suggested_ndisp')


def write_csv(path: Path, rows: Sequence[FrameRow]) -> None:
    """Write one line a frame; what could not be measured is an empty cell."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open('w', newline='', encoding='utf-8') as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        for row in rows:
            writer.writerow({name: f'{value:.6g}' if math.isfinite(value) else ''
                             for name, value in row.items()})


def average(rows: Sequence[FrameRow]) -> FrameRow:
    """Average every figure over the frames where it could be measured."""
    means = {}
    for name in rows[0]:
        known = [row[name] for row in rows if math.isfinite(row[name])]
        means[name] = float(np.mean(known)) if known else math.nan
    return means


def _flicker(previous: tuple[StereoPair, RefinementResult] | None,
             current: tuple[StereoPair, RefinementResult]) -> FrameRow:
    noise = TemporalNoise(math.nan, math.nan, math.nan)
    if previous is not None and previous[0].left.shape == current[0].left.shape:
        (old_pair, old), (pair, new) = previous, current
        noise = compare_noise(
            (old_pair.left, pair.left), (old.preliminary.values, new.preliminary.values),
            (old.disparity.values, new.disparity.values))
    return {'temporal_noise_preliminary': noise.preliminary,
            'temporal_noise_refined': noise.refined, 'unchanged_ratio': noise.unchanged_ratio}
