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

"""The habits of the house, held by reading the source: who imports what, sizes, headers, types."""

import ast
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / 'stereo_refine_ros'
# What a robot does not need, and does not install.
OUTSIDE = ('demo', 'benchmarks', 'reliability', 'scripts')
SOURCES = sorted(
    path for folder in ('stereo_refine_ros', *OUTSIDE, 'test', 'launch')
    for path in (ROOT / folder).rglob('*.py')) + [ROOT / 'setup.py']
PRODUCT = [path for path in SOURCES if path.is_relative_to(PACKAGE)]
TYPED = [path for path in SOURCES if path.relative_to(ROOT).parts[0] in (
    'stereo_refine_ros', *OUTSIDE)]

# The ROS shell: the node, and the command lines that start one.
SHELL = ('node', 'messages', 'replay', 'refine_node.py')
SHELL_NAMES = tuple('stereo_refine_ros.' + name.removesuffix('.py') for name in SHELL)
CORE = [path for path in PRODUCT if path.relative_to(PACKAGE).parts[0] not in SHELL]
ROS_MODULES = (
    'rclpy', 'launch', 'launch_ros', 'ament_index_python', 'builtin_interfaces',
    'rcl_interfaces', 'rosgraph_msgs', 'tf2_ros')
LONGEST_FILE, LONGEST_FUNCTION, LONGEST_KERNEL, LONGEST_PIPELINE = 300, 60, 80, 150

BLOCK_ROS = """
import importlib, pkgutil, sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in ROS or name.split('.')[0].endswith('_msgs'):
            raise ImportError(f'{name} is blocked')
ROS = sys.argv[1].split(',')
sys.meta_path.insert(0, Block())
for name in sys.argv[2:]:
    importlib.import_module(name)
print('imported', len(sys.argv) - 2)
"""


def _name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding='utf-8'))


def _imports(path: Path):
    for node in ast.walk(_tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ''
            yield from (f'{node.module}.{alias.name}' for alias in node.names)


def _functions(path: Path):
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    return [node for node in ast.walk(_tree(path)) if isinstance(node, kinds)]


def _is_kernel(function: ast.FunctionDef) -> bool:
    return any(
        'njit' in ast.unparse(decorator) or 'guvectorize' in ast.unparse(decorator)
        for decorator in function.decorator_list)


def _is_compiled(function: ast.FunctionDef) -> bool:
    decorators = map(ast.unparse, function.decorator_list)
    return _is_kernel(function) or 'intrinsic' in decorators


def _body_length(function: ast.FunctionDef) -> int:
    first = function.body[0]
    if ast.get_docstring(function) is not None:
        start = (first.end_lineno or 0) + 1
    else:
        start = first.lineno
    return (function.end_lineno or 0) - start + 1


@pytest.mark.parametrize('path', CORE, ids=_name)
def test_core_imports_no_ros(path: Path):
    foreign = {
        name for name in _imports(path)
        if name.split('.')[0] in ROS_MODULES or name.split('.')[0].endswith('_msgs')
        or name.startswith(SHELL_NAMES)}
    assert foreign == set()


@pytest.mark.parametrize('path', PRODUCT, ids=_name)
def test_package_needs_nothing_outside_it(path: Path):
    outside = {*OUTSIDE, *(module.stem for folder in ('benchmarks', 'reliability', 'scripts')
                           for module in (ROOT / folder).glob('*.py'))}
    assert outside.isdisjoint(name.split('.')[0] for name in _imports(path))


def test_core_imports_where_ros_is_not_installed():
    modules = [
        '.'.join(path.relative_to(ROOT).with_suffix('').parts).removesuffix('.__init__')
        for path in CORE if path.name != '__main__.py']
    done = subprocess.run(
        [sys.executable, '-c', BLOCK_ROS, ','.join(ROS_MODULES), *modules],
        capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ['imported', str(len(modules))]


@pytest.mark.parametrize('path', SOURCES, ids=_name)
def test_file_is_short(path: Path):
    assert len(path.read_text(encoding='utf-8').splitlines()) < LONGEST_FILE


@pytest.mark.parametrize('path', SOURCES, ids=_name)
def test_functions_are_short(path: Path):
    too_long = {
        function.name: _body_length(function) for function in _functions(path)
        if _body_length(function) > (LONGEST_KERNEL if _is_kernel(function) else LONGEST_FUNCTION)}
    assert too_long == {}


@pytest.mark.parametrize('path', SOURCES, ids=_name)
def test_file_starts_with_the_licence_header(path: Path):
    text = path.read_text(encoding='utf-8')
    header = (ROOT / 'setup.py').read_text(encoding='utf-8').split('\n\n')[0]
    assert text.startswith(header + '\n\n"""')


@pytest.mark.parametrize('path', TYPED, ids=_name)
def test_functions_are_typed(path: Path):
    untyped = []
    for function in _functions(path):
        arguments = function.args.posonlyargs + function.args.args + function.args.kwonlyargs
        bare = [arg.arg for arg in arguments
                if arg.annotation is None and arg.arg not in ('self', 'cls')]
        if not _is_compiled(function) and (bare or function.returns is None):
            untyped.append(function.name)
    assert untyped == []


@pytest.mark.parametrize('path', PRODUCT, ids=_name)
def test_kernels_are_cached_and_keep_nan(path: Path):
    for function in filter(_is_kernel, _functions(path)):
        decorator = ' '.join(map(ast.unparse, function.decorator_list))
        assert 'cache=True' in decorator, function.name
        assert not re.search(r'fastmath=(True|{[^}]*(fast|nnan|ninf))', decorator), function.name


# What stands further left knows nothing of what stands further right.
STOREYS = ('images', 'graph', 'levels', 'matching', 'refinement', 'rectification', 'health',
           'quality', 'pipeline', 'evaluation')
SHELL_STOREYS = ('messages', 'node', 'replay')


def _above(path: Path, storeys: tuple[str, ...]) -> set[str]:
    """Name what a file imports from further up than where it stands."""
    storey = path.relative_to(PACKAGE).parts[0].removesuffix('.py')
    packages = {name.split('.')[1] for name in _imports(path)
                if name.startswith('stereo_refine_ros.')}
    return packages.intersection(storeys[storeys.index(storey) + 1:] if storey in storeys else ())


@pytest.mark.parametrize('path', PRODUCT, ids=_name)
def test_no_import_runs_up(path: Path):
    assert _above(path, STOREYS) == set()
    assert _above(path, SHELL_STOREYS) == set()


@pytest.mark.parametrize('name', [*STOREYS, *SHELL_STOREYS])
def test_every_storey_is_there(name: str):
    assert (PACKAGE / name).is_dir() or (PACKAGE / f'{name}.py').is_file()


def test_the_method_is_on_one_screen():
    lines = (PACKAGE / 'pipeline.py').read_text(encoding='utf-8').splitlines()
    assert len(lines) < LONGEST_PIPELINE
