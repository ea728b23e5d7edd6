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

"""Bands of rows cover everything once, and errors in them come out."""

import threading

import numpy as np
import pytest

from stereo_refine_ros.threads import run_bands, start


@pytest.mark.parametrize('threads', [1, 2, 3, 8])
@pytest.mark.parametrize('size', [0, 1, 2, 7, 100])
def test_bands_cover_the_range_once(size, threads):
    counts, bands = np.zeros(size, int), []

    def count(begin, end, step):
        counts[begin:end] += step
        bands.append((begin, end))

    run_bands(count, size, threads, 3)
    assert counts.tolist() == [3] * size
    assert (len(bands) == 1) == (threads == 1 or size < 2)


def test_bands_are_done_without_a_free_helper():
    """The only helper waits for the bands themselves."""
    done = threading.Event()
    helper = start(2, done.wait, 20)
    rows = []
    run_bands(lambda begin, end: rows.extend(range(begin, end)), 10, 2)
    done.set()
    assert helper.result()
    assert sorted(rows) == list(range(10))


def test_bands_may_be_started_from_a_band():
    rows = []

    def inner(begin, end):
        rows.extend(range(begin, end))

    run_bands(lambda begin, end: [run_bands(inner, 6, 2) for _ in range(begin, end)], 4, 2)
    assert sorted(rows) == sorted(4 * list(range(6)))


def test_the_bands_run_side_by_side():
    meeting = threading.Barrier(3, timeout=20)
    run_bands(lambda begin, end: meeting.wait(), 9, 3)


@pytest.mark.parametrize('broken', [0, 5])
def test_an_error_in_any_band_is_raised(broken):
    def fail(begin, end):
        if begin <= broken < end:
            raise RuntimeError(f'row {broken}')

    with pytest.raises(RuntimeError, match=f'row {broken}'):
        run_bands(fail, 6, 2)


def test_a_started_task_runs_beside_the_caller():
    begun = threading.Event()

    def add(a, b):
        begun.set()
        return a + b, threading.current_thread()

    task = start(2, add, 2, 3)
    assert begun.wait(20)
    value, thread = task.result()
    assert value == 5 and thread is not threading.current_thread()


def test_a_task_that_nobody_has_begun_is_run_by_who_wants_its_result():
    done = threading.Event()
    busy = start(2, done.wait, 20)
    for threads in (1, 2):
        task = start(threads, lambda a, b: (a + b, threading.current_thread()), 2, 3)
        assert task.result() == (5, threading.current_thread())
    done.set()
    assert busy.result()
