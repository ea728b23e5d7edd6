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

"""Coefficients of the likelihood: made by scripts/fit_likelihood.py."""

PAIR = (
    -1.4516,  # bias
    2.2485,  # vote
    0.1058,  # around
    1.0273,  # plane_near
    -0.5841,  # plane_far
    -0.5571,  # given_far
    -0.3788,  # smooth_given
    0.2827,  # smooth_ungiven
    1.0407,  # fine_near
    -0.5896,  # coarse_far
    0.5783,  # uniqueness
    -0.5930,  # bend
    -0.4973,  # transparent
    0.0589,  # unseen
    -0.0947,  # hole
    0.9386,  # hole_vote
    -0.7152,  # hole_plane
    0.4144,  # hole_behind
    -0.3339,  # border
    0.8469,  # border_plane
    0.0354,  # border_behind
    0.7059,  # uniqueness_around
    0.2683,  # disagreement_around
    0.4502,  # slant
    -0.4326,  # misfit
)

ALONE = (
    -0.7024,  # bias
    2.5447,  # vote
    1.4453,  # around
    2.0041,  # plane_near
    -0.5016,  # plane_far
    -0.2721,  # given_far
    -0.2428,  # smooth_given
    0.2573,  # smooth_ungiven
    1.4683,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.7098,  # bend
    0.0000,  # transparent
    -0.9359,  # unseen
    1.2457,  # hole
    -0.1809,  # hole_vote
    -1.1032,  # hole_plane
    0.3857,  # hole_behind
    0.4742,  # border
    0.5414,  # border_plane
    -0.2099,  # border_behind
    0.0000,  # uniqueness_around
    -0.7024,  # disagreement_around
    0.1926,  # slant
    -1.1232,  # misfit
)
