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

"""README.md and docs/ name only what there is, and all that they should."""

import ast
from fnmatch import fnmatch
from pathlib import Path
import re

import numpy as np
import pytest
from stereo_refine_ros.encodings import ENCODINGS
from stereo_refine_ros.params import MATCHERS, REPLACED, SPEC_BY_NAME
from stereo_refine_ros.quality.frame import measure_frame
from stereo_refine_ros.types import (
    DisparityMap, PlaneSegmentation, RefinementResult, StereoPair)

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / 'README.md'
PAGES = [README, ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').glob('*.md'))]
LARGEST_README = 10_000  # bytes: what a visitor reads to the end
WIDEST = 120  # columns

# What the node adds to the figures of `measure_frame`.
NODE_KEYS = {
    'frame_latency_ms', 'fps', 'frames_dropped', 'pairs_unmatched', 'pairs_refused', 'degraded',
    'confidence_mean', 'published_ratio', 'row_offset_px', 'gain_ratio', 'noise_sigma'}
SECTIONS = {name.partition('.')[0] for name in SPEC_BY_NAME if '.' in name}


def _read(path: Path) -> str:
    return path.read_text(encoding='utf-8')


def _relative_links(path: Path) -> list[str]:
    links = re.findall(r'\]\(([^)\s]+)\)', _read(path))
    return [link for link in links if not re.match(r'https?:', link)]


def _assigned(path: Path, name: str):
    """Return the keys of the dict that a module assigns, without importing it."""
    for node in ast.walk(ast.parse(_read(path))):
        target = getattr(node, 'target', None) or getattr(node, 'targets', [None])[0]
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and getattr(target, 'id', '') == name:
            return {ast.literal_eval(key) for key in node.value.keys}
    raise AssertionError(f'{name} is not in {path}')


def test_readme_is_one_page():
    assert 5_000 < len(_read(README).encode()) <= LARGEST_README


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_lines_fit_a_terminal(path):
    # A row of a table cannot be broken; the README has none that would have to be.
    wide = [line for line in _read(path).splitlines()
            if len(line) > WIDEST and not (path != README and line.startswith('|'))]
    assert wide == []


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_links_lead_somewhere(path):
    for link in _relative_links(path):
        file, _, anchor = link.partition('#')
        target = (path.parent / file).resolve() if file else path
        assert target.is_relative_to(ROOT) and target.is_file(), link
        if not anchor:
            continue
        heads = {re.sub(r'[^a-z0-9 _-]', '', head.lower()).replace(' ', '-')
                 for head in re.findall(r'^#+ (.*)$', _read(target), re.MULTILINE)}
        assert anchor in heads, link


def test_readme_leads_to_every_page():
    linked = {(ROOT / link.partition('#')[0]).resolve() for link in _relative_links(README)}
    assert set(PAGES) - {README} <= linked


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_commands_name_what_there_is(path):
    text = _read(path)
    for program in re.findall(r'python3? (?:-m pytest )?([a-z_/]+\.py)', text):
        assert (ROOT / program).is_file(), program
    for module in re.findall(r'python3? -m ((?:stereo_refine_ros|benchmarks)\.[a-z_]+)', text):
        place = ROOT / module.replace('.', '/')
        assert place.with_suffix('.py').is_file() or (place / '__main__.py').is_file(), module
    targets = set(re.findall(r'^([a-z-]+):', _read(ROOT / 'Makefile'), re.MULTILINE))
    assert set(re.findall(r'(?:^|`)make ([a-z-]+)', text, re.MULTILINE)) <= targets


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_options_of_commands_exist(path):
    blocks = re.findall(r'```bash\n(.*?)```', _read(path), re.DOTALL)
    commands = '\n'.join(blocks).replace('\\\n', ' ')
    sources = {'stereo_refine_ros.evaluate': 'stereo_refine_ros/evaluate.py',
               'stereo_refine_ros replay': 'stereo_refine_ros/replay/options.py'}
    for line in commands.splitlines():
        program = re.search(
            r'(stereo_refine_ros\.evaluate|stereo_refine_ros replay|[a-z_]+/[a-z_]+\.py)', line)
        if program is None or not (ROOT / sources.get(program[1], program[1])).is_file():
            continue
        source = _read(ROOT / sources.get(program[1], program[1]))
        arguments = line[program.end():].partition('#')[0].partition('--ros-args')[0]
        unknown = [option for option in re.findall(r'(?<=\s)--[a-z-]+', arguments)
                   if f"'{option}'" not in source and f"('{option[2:]}', " not in source]
        assert unknown == [], line


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_parameters_named_exist(path):
    dotted = re.findall(r'(?<![\w./*-])([a-z]+\.[a-z_]+)\b(?![/(.])', _read(path))
    named = {name for name in dotted if name.partition('.')[0] in SECTIONS}
    assert named <= set(SPEC_BY_NAME)


def test_changelog_says_what_became_of_every_parameter_that_is_gone():
    assert [name for name in REPLACED if f'``{name}``' not in _read(ROOT / 'CHANGELOG.rst')] == []


def test_topics_are_all_there():
    rows = re.findall(r'^\| (.*?) \|', _read(ROOT / 'docs' / 'topics.md'), re.MULTILINE)[1:]
    named = {name for row in rows for name in re.findall(r'`([^`]+)`', row)}
    published = _assigned(ROOT / 'stereo_refine_ros' / 'node' / 'publishers.py', 'TOPICS')
    assert named == published | {
        '/diagnostics', 'left/image_rect', 'right/image_rect', 'left/camera_info',
        'right/camera_info', 'preliminary/disparity', 'ground_truth/disparity'}


def test_encodings_are_all_there():
    text = _read(ROOT / 'docs' / 'cameras.md')
    names = {re.sub(r'^(bayer_[a-z]+)(8|16)$', r'\1', name) for name in ENCODINGS}
    assert {name for name in names if not re.search(rf'\b{name}\b', text)} == set()


def test_metrics_are_all_there_and_no_others():
    shape = (8, 40)
    given = DisparityMap(np.full(shape, 2, np.float32), 0, 16)
    segments = PlaneSegmentation(
        np.zeros(shape, np.int32), np.zeros((1, 3)), np.ones(1, np.bool_), np.ones(1, np.float32))
    stages = dict.fromkeys(('matching', 'segmentation', 'planes', 'filter'), 1.0)
    image = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    figures = set(measure_frame(RefinementResult(given, given, segments, 1.0, stages),
                                StereoPair(image, image), given.values))
    rows = re.findall(r'^\| (.*?) \|', _read(ROOT / 'docs' / 'metrics.md'), re.MULTILINE)[1:]
    documented = {key for row in rows for key in re.findall(r'`([^`]+)`', row)}
    published = figures | NODE_KEYS
    assert {key for key in published
            if not any(fnmatch(key, pattern) for pattern in documented)} == set()
    assert {pattern for pattern in documented
            if not any(fnmatch(key, pattern) for key in published)} == set()


@pytest.mark.parametrize('path', PAGES, ids=lambda path: path.name)
def test_launch_arguments_exist(path):
    launches = re.findall(
        r'(stereo_refine|two_cameras)\.launch\.py((?:[^\n]*\\\n)*[^\n`]*)', _read(path))
    known = {
        'stereo_refine': _assigned(ROOT / 'launch' / 'stereo_refine.launch.py', 'ARGUMENTS'),
        'two_cameras': {'first', 'second'}}
    for name, arguments in launches:
        assert set(re.findall(r'\b([a-z_]+):=', arguments)) <= known[name]


@pytest.mark.compiled
def test_python_of_the_readme_runs():
    code = re.search(r'```python\n(.*?)```', _read(README), re.DOTALL)[1]
    wide = np.random.default_rng(0).integers(0, 256, (48, 104, 3), np.uint8)
    names = {'left': wide[:, :96].copy(), 'right': wide[:, 4:100].copy(),
             'preliminary': np.full((48, 96), 4, np.float32)}
    exec(code, names)
    result = names['result']
    assert result.disparity.values.shape == result.confidence.shape == (48, 96)
    assert np.mean(np.abs(result.disparity.values - 4) < 1) > 0.9


def test_matchers_named_exist():
    named = set(re.findall(r'`(sgbm|bm|segment_tree|non_local|scanline|external)`',
                           _read(ROOT / 'docs' / 'design.md')))
    assert named == set(MATCHERS)
