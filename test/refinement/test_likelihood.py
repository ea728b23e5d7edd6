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

"""The likelihood: every number against plain Python, the odds against the table."""

import dataclasses

import likelihood_reference
import numpy as np
import pytest

from stereo_refine_ros.refinement import likelihood
from stereo_refine_ros.refinement.likelihood import (
    Evidence, FEATURES, features_at, log_odds, misfit_around, PlaneMap, probability, roughness)
from stereo_refine_ros.refinement.tuning import ALIKE

SHAPE = (12, 20)
RING_REACH = int(np.abs(likelihood.RING).max())


def holed(rng, values, share):
    values = values.astype(np.float32)
    values[rng.random(values.shape) < share] = np.nan
    return values


def random_world(seed, scale=1, is_grey=False, has_right=True, shift=0):
    """Return candidates, a given map, planes and evidence, all near 5 px and full of holes."""
    rng = np.random.default_rng(seed)

    def noise(sigma=0.8):
        return 5 + shift + rng.normal(0, sigma, SHAPE)

    image = rng.integers(100, 130, (*SHAPE, 3), dtype=np.uint8)
    unknown = np.full(SHAPE, np.nan, np.float32)
    evidence = Evidence(
        image[..., 0].copy() if is_grey else image, scale, holed(rng, noise(), 0.3),
        holed(rng, noise(), 0.3) if has_right else unknown,
        rng.uniform(0, 2, SHAPE).astype(np.float32),
        holed(rng, noise(2), 0.3) if has_right else unknown, has_right)
    planes = PlaneMap(holed(rng, noise(), 0.2), rng.uniform(0, 1, SHAPE).astype(np.float32),
                      holed(rng, noise(), 0.3), unknown,
                      *rng.uniform(0, 1, (2, *SHAPE)).astype(np.float32))
    maps = np.stack([noise(), noise(2), noise() + 8]).astype(np.float32)
    return maps, holed(rng, noise(), 0.4), planes, evidence


@pytest.mark.parametrize('table', [likelihood.PAIR, likelihood.ALONE], ids=['pair', 'alone'])
def test_the_table_has_a_coefficient_for_every_feature(table):
    assert len(table) == len(FEATURES)
    assert np.isfinite(table).all()


@pytest.mark.parametrize('scale, is_grey, has_right, shift', [
    (1, False, True, 0), (2, False, True, 0), (1, True, True, 0), (2, True, False, 0),
    (1, False, True, -5)])  # around 0: partners beyond the last column too
def test_features_are_those_of_plain_python(scale, is_grey, has_right, shift):
    world = random_world(scale, scale, is_grey, has_right, shift)
    found = features_at(*world)
    assert found.shape == (3, *SHAPE, len(FEATURES)) and found.dtype == np.float32
    expected = likelihood_reference.features(*world)
    maps = world[0]
    alike = np.abs(maps - maps[0]) <= np.float32(ALIKE)  # these are judged as the first is
    expected[alike] = np.broadcast_to(expected[0], expected.shape)[alike]
    for i, name in enumerate(FEATURES):
        np.testing.assert_allclose(found[..., i], expected[..., i], rtol=1e-4, atol=1e-4,
                                   err_msg=name)
    # The world is wild enough to try them all.
    sides = {'coarse_far', 'transparent', 'disagreement_around'} if not has_right else set()
    assert all(np.ptp(expected[..., FEATURES.index(name)]) > 0
               for name in set(FEATURES) - {'bias'} - sides)


@pytest.mark.parametrize('has_right', [True, False])
def test_odds_are_the_features_times_the_table(monkeypatch, has_right):
    rng = np.random.default_rng(1)
    tables = rng.normal(0, 1, (2, len(FEATURES)))
    monkeypatch.setattr(likelihood, 'PAIR', tuple(tables[0]))
    monkeypatch.setattr(likelihood, 'ALONE', tuple(tables[1]))
    world = random_world(3, has_right=has_right)
    odds = log_odds(*world)
    assert odds.dtype == np.float32
    judged = features_at(*world) @ tables[0 if has_right else 1]
    # What is as good as the first candidate is not judged again.
    expected = np.where(np.abs(world[0] - world[0][0]) <= ALIKE, judged[0], judged)
    np.testing.assert_allclose(odds, expected, rtol=1e-3, atol=1e-4)


@pytest.mark.compiled
@pytest.mark.parametrize('threads', [2, 3, 5])
def test_threads_change_no_bit(threads):
    world = random_world(4)
    np.testing.assert_array_equal(log_odds(*world, threads=threads), log_odds(*world))


def test_what_is_judged_is_not_changed():
    maps, given, planes, evidence = world = random_world(5)
    arrays = [maps, given, *(getattr(part, field.name) for part in (planes, evidence)
                             for field in dataclasses.fields(part)
                             if isinstance(getattr(part, field.name), np.ndarray))]
    before = [array.copy() for array in arrays]
    log_odds(*world)
    for array, kept in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(array, kept)


def feature(name, maps, given, planes, evidence):
    return features_at(maps, given, planes, evidence)[0, ..., FEATURES.index(name)]


