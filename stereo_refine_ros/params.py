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
Every parameter once: type, default, unit, range and what it does.

The ROS descriptors, the check of the YAML presets, the command-line options of `evaluate` and
docs/parameters.md all come from the dataclasses below. The defaults are the `live` preset.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from stereo_refine_ros.parameter_files import preset_path, read_section
from stereo_refine_ros.parameter_spec import (
    choice, flag, integer, number, ParameterSpec, specs_of)

PRESETS = ('live', 'accurate', 'paper')
MATCHERS = ('sgbm', 'bm', 'segment_tree', 'non_local', 'scanline', 'external')
PROJECTIONS = ('full', 'guarded', 'off')
TRANSPORTS = ('raw', 'compressed')
FILTERS = ('none', 'box', 'weighted_median', 'guided', 'trilateral', 'bilateral', 'median')


@dataclass(frozen=True)
class MatchingParams:
    """Steps 1-3: the preliminary disparity."""

    method: str = choice('scanline', MATCHERS, 'matcher that makes the preliminary disparity')
    min_disparity: int = integer(0, -2048, 2048, 'px', 'smallest disparity searched')
    num_disparities: int = integer(64, 1, 2048, 'px', 'number of disparities searched')
    nearest: float = number(
        0.0, 0.0, 1000.0, 'm', 'node: nearest distance wanted, instead of num_disparities, once '
        'camera_info is there; 0: num_disparities')
    nonlocal_refinement: bool = flag(
        True, 'segment_tree, non_local: spread the stable disparities over the tree (Yang 2012)')
    second_pass: bool = flag(
        False, 'segment_tree, non_local: aggregate again on a tree of colour and disparity (ST-2)')


@dataclass(frozen=True)
class SegmentationParams:
    """Step 4a: graph segmentation of the left image (Felzenszwalb & Huttenlocher 2004)."""

    k: float = number(200.0, 0.0, 1e6, '-', 'scale of observation: larger k, larger segments')
    sigma: float = number(0.5, 0.0, 10.0, 'px', 'Gaussian blur before segmentation, 0 for none')
    min_size: int = integer(30, 1, 1000000, 'px', 'smaller segments join their best neighbour')
    diagonal: bool = flag(False, 'join diagonal neighbours too: 8 instead of 4')
    adapt: bool = flag(
        True, 'measure changes of colour against the mean change in the image, so that one k '
        'serves grey and colour, dark and bright, haze and contrast; false: in grey levels')


@dataclass(frozen=True)
class PlaneParams:
    """Step 4b: a RANSAC plane per segment, and its projection into the disparity map."""

    projection: str = choice(
        'guarded', PROJECTIONS,
        'full: every pixel of a fitted segment takes its plane (the paper); '
        'guarded: every pixel takes what is likeliest; off: planes change nothing')
    iterations: int = integer(20, 1, 10000, '-', 'RANSAC hypotheses per segment')
    inlier_threshold: float = number(1.0, 0.01, 100.0, 'px', 'largest residual of an inlier')
    min_inlier_ratio: float = number(0.5, 0.0, 1.0, 'ratio', 'planes with fewer inliers fail')
    seed: int = integer(0, 0, 2147483647, '-', 'seed of the hypotheses')


@dataclass(frozen=True)
class FilterParams:
    """Step 4c: the filter after projection."""

    method: str = choice('median', FILTERS, 'filter of the projected disparity')
    radius: int = integer(2, 1, 50, 'px', 'half width of the filter window')
    eps: float = number(0.01, 1e-9, 10.0, '-', 'regularisation of the guided filter')
    sigma_color: float = number(10.0, 0.1, 1000.0, 'grey levels', 'how alike colours must be')
    sigma_space: float = number(5.0, 0.1, 1000.0, 'px', 'spatial reach of the weights')
    sigma_disparity: float = number(
        2.0, 0.01, 1000.0, 'px', 'trilateral, bilateral: how alike disparities must be')


@dataclass(frozen=True)
class SyncParams:
    """Pairing of left, right and camera_info messages."""

    approximate: bool = flag(False, 'pair stamps that differ by at most sync.slop')
    slop: float = number(0.01, 0.0, 10.0, 's', 'largest stamp difference within a pair')
    queue_size: int = integer(10, 1, 1000, '-', 'unmatched messages kept per topic')


@dataclass(frozen=True)
class ProcessingParams:
    """Use of the machine."""

    threads: int = integer(2, 1, 256, '-', 'threads used by the kernels and by OpenCV')
    frames_in_flight: int = integer(
        2, 1, 2, '-', 'node: frames refined at a time, at most one a thread; the second begins, '
        'on half the threads, while the first is not done')
    refine_pixels: float = number(
        0.2, 0.0, 1e6, 'million', 'planes and choices are made on the image where it has at most '
        'so many pixels, else on its half; matching is at full size always')


@dataclass(frozen=True)
class RectificationParams:
    """What is undone of the camera's faults before matching."""

    correct: bool = flag(
        True, 'undo the row offset between the views that is found in the images')


