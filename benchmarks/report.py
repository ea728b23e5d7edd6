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

"""Tables and the plot of the speed benchmark."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from timing import quartiles

# Apart for colour-blind readers too.
COLORS = {'ours': '#0072b2', 'OpenCV': '#d55e00'}
OPENCV = ('SGBM', 'graph')
STAGES = ('matching', 'segmentation', 'planes', 'filter')
GRAPH = 'graph segmentation'


def _markdown(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    lines = [head, ['---'] * len(head), *body]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines) + '\n'


def method_table(rows: Sequence[Any]) -> str:
    """Write time, spread, ratio and error of every method on every pair."""
    return _markdown(
        ('size', 'scene', 'method', 'median ms', 'quartiles ms', 'x SGBM 3-way', 'wrong %'),
        ((row.size, row.scene, row.method, f'{row.ms[1]:.1f}',
          f'{row.ms[0]:.1f} - {row.ms[2]:.1f}', f'{row.ratio:.2f}',
          '-' if row.bad is None else f'{row.bad:.2f}') for row in rows))


def stage_table(rows: Sequence[Any]) -> str:
    """
    Write median and quartiles of every stage.

    Refinement is segmentation + planes + filter; it is compared with SGBM 3-way, segmentation
    with opencv-contrib's graph segmentation, both as multiples of SGBM 3-way of their process.
    """
    return _markdown(
        ('size', 'scene', 'method', *(f'{stage} ms' for stage in STAGES),
         'refinement x SGBM 3-way', 'segmentation x graph segmentation'),
        ((row.size, row.scene, row.method, *(_spread(row.stages[stage]) for stage in STAGES),
          *_stage_ratios(row, rows)) for row in rows if row.stages))


def _spread(values: list[float]) -> str:
    low, middle, high = quartiles(values)
    return f'{middle:.1f} ({low:.1f} - {high:.1f})'


def _stage_ratios(row: Any, rows: Sequence[Any]) -> tuple[str, str]:
    medians = {stage: quartiles(values)[1] for stage, values in row.stages.items()}
    base_ms = row.ms[1] / row.ratio
    refinement = medians['segmentation'] + medians['planes'] + medians['filter']
    graph = [other.ratio for other in rows
             if (other.size, other.scene, other.method) == (row.size, row.scene, GRAPH)]
    return (f'{refinement / base_ms:.2f}',
            f'{medians["segmentation"] / base_ms / graph[0]:.3f}' if graph else '-')


def growth_table(rows: Sequence[Any]) -> str:
    """Write how the time grows with pixels and with disparities."""
    return _markdown(
        ('size', 'method', 'median ms', 'quartiles ms', 'ns a pixel', 'ns a pixel and disparity'),
        ((row.size, row.method, f'{row.ms[1]:.1f}', f'{row.ms[0]:.1f} - {row.ms[2]:.1f}',
          *_per_pixel(row)) for row in rows))


def _per_pixel(row: Any) -> tuple[str, str]:
    width, height, disparities = map(int, row.size.split('x'))
    pixel_ns = row.ms[1] * 1e6 / (width * height)
    return f'{pixel_ns:.0f}', f'{pixel_ns / disparities:.2f}'


def plot(rows: Sequence[Any], path: Path) -> None:
    """Draw time against error, one panel a size; the mean over its scenes."""
    sizes = list(dict.fromkeys(row.size for row in rows))
    figure = Figure(figsize=(5.2 * len(sizes), 4.2), layout='constrained')
    axes = figure.subplots(1, len(sizes), squeeze=False)
    for axis, size in zip(axes[0], sizes, strict=True):
        _panel(axis, [row for row in rows if row.size == size and row.bad is not None])
        axis.set_title(size)
    axes[0][0].set_ylabel('wrong by more than 1 px (KITTI 3), mean %')
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={'Date': None} if path.suffix == '.svg' else None)


def _panel(axis: Any, rows: Sequence[Any]) -> None:
    for method in dict.fromkeys(row.method for row in rows):
        same = [row for row in rows if row.method == method]
        x = sum(row.ms[1] for row in same) / len(same)
        y = sum(row.bad for row in same) / len(same)
        kind = 'OpenCV' if method.startswith(OPENCV) else 'ours'
        axis.plot(x, y, 'o' if kind == 'ours' else 's', color=COLORS[kind])
        axis.annotate(method, (x, y), xytext=(4, 4), textcoords='offset points', fontsize=8)
    axis.set_xscale('log')
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter('{x:g}')
    axis.xaxis.set_minor_formatter('')
    axis.set_xlabel('ms a frame')
    axis.grid(alpha=0.3)
    axis.margins(x=0.45, y=0.1)
