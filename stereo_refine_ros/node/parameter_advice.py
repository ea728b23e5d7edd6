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

"""Parameters that would pass in silence: misspelt ones, other nodes' names, files of others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import difflib
from pathlib import Path
import re
from typing import Any

import yaml

from stereo_refine_ros.params import REPLACED, SPEC_BY_NAME  # noqa: I100

_SPELLED_ALIKE = 0.6
_NO_COUNTERPART = 'has no counterpart here'
# What it was called, or stereo_image_proc and image_transport call it: what it is called here.
COUNTERPARTS = {
    **REPLACED,
    'approximate_sync': 'use sync.approximate',
    'approximate_sync_tolerance_seconds': 'use sync.slop',
    'queue_size': 'use sync.queue_size',
    'image_transport': 'use inputs.image_transport',
    'stereo_algorithm': 'use matching.method: bm for 0, sgbm for 1, or better scanline',
    'disparity_range': 'use matching.num_disparities',
    'min_disparity': 'use matching.min_disparity',
    'use_system_default_qos': 'use qos_overrides.<topic>.subscription.reliability',
    'interpolation': _NO_COUNTERPART, 'correlation_window_size': _NO_COUNTERPART,
    'prefilter_size': _NO_COUNTERPART, 'prefilter_cap': _NO_COUNTERPART,
    'texture_threshold': 'use output.min_confidence: what cannot be seen is not published',
    'uniqueness_ratio': 'use output.min_confidence: what is ambiguous is not published',
    'speckle_size': 'use segmentation.min_size', 'speckle_range': _NO_COUNTERPART,
    'disp12_max_diff': _NO_COUNTERPART, 'P1': _NO_COUNTERPART, 'P2': _NO_COUNTERPART,
    'fullDP': _NO_COUNTERPART, 'sgbm_mode': _NO_COUNTERPART}
_OTHERS = ('use_sim_time', 'start_type_description_service')


def is_foreign(name: str) -> bool:
    """Whether a parameter is neither one of the node's own nor one of ROS's."""
    return not (name in SPEC_BY_NAME or name in _OTHERS or name.startswith('qos_overrides.'))


def explain(name: str) -> str:
    """Say that a parameter does nothing, and which one may have been meant."""
    text = f'parameter {name!r} is not known and does nothing'
    if name in COUNTERPARTS:
        return f'{text}: {COUNTERPARTS[name]}'
    leaf = name.rpartition('.')[2]
    same_leaf = [known for known in SPEC_BY_NAME if known.rpartition('.')[2] == leaf]
    near = same_leaf or difflib.get_close_matches(name, SPEC_BY_NAME, 1, _SPELLED_ALIKE)
    return f'{text}: did you mean {near[0]}?' if near else (
        f'{text}; `ros2 param list` shows those that are')


def unused_files(arguments: Sequence[str], node: str) -> Iterator[str]:
    """
    Name the parameter files that set something of this package, but for no node of this name.

    Parameters
    ----------
    arguments : sequence of str
        Of the command line.
    node : str
        Fully qualified name of the node.

    Yields
    ------
    str
        What is wrong and what to do.

    """
    for flag, path in zip(arguments, arguments[1:], strict=False):
        if flag != '--params-file':
            continue
        sections = dict(_sections(path))
        meant = [name for name, values in sections.items()
                 if any(not is_foreign(value) for value in values)]
        if meant and not any(_matches(name, node) for name in sections):
            yield (f'{path}: parameters are for {", ".join(meant)}, this node is {node}; none '
                   f'is used: write `{node}:` or `/**:` instead')


def _sections(path: str) -> Iterator[tuple[str, list[str]]]:
    """List the sections of a file by node name, each with its dotted parameter names."""
    try:
        document = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, yaml.YAMLError):
        return  # ROS itself says what is wrong with such a file
    yield from _find_sections(document, '')


def _find_sections(tree: Any, prefix: str) -> Iterator[tuple[str, list[str]]]:
    for key, value in tree.items() if isinstance(tree, dict) else ():
        if key == 'ros__parameters':
            yield prefix, list(_leaves(value, ''))
        else:
            yield from _find_sections(value, f'{prefix}/{str(key).strip("/")}')


def _leaves(tree: Any, prefix: str) -> Iterable[str]:
    for key, value in tree.items() if isinstance(tree, dict) else ():
        name = f'{prefix}{key}'
        yield from _leaves(value, f'{name}.') if isinstance(value, dict) else (name,)


def _matches(section: str, node: str) -> bool:
    """Whether a section's name, `*` for one part and `**` for any, is that of a node."""
    pattern = re.escape(section).replace(r'/\*\*', '(/[^/]+)*').replace(r'\*', '[^/]+')
    return section == '/**' or re.fullmatch(pattern, node) is not None
