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

"""Pairing by stamp: exact, approximate, bounded, and robust to clocks that jump."""

from hypothesis import given, settings, strategies as st
import pytest

from stereo_refine_ros.pairing import ALIVE_S, GRACE_S, Pairing

MS = 1_000_000


def feed(pairing, *arrivals, now=0.0):
    """Add 'topic' at a stamp, one after another; return the stamps of the sets, flat."""
    ready = []
    for topic, stamp in arrivals:
        ready += pairing.add(topic, stamp, (topic, stamp), now)
    return ready


def stamps(ready):
    return [found.stamp_ns for found in ready]


@pytest.fixture
def exact():
    return Pairing(('left', 'right', 'info'), queue_size=3)


def test_pairs_equal_stamps_in_any_order_of_topics(exact):
    ready = feed(exact, ('info', 5), ('right', 5), ('left', 5))
    assert [found.messages for found in ready] == [
        {'left': ('left', 5), 'right': ('right', 5), 'info': ('info', 5)}]
    assert exact.unmatched == 0


def test_stamps_that_differ_do_not_pair(exact):
    assert feed(exact, ('left', 5), ('right', 6), ('info', 5)) == []


def test_older_messages_are_dropped_with_a_pair_and_counted(exact):
    ready = feed(exact, ('left', 1), ('left', 2), ('right', 2), ('info', 2))
    assert stamps(ready) == [2]
    assert exact.unmatched == 1
    assert feed(exact, ('right', 1), ('info', 1)) == []


def test_queues_are_bounded_and_overflow_is_counted(exact):
    feed(exact, *(('left', stamp) for stamp in range(10)))
    assert list(exact.topics['left'].queue) == [7, 8, 9]
    assert exact.unmatched == 7


def test_stamp_zero_and_repeated_stamps_pair_each_time(exact):
    for _ in range(3):
        assert stamps(feed(exact, ('left', 0), ('right', 0), ('info', 0))) == [0]
    assert exact.unmatched == 0


def test_a_repeated_message_replaces_the_first(exact):
    exact.add('left', 4, 'old', 0.0)
    exact.add('left', 4, 'new', 0.0)
    ready = feed(exact, ('right', 4), ('info', 4))
    assert ready[0].messages['left'] == 'new'
    assert exact.unmatched == 1


def test_a_looped_bag_keeps_pairing(exact):
    first = feed(exact, ('left', 100), ('right', 100), ('info', 100), ('left', 200))
    again = feed(exact, *((topic, stamp) for stamp in (10, 20, 30)
                          for topic in ('left', 'right', 'info')))
    assert stamps(first + again) == [100, 10, 20, 30]
    assert exact.unmatched == 1  # the left image of 200


def test_approximate_pairs_within_the_slop_only():
    pairing = Pairing(('left', 'right'), slop_ns=5 * MS)
    assert stamps(feed(pairing, ('left', 0), ('right', 5 * MS))) == [0]
    assert feed(pairing, ('left', 100 * MS), ('right', 106 * MS)) == []


def test_approximate_takes_the_nearest_and_drops_the_older():
    pairing = Pairing(('left', 'right'), slop_ns=5 * MS)
    ready = feed(pairing, ('right', 0), ('right', 4 * MS), ('left', 5 * MS))
    assert ready[0].messages == {'left': ('left', 5 * MS), 'right': ('right', 4 * MS)}
    assert pairing.topics['right'].unmatched == 1


def test_approximate_limits_the_spread_of_all_topics():
    pairing = Pairing(('left', 'right', 'info'), slop_ns=5 * MS)
    assert feed(pairing, ('left', 0), ('info', 8 * MS), ('right', 4 * MS)) == []


def test_a_silent_optional_topic_is_not_waited_for():
    pairing = Pairing(('left',), ('truth',))
    ready = feed(pairing, ('left', 1), now=10.0)
    assert ready[0].messages == {'left': ('left', 1)}


