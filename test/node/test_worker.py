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

"""The newest item, a few in flight, in order; and what is owed afterwards."""

import threading
import time

from stereo_refine_ros.node.worker import Afterwork, NewestSlot, Worker


def test_the_slot_keeps_the_newest():
    slot = NewestSlot()
    assert slot.put('a') is None
    assert slot.put('b') == 'a'
    assert slot.take() == 'b'
    slot.close()
    assert slot.take() is None


def test_a_worker_goes_on_after_an_exception():
    done, errors, served = threading.Event(), [], []

    def process(item, turn):
        if item == 'bad':
            raise ValueError('bad item')
        served.append(item)
        done.set()

    def on_error(error):
        errors.append(error)
        done.set()

    worker = Worker(lambda: None, process, on_error)
    worker.start()
    for item in ('bad', 'good'):
        done.clear()
        worker.submit(item)
        assert done.wait(5)
    assert worker.stop(5)
    assert served == ['good'] and [str(e) for e in errors] == ['bad item']


def until(condition):
    end = time.monotonic() + 5
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


class Stage:
    """Items that are processed until they are let go, and what became of them."""

    def __init__(self, limit):
        self.begun, self.ended, self.alone = [], [], {}
        self.gates = {item: threading.Event() for item in 'abcd'}
        self.worker = Worker(lambda: None, self._process, lambda error: None, lambda: limit)
        self.worker.start()

    def _process(self, item, turn):
        self.begun.append(item)
        self.alone[item] = turn.is_alone
        assert self.gates[item].wait(5)
        if item == 'b':
            raise ValueError('b fails')
        turn.wait()
        self.ended.append(item)

    def submit(self, item, begins=True):
        """Submit an item; wait until it is begun, or for long enough to see that it is not."""
        replaced = self.worker.submit(item)
        if begins:
            until(lambda: item in self.begun)
        else:
            time.sleep(0.05)
        return replaced


def test_two_items_in_flight_end_in_the_order_in_which_they_came():
    stage = Stage(2)
    assert stage.submit('a') is None and stage.submit('c') is None
    assert stage.begun == ['a', 'c'] and stage.alone == {'a': True, 'c': False}
    # There is no room for a third: it waits in the slot, and a newer one replaces it.
    assert stage.submit('b', begins=False) is None
    assert stage.submit('d', begins=False) == 'b'
    stage.gates['c'].set()
    time.sleep(0.05)
    assert stage.ended == [] and stage.begun == ['a', 'c']
    stage.gates['a'].set()
    stage.gates['d'].set()
    until(lambda: len(stage.ended) == 3)
    assert stage.ended == ['a', 'c', 'd']
    assert stage.worker.stop(5)


def test_an_item_that_fails_holds_nobody_up():
    stage = Stage(2)
    stage.submit('b')
    stage.submit('c')
    stage.gates['c'].set()
    time.sleep(0.05)
    assert stage.ended == []
    stage.gates['b'].set()
    until(lambda: stage.ended == ['c'])
    assert stage.worker.stop(5)


def test_one_at_a_time_where_that_is_the_limit():
    stage = Stage(1)
    stage.submit('a')
    stage.submit('c', begins=False)
    assert stage.begun == ['a']
    stage.gates['a'].set()
    until(lambda: stage.begun == ['a', 'c'])
    assert stage.alone['c']
    stage.gates['c'].set()
    assert stage.worker.stop(5)


def test_afterwork_keeps_order_and_goes_on_after_an_exception():
    done, errors, served = threading.Event(), [], []
    afterwork = Afterwork(errors.append)
    for number in range(5):
        afterwork.submit(lambda number=number: served.append(10 // (number - 2)))
    afterwork.submit(done.set)
    assert done.wait(5)
    assert served == [-5, -10, 10, 5] and isinstance(errors[0], ZeroDivisionError)
