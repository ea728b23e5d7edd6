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
Compile every kernel before the first frame, at a first start in a process of its own.

A compiler leaves some 150 MB behind where it ran, and holds up the interpreter's other threads
for seconds at a time. What it made lies in the cache, and loads from there in half a second.
`python -m stereo_refine_ros.warm_up` fills the cache ahead of that, where an image is built.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import ctypes
import hashlib
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import cv2
import numba
from numba.core import event
import numpy as np

from stereo_refine_ros import KERNELS
from stereo_refine_ros.matching.scanline import lane_counts, LANES, scan
from stereo_refine_ros.params import load_preset, Params, PRESETS, SPECS
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.quality.frame import measure_frame
from stereo_refine_ros.rectification import compile_kernels
from stereo_refine_ros.types import StereoPair

Progress = Callable[[str], None]

_PR_SET_PDEATHSIG = 1  # from prctl.h
_HEARTBEAT_S = 10.0
_CHILD = '--for-process'
# The parameters whose choices decide which kernels run.
_COMPUTING = ('matching', 'segmentation', 'planes', 'filter', 'rectification', 'temporal')


def lanes_needed(params: Params) -> tuple[int, ...]:
    """Return the lane counts that frames will need: all where the range comes with the frames."""
    matching = params.matching
    if matching.method == 'external' or matching.nearest > 0:
        return LANES
    return lane_counts(matching.num_disparities)


def run_kernels(params: Params, progress: Progress = lambda text: None,
                lanes: Sequence[int] = ()) -> None:
    """
    Refine and measure a small pair of either kind, so that every kernel is there.

    On both grids, a second frame after the first, and a map from outside without the right view.

    Parameters
    ----------
    params : Params
        Of the frames to come.
    progress : callable of str
        Told what comes next.
    lanes : sequence of int
        Lane counts of the matcher; `lanes_needed` where none are given.

    """
    rng = np.random.default_rng(0)
    width = min(512, params.matching.num_disparities + 64)
    wide = cv2.blur(rng.integers(0, 256, (64, width + 4, 3), np.uint8), (5, 3))
    left, right = wide[:, :width].copy(), wide[:, 4:].copy()
    truth = np.full((64, width), 4, np.float32)
    grey = (np.ascontiguousarray(left[..., 0]), np.ascontiguousarray(right[..., 0]))
    pairs = {'colour': StereoPair(left, right), 'grey': StereoPair(*grey)}
    given = truth if params.matching.method == 'external' else None
    # Whatever the size of the frames to come, planes are made on the image or on its half.
    refiners = [StereoRefiner(params.updated({'processing.refine_pixels': pixels}))
                for pixels in (1.0, 0.0)]
    for number, (name, pair) in enumerate(pairs.items(), 1):
        progress(f'kernels for {name} images ({number} of {len(pairs)})')
        for refiner in refiners:
            for right, preliminary in ((pair.right, given), (None, truth)):
                result = refiner.process(pair.left, right, preliminary)
                measure_frame(result, StereoPair(pair.left, right), truth)
    for count in lanes or lanes_needed(params):
        scan(pairs['grey'], 0, count)
    compile_kernels()  # the rows of the small pair were measured at one level only


@contextmanager
def compiled_counted(progress: Progress, every_s: float = _HEARTBEAT_S) -> Iterator[None]:
    """
    Tell how many kernels were compiled so far, from time to time, while the block runs.

    Parameters
    ----------
    progress : callable of str
        Told the number.
    every_s : float
        At most this often, in seconds.

    """
    counter = _Counter(progress, every_s)
    with event.install_listener('numba:compile', counter):
        yield


class CompilerWatch(event.Listener):
    """Know whether this process has compiled anything lately: it then works on nothing else."""

    def __init__(self) -> None:
        """Listen from now on."""
        self._begun, self._ended, self._told = 0, 0, 0
        event.register('numba:compile', self)

    def has_worked(self) -> bool:
        """Whether anything was compiled since this was asked last, or is being compiled."""
        begun, told = self._begun, self._told
        self._told = begun
        return begun > told or begun > self._ended

    def on_start(self, event: event.Event) -> None:
        """Count."""
        self._begun += 1

    def on_end(self, event: event.Event) -> None:
        """Count."""
        self._ended += 1