def flat_world(fine, z=5.0, image=None):
    """Return a world whose image is flat, and whose only map says z everywhere."""
    shape = fine.shape
    unknown = np.full(shape, np.nan, np.float32)
    zero = np.zeros(shape, np.float32)
    image = np.full(shape, 90, np.uint8) if image is None else image
    evidence = Evidence(image, 1, np.float32(fine), unknown, np.zeros(shape, np.float32), unknown)
    return (np.full((1, *shape), z, np.float32), unknown,
            PlaneMap(unknown, zero, unknown, unknown, zero, zero), evidence)


def test_by_hand_neighbours_vote():
    side = 2 * RING_REACH + 1
    middle = RING_REACH, RING_REACH
    count = len(likelihood.RING)
    world = flat_world(np.full((side, side), 5.0))
    assert feature('vote', *world)[middle] == pytest.approx((count + 0.5) / (count + 1) - 0.5)
    assert feature('around', *world)[middle] == 0.5
    world = flat_world(np.full((side, side), 50.0))
    assert feature('vote', *world)[middle] == pytest.approx(0.5 / (count + 1) - 0.5)
    world = flat_world(np.full((side, side), np.nan))
    assert feature('vote', *world)[middle] == 0 and feature('around', *world)[middle] == -0.5


def test_by_hand_neighbours_of_another_colour_hardly_vote():
    side = 2 * RING_REACH + 1
    image = np.full((side, side), 90, np.uint8)
    image[:, :RING_REACH] = 250
    fine = np.where(image == 90, 5.0, 50.0)
    # All that is dark agrees; light is far more, but of another colour.
    assert feature('vote', *flat_world(fine, image=image))[RING_REACH, RING_REACH] > 0.4


def test_by_hand_of_one_pixel():
    maps, given, planes, evidence = flat_world(np.full((3, 5), 5.25))
    given = np.full((3, 5), 5.5, np.float32)
    planes = dataclasses.replace(planes, values=np.full((3, 5), 4.75, np.float32),
                                 quality=np.full((3, 5), 0.8, np.float32))
    right = np.full((3, 5), np.nan, np.float32)
    right[:, 1] = 2.0
    evidence = dataclasses.replace(
        evidence, coarse=np.full((3, 5), 6.5, np.float32), right=right,
        uniqueness=np.full((3, 5), 1.5, np.float32))
    maps[:, :, 4] = 3.0
    found = dict(zip(FEATURES, features_at(maps, given, planes, evidence)[0, 1, 3], strict=True))
    assert found['fine_near'] == 0.75 and found['uniqueness'] == 1.5
    assert found['plane_near'] == pytest.approx(0.6) and found['plane_far'] == 0
    assert (found['given_far'], found['hole'], found['coarse_far']) == (0, 0, 1)
    assert found['unseen'] == 1  # column 3 - 5 lies outside the right view
    found = dict(zip(FEATURES, features_at(maps, given, planes, evidence)[0, 1, 4], strict=True))
    assert found['given_far'] == 1 and found['plane_far'] == pytest.approx(0.8)
    # Column 4 - 3 of the right view shows 2: nothing nearer hides behind that.
    assert (found['unseen'], found['transparent']) == (0, 0)
    maps[:, :, 4] = 3.25
    assert feature('transparent', maps, given, planes, evidence)[1, 4] == 1


def test_roughness_by_hand():
    values = np.float32([[1, 2, 3, 4], [1, 2, 3.5, 4], [1, 2, 3, 9], [1, 2, 3, np.nan]])
    bend = roughness(values)
    assert np.isnan(bend[[0, -1]]).all() and np.isnan(bend[:, [0, -1]]).all()
    # Across 0.5 and 1 (as along); at the step of 5 it counts 1.
    assert bend[1, 1:3].tolist() == [0.25, 1.0] and bend[2, 1:3].tolist() == [0.0, 0.75]
    assert np.isnan(roughness(values[:2])).all()
    assert np.isnan(roughness(np.full((5, 5), np.nan, np.float32))).all()


def test_a_slanted_plane_is_not_rough():
    y, x = np.indices((6, 7))
    assert np.nanmax(roughness((0.5 * x - 0.25 * y).astype(np.float32))) == 0


def test_odds_become_probabilities():
    odds = np.float32([-np.inf, -40, 0, np.log(3), 40])
    np.testing.assert_allclose(probability(odds), [0, 0, 0.5, 0.75, 1], atol=1e-6)
    assert probability(odds).dtype == np.float32


def test_misfit_is_the_mean_distance_from_planes_where_both_are_known():
    fine, planes = np.full((30, 30), 5, np.float32), np.full((30, 30), 5.5, np.float32)
    np.testing.assert_allclose(misfit_around(fine, planes), 0.5, rtol=1e-6)
    np.testing.assert_allclose(misfit_around(fine, planes + 7), 1, rtol=1e-6)
    fine[:, 15:] = np.nan  # unknown ones count neither way
    np.testing.assert_allclose(misfit_around(fine, planes)[:, :20], 0.5, rtol=1e-5)
    assert misfit_around(fine, planes)[0, 29] == 0