def test_an_expected_optional_topic_is_waited_for():
    pairing = Pairing(('left',), ('truth',))
    pairing.expect('truth', 10.0)
    assert feed(pairing, ('left', 1), now=10.0) == []
    assert pairing.holds
    ready = feed(pairing, ('truth', 1), now=10.01)
    assert set(ready[0].messages) == {'left', 'truth'}
    assert not pairing.holds


def test_waiting_ends_after_the_grace():
    pairing = Pairing(('left',), ('truth',))
    pairing.expect('truth', 10.0)
    feed(pairing, ('left', 1), now=10.0)
    assert pairing.release(10.0 + GRACE_S / 2) == []
    assert stamps(pairing.release(10.0 + GRACE_S)) == [1]


def test_waiting_ends_with_the_next_set():
    pairing = Pairing(('left',), ('truth',))
    pairing.expect('truth', 10.0)
    feed(pairing, ('left', 1), now=10.0)
    assert stamps(feed(pairing, ('left', 2), now=10.01)) == [1, 2]  # and the truth is out of step


def test_an_optional_topic_that_falls_silent_is_no_longer_waited_for():
    pairing = Pairing(('left',), ('truth',))
    feed(pairing, ('truth', 1), ('left', 1), now=10.0)
    assert stamps(feed(pairing, ('left', 2), now=10.0 + ALIVE_S)) == [2]


def test_an_optional_topic_out_of_step_is_not_waited_for_until_it_is_back():
    """A camera_info that comes once a second must not hold up the images between."""
    pairing = Pairing(('left',), ('info',))
    assert stamps(feed(pairing, ('info', 1), ('left', 1), now=10.0)) == [1]
    assert feed(pairing, ('left', 2), now=10.01) == []  # in step: it is waited for
    assert stamps(pairing.release(10.01 + GRACE_S)) == [2]
    assert stamps(feed(pairing, ('left', 3), now=10.3)) == [3]
    assert feed(pairing, ('info', 3), now=10.31) == []  # late, but before the next image
    assert feed(pairing, ('left', 4), now=10.33) == []
    ready = feed(pairing, ('info', 4), now=10.34)
    assert set(ready[0].messages) == {'left', 'info'}


def test_messages_are_kept_for_their_age_within_a_number_of_bytes(monkeypatch):
    pairing = Pairing(('left', 'map'), queue_size=2, keep_s=3.0)
    for stamp in range(60):  # two seconds at 30 a second
        feed(pairing, ('left', stamp), now=stamp / 30)
    assert stamps(feed(pairing, ('map', 5), now=2.0)) == [5]
    feed(pairing, ('left', 60), now=10.0)
    assert list(pairing.topics['left'].queue) == [59, 60]
    monkeypatch.setattr('stereo_refine_ros.pairing.MOST_BYTES', 250)

    class Message:
        data = bytes(100)
    for stamp in range(100, 110):
        pairing.add('left', stamp, Message(), 10.0)
    assert list(pairing.topics['left'].queue) == [108, 109]


@settings(max_examples=200, deadline=None)
@given(arrivals=st.lists(st.tuples(
    st.sampled_from(['left', 'right', 'truth']), st.integers(-5, 20)), max_size=80),
    slop=st.sampled_from([0, 2]))
def test_every_message_is_used_queued_or_counted(arrivals, slop):
    pairing = Pairing(('left', 'right'), ('truth',), slop_ns=slop, queue_size=4)
    ready = feed(pairing, *arrivals)
    held = pairing.release(1e9)
    for topic in ('left', 'right', 'truth'):
        state = pairing.topics[topic]
        used = sum(topic in found.messages for found in ready + held)
        assert state.received == used + len(state.queue) + state.unmatched
        assert len(state.queue) <= 4
    for found in ready + held:
        assert abs(found.messages['left'][1] - found.messages['right'][1]) <= slop