class _Counter(event.Listener):

    def __init__(self, progress: Progress, every_s: float) -> None:
        self._progress, self._every_s = progress, every_s
        self._count, self._told = 0, time.monotonic()

    def on_start(self, event: event.Event) -> None:
        pass

    def on_end(self, event: event.Event) -> None:
        self._count += 1
        if time.monotonic() - self._told >= self._every_s:
            self._told = time.monotonic()
            self._progress(f'kernels: {self._count} are done')


def compile_apart(params: Params, progress: Progress = lambda text: None) -> None:
    """
    Fill the cache from a child process, unless that was done before.

    Nothing depends on it: what the child did not compile, the first call will. The child ends
    with its parent.
    """
    mark = _mark(params, lanes_needed(params))
    if KERNELS.is_private:
        progress(f'kernels for {KERNELS.folder}, since {KERNELS.wanted} cannot be written')
    if mark is None or mark.exists() or _is_there(_mark(params, LANES)):
        return
    command = [sys.executable, '-m', 'stereo_refine_ros.warm_up', _CHILD, str(os.getpid()),
               str(mark), json.dumps(params.as_dict())]
    try:
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            for line in child.stdout:
                progress(line.rstrip())
    except OSError as error:  # where no process may be started
        progress(f'kernels here: {error}')


def compile_presets(presets: Sequence[str], progress: Progress) -> None:
    """Fill the cache with what these presets need, in this process."""
    for preset in presets:
        params = load_preset(preset)
        mark = _mark(params, LANES)
        if _is_there(mark):
            progress(f'{preset}: kernels are there')
            continue
        _compile(params, mark, _prefixed(preset, progress), LANES)


def _prefixed(preset: str, progress: Progress) -> Progress:
    return lambda step: progress(f'{preset}: {step}')


def _compile(params: Params, mark: Path | None, progress: Progress,
             lanes: Sequence[int] = ()) -> None:
    with compiled_counted(progress):
        run_kernels(params, progress, lanes)
    if mark is not None:
        mark.touch()


def _is_there(mark: Path | None) -> bool:
    return mark is not None and mark.exists()


def _mark(params: Params, lanes: Sequence[int]) -> Path | None:
    """Return the file that says that these kernels are in the cache; None where none is kept."""
    folder = os.environ.get('NUMBA_CACHE_DIR')
    if folder is None or numba.config.DISABLE_JIT:
        return None
    kinds = [(spec.name, params.as_dict()[spec.name]) for spec in SPECS
             if spec.name.split('.')[0] in _COMPUTING and (spec.choices or spec.type is bool)]
    versions = (sys.version, numba.__version__, np.__version__)
    digest = hashlib.sha256(repr((kinds, versions, tuple(lanes))).encode()).hexdigest()[:16]
    return Path(folder) / f'compiled-{KERNELS.state}-{digest}'


def _end_with(parent: int) -> None:
    """Have the system end this process when the thread that started it is gone."""
    prctl = getattr(ctypes.CDLL(None), 'prctl', None)
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        sys.exit(1)


def _child(parent: str, mark: str, values: str) -> None:
    _end_with(int(parent))
    params = load_preset('live', json.loads(values))
    _compile(params, Path(mark), lambda text: print(text, flush=True))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='python -m stereo_refine_ros.warm_up',
        description='Compile the kernels into the cache, for example while an image is built, '
        'so that the first start is as quick as any other.')
    parser.add_argument('--preset', action='append', choices=PRESETS,
                        help='only the kernels of this preset; may be repeated (default: all)')
    parser.add_argument(_CHILD, nargs=3, metavar=('PARENT', 'MARK', 'PARAMETERS'),
                        help=argparse.SUPPRESS)
    return parser


def main(args: Sequence[str] | None = None) -> int:
    """Compile what the command line asks for; return 1 where it cannot be kept."""
    options = _parser().parse_args(args)
    if options.for_process:
        _child(*options.for_process)
        return 0
    if KERNELS.is_private:
        print(f'warm_up: {KERNELS.wanted} cannot be written by user {os.geteuid()}; set '
              'NUMBA_CACHE_DIR to a folder that can, and to the same one where the node runs',
              file=sys.stderr)
        return 1
    compile_presets(options.preset or PRESETS, lambda text: print(text, flush=True))
    print(f'kernels are in {KERNELS.folder}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
