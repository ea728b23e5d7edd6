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

"""The newest item, a few in work, delivered in order; and what is owed afterwards."""

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


def until(condition):
    end = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


class Stage:
    """Items that are refined until they are let go, and what became of them."""

    def __init__(self, limit):
        self.begun, self.refined, self.delivered, self.errors = [], [], [], []
        self.alone = {}
        self.gates = {item: threading.Event() for item in 'abcd'}
        self.worker = Worker(
            lambda: None, self._refine, self.delivered.append, self.errors.append,
            lambda: limit)
        self.worker.start()

    def _refine(self, item, is_alone):
        self.begun.append(item)
        self.alone[item] = is_alone
        assert self.gates[item].wait(10)
        self.refined.append(item)
        if item == 'b':
            raise ValueError('b fails')
        return item

    def begin(self, item):
        assert self.worker.submit(item) is None
        until(lambda: item in self.begun)

    def let_go(self, *items):
        for item in items:
            self.gates[item].set()
        until(lambda: set(items) <= set(self.refined))


def test_two_items_in_work_are_delivered_in_the_order_in_which_they_came():
    stage = Stage(2)
    stage.begin('a')
    stage.begin('c')
    assert stage.begun == ['a', 'c'] and stage.alone == {'a': True, 'c': False}
    # There is no room for a third: it waits in the slot, where a newer one replaces it.
    assert stage.worker.submit('b') is None
    assert stage.worker.submit('d') == 'b'
    stage.let_go('c')
    assert stage.delivered == [] and stage.begun == ['a', 'c']
    stage.let_go('a', 'd')
    until(lambda: len(stage.delivered) == 3)
    assert stage.delivered == ['a', 'c', 'd']
    assert stage.worker.stop(10)


def test_an_item_that_fails_holds_nobody_up():
    stage = Stage(2)
    stage.begin('b')
    stage.begin('c')
    stage.let_go('c')
    assert stage.delivered == []
    stage.let_go('b')
    until(lambda: stage.delivered == ['c'])
    assert [str(error) for error in stage.errors] == ['b fails']
    assert stage.worker.stop(10)


def test_one_at_a_time_where_that_is_the_limit():
    stage = Stage(1)
    stage.begin('a')
    assert stage.worker.submit('c') is None
    assert stage.worker.submit('d') == 'c'  # nobody had taken it
    assert stage.begun == ['a']
    stage.let_go('a', 'd')
    until(lambda: stage.delivered == ['a', 'd'])
    assert stage.alone == {'a': True, 'd': True}
    assert stage.worker.stop(10)


def test_a_delivery_that_fails_and_a_preparation_that_fails_cost_themselves():
    delivered, errors = [], []

    def deliver(item):
        if item == 'bad':
            raise ValueError('bad item')
        delivered.append(item)

    worker = Worker(lambda: 1 / 0, lambda item, _: item, deliver, errors.append)
    worker.start()
    worker.submit('bad')
    until(lambda: len(errors) == 2)
    worker.submit('good')
    until(lambda: delivered == ['good'])
    assert [type(error) for error in errors] == [ZeroDivisionError, ValueError]
    assert worker.stop(10)


def test_a_worker_that_has_room_and_no_item_ends_when_told():
    worker = Worker(lambda: None, lambda item, _: item, lambda _: None, lambda _: None)
    worker.start()
    assert worker.stop(10)


def test_afterwork_keeps_order_and_goes_on_after_an_exception():
    done, errors, served = threading.Event(), [], []
    afterwork = Afterwork(errors.append)
    for number in range(5):
        afterwork.submit(lambda number=number: served.append(10 // (number - 2)))
    afterwork.submit(done.set)
    assert done.wait(10)
    assert served == [-5, -10, 10, 5] and isinstance(errors[0], ZeroDivisionError)
    assert afterwork.stop(10)


def test_afterwork_that_hangs_does_not_hold_up_the_end():
    gate = threading.Event()
    afterwork = Afterwork(lambda _: None)
    afterwork.submit(gate.wait)
    assert not afterwork.stop(0.01)
    gate.set()
    assert afterwork.stop(10)
