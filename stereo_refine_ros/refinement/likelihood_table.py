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
    -0.2550,  # bias
    2.5153,  # vote
    0.3938,  # around
    1.0047,  # plane_near
    -0.5886,  # plane_far
    -0.5884,  # given_far
    -0.3524,  # smooth_given
    0.2654,  # smooth_ungiven
    1.2210,  # fine_near
    -0.8767,  # coarse_far
    0.4144,  # uniqueness
    -0.5652,  # bend
    -0.5329,  # transparent
    -0.1788,  # unseen
    -0.1531,  # hole
    0.9302,  # hole_vote
    -0.5664,  # hole_plane
    0.5451,  # hole_behind
    -0.2385,  # border
    0.7341,  # border_plane
    -0.0203,  # border_behind
    0.3490,  # uniqueness_around
    -0.3694,  # disagreement_around
    0.8672,  # slant
    -0.5428,  # misfit
)

ALONE = (
    -0.7633,  # bias
    2.5324,  # vote
    1.3420,  # around
    2.1326,  # plane_near
    -0.5751,  # plane_far
    -0.2423,  # given_far
    -0.1864,  # smooth_given
    0.2944,  # smooth_ungiven
    1.6072,  # fine_near
    0.0000,  # coarse_far
    0.0000,  # uniqueness
    -0.7200,  # bend
    0.0000,  # transparent
    -1.0267,  # unseen
    1.3303,  # hole
    -0.2175,  # hole_vote
    -1.3028,  # hole_plane
    0.6116,  # hole_behind
    0.4835,  # border
    0.6425,  # border_plane
    -0.3520,  # border_behind
    0.0000,  # uniqueness_around
    -0.7633,  # disagreement_around
    0.2257,  # slant
    -1.0265,  # misfit
)