@dataclass(frozen=True)
class TemporalParams:
    """Use of what was found in the last frame."""

    enabled: bool = flag(
        True, 'planes and disparities of the last frame may serve again where the image did not '
        'change; false: the same bits whatever came before')


@dataclass(frozen=True)
class InputsParams:
    """What kind of messages the images come as."""

    image_transport: str = choice(
        'raw', TRANSPORTS, 'raw: sensor_msgs/Image; compressed: <topic>/compressed')
    rectify: bool = flag(
        False, 'the images are raw: rectify them by K, D, R and P of camera_info')


@dataclass(frozen=True)
class CameraParams:
    """Calibration for cameras whose camera_info has none."""

    baseline: float = number(
        0.0, 0.0, 100.0, 'm', 'distance of the cameras instead of that of camera_info; 0: theirs')
    focal_length: float = number(
        0.0, 0.0, 100000.0, 'px', 'focal length instead of that of camera_info; 0: theirs')


@dataclass(frozen=True)
class OutputParams:
    """What is published of a frame."""

    min_confidence: float = number(
        0.5, 0.0, 1.0, 'probability', 'disparity, depth and points: pixels less sure than this '
        'are invalid; 0 publishes the dense map')
    max_depth: float = number(
        0.0, 0.0, 100000.0, 'm', 'points: farther ones are left out; 0: none are')


@dataclass(frozen=True)
class Params:
    """
    One consistent set of parameters; read as `params.matching.method` or by dotted name.

    Build it with `load_preset`, change it with `updated`; both check every value.
    """

    preset: str = choice('live', PRESETS, 'named set of values that the others start from')
    matching: MatchingParams = field(default_factory=MatchingParams)
    segmentation: SegmentationParams = field(default_factory=SegmentationParams)
    planes: PlaneParams = field(default_factory=PlaneParams)
    filter: FilterParams = field(default_factory=FilterParams)  # noqa: A003
    rectification: RectificationParams = field(default_factory=RectificationParams)
    temporal: TemporalParams = field(default_factory=TemporalParams)
    output: OutputParams = field(default_factory=OutputParams)
    inputs: InputsParams = field(default_factory=InputsParams)
    camera: CameraParams = field(default_factory=CameraParams)
    sync: SyncParams = field(default_factory=SyncParams)
    processing: ProcessingParams = field(default_factory=ProcessingParams)

    def as_dict(self) -> dict[str, Any]:
        """All values by dotted name, in the order of definition."""
        return {spec.name: _lookup(self, spec.name) for spec in SPECS}

    def updated(self, values: Mapping[str, Any]) -> Params:
        """
        Return a copy with the dotted names in `values` changed; all of them or none.

        A new `preset` resets every parameter to that preset before the others apply.

        Raises
        ------
        ValueError
            Naming every unknown name and every value out of its type, range or choices.

        """
        checked = check_values(values)
        if 'preset' in checked and checked['preset'] != self.preset:
            return load_preset(checked['preset'], checked)
        return _with_values(self, checked)


SPECS: tuple[ParameterSpec, ...] = tuple(specs_of(Params()))
SPEC_BY_NAME: dict[str, ParameterSpec] = {spec.name: spec for spec in SPECS}
# What there was once: what to do instead.
REPLACED = {
    'processing.max_cells': 'use processing.refine_pixels; matching is at full size always',
    'processing.min_rows': 'use processing.refine_pixels; rows are averaged no more',
    'planes.spread': 'leave it out; planes.projection guarded asks neighbours of like colour '
                     'always'}


def check_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Check values by dotted name; raise one ValueError that lists everything wrong."""
    checked, wrong = {}, []
    for name, value in values.items():
        if name not in SPEC_BY_NAME:
            instead = f' any more: {REPLACED[name]}' if name in REPLACED else ''
            wrong.append(f'{name}: no such parameter{instead}')
            continue
        try:
            checked[name] = SPEC_BY_NAME[name].check(value)
        except ValueError as error:
            wrong.append(str(error))
    if wrong:
        raise ValueError('; '.join(wrong))
    return checked


def load_preset(name: str, overrides: Mapping[str, Any] | None = None) -> Params:
    """
    Return the parameters of a preset, with `overrides` by dotted name on top.

    Raises
    ------
    ValueError
        For an unknown preset or override, or a value that its parameter does not take.

    """
    SPEC_BY_NAME['preset'].check(name)
    checked = check_values(overrides or {})
    values = read_preset_file(preset_path(name))
    return _with_values(Params(), {**values, **checked, 'preset': name})


def read_preset_file(path: Path) -> dict[str, Any]:
    """Read the dotted parameters of a ROS parameter file (its `/**` section)."""
    return check_values(read_section(path))


def _lookup(params: Any, name: str) -> Any:
    for part in name.split('.'):
        params = getattr(params, part)
    return params


def _with_values(params: Params, checked: Mapping[str, Any]) -> Params:
    for name, value in checked.items():
        group, _, leaf = name.rpartition('.')
        if group:
            section = replace(getattr(params, group), **{leaf: value})
            params = replace(params, **{group: section})
        else:
            params = replace(params, **{leaf: value})
    return params
