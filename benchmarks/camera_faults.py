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
What the faults of real cameras cost: share of wrong pixels, one fault at a time.

Maps are filled from the background; beside ours stand OpenCV's three-way semi-global matcher,
and that with a weighted median. Behind each figure is its ratio to that of the clean pair, and
at the end the row offset that the images show, which includes what the pair had before.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from functools import partial
import json
from pathlib import Path
import sys
from typing import Any

from faults_of_cameras import FAULTS, row_offset_of, Views
import numpy as np
from stereo_refine_ros.datasets import list_scenes, load_scene
from stereo_refine_ros.datasets.scene import Scene
from stereo_refine_ros.evaluate import named_value
from stereo_refine_ros.evaluation.progress import Progress
from stereo_refine_ros.evaluation.tables import format_number, markdown_table
from stereo_refine_ros.params import load_preset, PRESETS
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.disparity_errors import bad_percent
from stereo_refine_ros.refinement.filling import fill_from_background
from stereo_refine_ros.rectification import find_row_offset  # noqa: I100
from stereo_refine_ros.refinement.filters import apply_filter
from stereo_refine_ros.types import FloatMap

SGBM, MEDIAN = 'SGBM 3-way', '+ weighted median'
# OpenCV's matcher as it comes: what it is given is neither corrected nor refined.
_PLAIN = {'matching.method': 'sgbm', 'planes.projection': 'off', 'filter.method': 'none',
          'rectification.correct': False}
Row = dict[str, Any]


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, write the rows."""
    args = _parser().parse_args(argv)
    rows: list[Row] = []
    names = args.scenes or list_scenes(args.data)
    with Progress(len(names) * len(args.faults)) as progress:
        for name in names:
            scene = load_scene(name, args.data)
            for fault in args.faults:
                rows += measure(scene, fault, args.presets, args.threshold, dict(args.parameters))
                progress.step(f'{scene.name}: {fault}')
    print(table(rows))
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1) + '\n', encoding='utf-8')
    return 0


def measure(scene: Scene, fault: str, presets: Sequence[str], threshold: float,
            values: dict[str, Any]) -> Iterator[Row]:
    """
    Match one scene with one fault by every method.

    Yields
    ------
    dict
        `scene`, `fault`, `method`, `bad` (percent of known pixels), `row_offset_px` (found in
        the images) and `row_offset_put_in_px`.

    """
    if scene.truth is None or scene.pair.right is None:
        raise ValueError(f'{scene.name}: has no ground truth to compare with')
    views = FAULTS[fault](scene.pair.left, scene.pair.right)
    count = scene.num_disparities or 64
    found = find_row_offset(*views, 0, count)
    for method, compute in methods(views, count, presets, values).items():
        wrong = bad_percent(fill_from_background(compute()), scene.truth, threshold)
        yield {'scene': scene.name, 'fault': fault, 'method': method, 'bad': wrong,
               'row_offset_px': found.largest_px,
               'row_offset_put_in_px': row_offset_of(fault, scene.truth.shape[1])}


def methods(views: Views, num_disparities: int, presets: Sequence[str], values: dict[str, Any]
            ) -> dict[str, Callable[[], FloatMap]]:
    """Return what computes a map of the left view, by name."""
    def refined(preset: str) -> FloatMap:
        params = load_preset(preset, {'matching.num_disparities': num_disparities, **values})
        return StereoRefiner(params).process(*views).disparity.values

    plain = StereoRefiner(load_preset('live', {
        **_PLAIN, 'matching.num_disparities': num_disparities})).process(*views).preliminary.values
    median = load_preset('live', {'filter.method': 'weighted_median'}).filter
    return {SGBM: lambda: plain,
            MEDIAN: lambda: apply_filter(fill_from_background(plain), views[0], median),
            **{preset: partial(refined, preset) for preset in presets}}


def table(rows: Sequence[Row]) -> str:
    """Lay out the mean over the scenes as a Markdown table."""
    names = list(dict.fromkeys(row['method'] for row in rows))
    faults = list(dict.fromkeys(row['fault'] for row in rows))
    lines = []
    for fault in faults:
        cells = []
        for name in names:
            bad, clean = _mean(rows, fault, name), _mean(rows, 'clean', name)
            ratio = format_number(bad / clean if clean else None, 2)
            cells.append(f'{format_number(bad, 1)} ({ratio})')
        of_fault = [row for row in rows if row['fault'] == fault and row['method'] == names[0]]
        cells += [format_number(float(np.median([row[key] for row in of_fault])), 2)
                  for key in ('row_offset_put_in_px', 'row_offset_px')]
        lines.append([fault, *cells])
    return markdown_table(['fault', *names, 'rows put in', 'rows found'], lines)


def _mean(rows: Sequence[Row], fault: str, method: str) -> float:
    found = [row['bad'] for row in rows if (row['fault'], row['method']) == (fault, method)]
    return float(np.mean(found)) if found else float('nan')


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', help='folder of the scenes')
    parser.add_argument('--scenes', type=lambda text: text.split(','), help='names, a,b,c')
    parser.add_argument('--faults', type=_faults, default=list(FAULTS),
                        help=f'names or their beginnings, a,b,c: {", ".join(FAULTS)}')
    parser.add_argument('--presets', type=_presets, default=['live', 'accurate'])
    parser.add_argument('--threshold', type=float, default=1.0,
                        help='wrong is what is off by more, pixels (KITTI: 3)')
    parser.add_argument('-p', dest='parameters', metavar='NAME=VALUE', action='append',
                        type=named_value, default=[], help='a parameter for all presets')
    parser.add_argument('--json', type=Path, help='file to write the rows to')
    return parser


def _faults(text: str) -> list[str]:
    chosen = []
    for part in text.split(','):
        found = [name for name in FAULTS if name.startswith(part.strip())]
        if not found:
            raise argparse.ArgumentTypeError(
                f'no fault begins with {part!r}; there are: {", ".join(FAULTS)}')
        chosen += found
    return chosen


def _presets(text: str) -> list[str]:
    names = text.split(',')
    for name in names:
        if name not in PRESETS:
            raise argparse.ArgumentTypeError(f'{name!r} is none of {", ".join(PRESETS)}')
    return names


if __name__ == '__main__':
    sys.exit(main())
