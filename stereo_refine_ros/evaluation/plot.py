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

"""A plot of figures over time as an SVG file, written by hand: no plotting library needed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
import math

from stereo_refine_ros.evaluation.video import FrameRow

_WIDTH, _PANEL, _LEFT, _RIGHT, _TOP, _BOTTOM = 900, 150, 70, 20, 30, 25
_COLORS = ('#d55e00', '#0072b2')  # preliminary, refined: apart for colour-blind readers

PANELS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ('valid ratio', ('valid_ratio_preliminary', 'valid_ratio_refined')),
    ('photometric PSNR [dB]', ('photometric_psnr_preliminary', 'photometric_psnr_refined')),
    ('photometric SSIM', ('photometric_ssim_preliminary', 'photometric_ssim_refined')),
    ('temporal noise [px]', ('temporal_noise_preliminary', 'temporal_noise_refined')),
    ('total time [ms]', ('total_ms',)),
)


def plot_svg(rows: Sequence[FrameRow], title: str) -> str:
    """Draw the panels of `PANELS` one under another over the rows' 'time'."""
    height = _TOP + len(PANELS) * _PANEL + _BOTTOM
    times = [row['time'] for row in rows]
    panels = ''.join(
        _panel(label, times, [[row[name] for row in rows] for name in names],
               _TOP + number * _PANEL) for number, (label, names) in enumerate(PANELS))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        'font-family="sans-serif" font-size="12">'
        f'<rect width="{_WIDTH}" height="{height}" fill="white"/>'
        f'<text x="{_LEFT}" y="18" font-size="14">{escape(title)}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="18" text-anchor="end">'
        f'<tspan fill="{_COLORS[0]}">preliminary</tspan> '
        f'<tspan fill="{_COLORS[1]}">refined</tspan></text>{panels}'
        f'<text x="{_LEFT}" y="{height - 8}">{times[0]:.6g}</text>'
        f'<text x="{_WIDTH - _RIGHT}" y="{height - 8}" text-anchor="end">'
        f'{times[-1]:.6g}</text></svg>\n')


def _panel(label: str, times: Sequence[float], series: Sequence[Sequence[float]],
           top: int) -> str:
    known = [value for values in series for value in values if math.isfinite(value)]
    low, high = (min(known), max(known)) if known else (0.0, 1.0)
    if high <= low:
        low, high = low - 0.5, high + 0.5
    base, height = top + _PANEL - 10, _PANEL - 35
    # A lone series is the refined pipeline's.
    colors = _COLORS[-len(series):]
    lines = ''.join(_line(times, values, (low, high), (base, height), color)
                    for values, color in zip(series, colors, strict=True))
    return (
        f'<text x="{_LEFT}" y="{top + 16}">{escape(label)}</text>'
        f'<path d="M{_LEFT} {base - height}V{base}H{_WIDTH - _RIGHT}" fill="none" '
        'stroke="#999"/>'
        f'<text x="{_LEFT - 6}" y="{base}" text-anchor="end">{low:.4g}</text>'
        f'<text x="{_LEFT - 6}" y="{base - height + 8}" text-anchor="end">{high:.4g}</text>'
        + lines)


def _line(times: Sequence[float], values: Sequence[float], limits: tuple[float, float],
          place: tuple[int, int], color: str) -> str:
    low, high = limits
    base, height = place
    span = max(times[-1] - times[0], 1e-9)
    path, is_open = '', False
    for time, value in zip(times, values, strict=True):
        if not math.isfinite(value):
            is_open = False
            continue
        x = _LEFT + (time - times[0]) / span * (_WIDTH - _LEFT - _RIGHT)
        y = base - (value - low) / (high - low) * height
        path += f'{"L" if is_open else "M"}{x:.1f} {y:.1f}'
        is_open = True
    return f'<path d="{path}" fill="none" stroke="{color}" stroke-width="1.5"/>'
