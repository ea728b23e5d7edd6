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

"""The live table of the metrics: redrawn on a terminal, a line a second elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
import math
import sys
import time
from types import TracebackType
from typing import Any

# Measure, label, unit, and whether less is better.
MEASURES = (
    ('bad_1_0', 'wrong by more than 1 px', '%', True), ('bad_2_0', 'by more than 2 px', '%', True),
    ('avg_error', 'average error', 'px', True), ('mse', 'MSE of the 8-bit map', '', True),
    ('psnr', 'PSNR', 'dB', False), ('ssim', 'SSIM', '', False),
    ('photometric_psnr', 'photometric PSNR', 'dB', False),
    ('photometric_ssim', 'photometric SSIM', '', False),
    ('valid_ratio', 'share of valid pixels', '', False))
TIMES = ('matching_ms', 'segmentation_ms', 'planes_ms', 'filter_ms', 'total_ms',
         'frame_latency_ms')
COUNTS = ('fps', 'frames_dropped', 'pairs_unmatched', 'segments', 'planes_fitted',
          'inlier_ratio')
HEALTH = ('row_offset_px', 'gain_ratio', 'noise_sigma', 'confidence_mean', 'published_ratio')
_LINE_PERIOD_S = 1.0


def format_value(value: float | None) -> str:
    """Write a metric with four digits, `-` where it is unknown."""
    if value is None or math.isnan(value):
        return '-'
    return f'{value:.4g}'


def summary_line(metrics: Mapping[str, float]) -> str:
    """Return the metrics in one line, for logs."""
    changes = ', '.join(
        f'{name} {format_value(metrics.get(name + "_preliminary"))} -> '
        f'{format_value(metrics.get(name + "_refined"))}'
        for name in ('bad_1_0', 'psnr', 'photometric_psnr', 'valid_ratio'))
    speed = ', '.join(f'{name} {format_value(metrics.get(name))}'
                      for name in ('total_ms', 'frame_latency_ms', 'fps'))
    return f'{changes}, {speed}, {health_line(metrics)}'


def health_line(metrics: Mapping[str, float]) -> str:
    """Return what is known of the cameras and of the confidence in one line."""
    return ', '.join(f'{name} {format_value(metrics.get(name))}' for name in HEALTH)


class LiveTable:
    """
    Show metrics as they come, until the context ends.

    Parameters
    ----------
    title : str
        Above the table.

    """

    def __init__(self, title: str) -> None:
        """Draw nothing yet."""
        self._title = title
        self._live: Any = None
        self._next_line = 0.0

    def update(self, metrics: Mapping[str, float], frames: int, advice: str = '') -> None:
        """Show the newest metrics, the number of frames so far, and what to do."""
        if self._live is not None:
            self._live.update(_table(self._title, metrics, frames, advice))
        elif time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + _LINE_PERIOD_S
            print(f'frame {frames}: {summary_line(metrics)}' + (f'\n  {advice}' if advice else ''),
                  flush=True)

    def __enter__(self) -> LiveTable:
        """Take over the terminal, if there is one."""
        if sys.stdout.isatty():
            try:
                from rich.live import Live
            except ImportError:  # a ROS without it: the lines say the same
                return self
            self._live = Live(refresh_per_second=8)
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        """Leave the last table on the terminal."""
        if self._live is not None:
            self._live.stop()


def _table(title: str, metrics: Mapping[str, float], frames: int, advice: str = '') -> Any:
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text
    quality = Table(title=f'{title}, frame {frames}', title_justify='left')
    for heading in ('measure', 'unit', 'preliminary', 'refined'):
        quality.add_column(heading, justify='left' if heading == 'measure' else 'right')
    for name, label, unit, less_is_better in MEASURES:
        before, after = metrics.get(f'{name}_preliminary'), metrics.get(f'{name}_refined')
        if before is not None and after is not None:
            is_better = after < before if less_is_better else after > before
            shown = f'[green]{format_value(after)}' if is_better else format_value(after)
            quality.add_row(label, unit, format_value(before), shown)
    # Text: the advice of a node may hold brackets, which are no markup.
    return Group(quality, _row(TIMES, metrics), _row(COUNTS, metrics), _row(HEALTH, metrics),
                 Text(advice or 'OK: nothing to do', 'bold red' if advice else 'green'))


def _row(names: tuple[str, ...], metrics: Mapping[str, float]) -> Any:
    from rich.table import Table
    row = Table()
    for name in names:
        row.add_column(name, justify='right')
    row.add_row(*(format_value(metrics.get(name)) for name in names))
    return row
