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

"""Malformed messages through the conversions: refused, or something that makes sense."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
import math

from malformed import random_disparity, random_image, random_info
from malformed_compressed import random_compressed
import numpy as np
from stereo_refine_ros.camera_info import stereo_geometry
from stereo_refine_ros.compressed import check_compressed, decode_compressed
from stereo_refine_ros.encodings import BadMessage, decode_image, ENCODINGS
from stereo_refine_ros.messages.disparity import read_disparity

WIDTH, HEIGHT = 64, 48


@dataclass
class Report:
    """What came of the messages."""

    outcomes: Counter[str] = field(default_factory=Counter)
    violations: list[str] = field(default_factory=list)

    def expect(self, is_right: bool, text: str) -> None:
        """Note a violation, the first few in words."""
        if not is_right:
            self.outcomes['violations'] += 1
            self.violations += [text] if len(self.violations) < 20 else []


def fuzz_conversions(count: int, rng: np.random.Generator) -> Report:
    """Draw `count` messages of the four kinds in turn and convert them."""
    report = Report()
    kinds = (_convert_image, _convert_info, _convert_disparity, _convert_compressed)
    for i in range(count):
        kind = kinds[i % len(kinds)]
        try:
            kind(rng, report)
            outcome = 'converted'
        except BadMessage as error:
            outcome = f'refused: {error.reason}'
        except Exception as error:
            outcome = 'raised'
            report.expect(False, f'message {i}: {kind.__name__}: {error!r}')
        report.outcomes[outcome] += 1
    return report


def _convert_image(rng: np.random.Generator, report: Report) -> None:
    message = random_image(rng)
    pixels = decode_image('image', message)
    report.expect(
        pixels.dtype == f'u{ENCODINGS[message.encoding].item_bytes}'
        and pixels.shape[:2] == (message.height, message.width)
        and len(message.data) >= message.width * message.height,
        f'{message.encoding} {message.width} x {message.height} became {pixels.shape}')
    if message.encoding in ('mono8', 'bgr8'):
        row, column = message.height - 1, message.width - 1
        item = 1 if message.encoding == 'mono8' else 3
        start = row * message.step + column * item
        report.expect(bytes(message.data[start:start + item]) == pixels[row, column].tobytes(),
                      f'{message.encoding}: last pixel differs')


def _convert_compressed(rng: np.random.Generator, report: Report) -> None:
    message = random_compressed(rng)
    header = check_compressed('image', message)
    pixels = decode_compressed('image', message)
    report.expect(pixels.dtype in (np.uint8, np.uint16) and pixels.ndim in (2, 3)
                  and pixels.shape[:2] == (header.height, header.width),
                  f'{message.format[:40]} became {pixels.dtype} {pixels.shape}')


def _convert_info(rng: np.random.Generator, report: Report) -> None:
    left, right = (random_info(rng, WIDTH, HEIGHT) for _ in range(2))
    found = stereo_geometry(left, right, WIDTH, HEIGHT)
    values = np.array([found.focal_px, found.fy, found.baseline_m, found.cx_left, found.cy,
                       found.cx_right, found.doffs_px])
    with np.errstate(over='raise'):
        report.expect(bool(np.isfinite(values.astype(np.float32)).all()
                           and (values[:3].astype(np.float32) > 0).all()), f'{found}')


def _convert_disparity(rng: np.random.Generator, report: Report) -> None:
    message = random_disparity(rng)
    found = read_disparity('disparity', message)
    valid = found.values[~np.isnan(found.values)]
    report.expect(found.values.shape == (message.image.height, message.image.width)
                  and bool((np.abs(valid) <= 1e5).all()), 'absurd disparity taken')
    report.expect(not found.has_range or not (valid < found.min_disparity).any(),
                  'disparity below the declared range taken')
    report.expect(all(math.isnan(value) or 0 < value < math.inf
                      for value in (found.focal_px, found.baseline_m)), f'{found}')
