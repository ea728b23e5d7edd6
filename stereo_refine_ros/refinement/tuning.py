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
Tuning of planes and filters: what each constant is measured in, does, and rests on.

"Not measured separately": kept as it was when the whole was last measured, by
`python benchmarks/accuracy.py`.
"""

# Fit, pixels: fewer data than this say nothing about a slanted plane. Larger: more segments adopt
# a neighbour's. Not measured separately.
MIN_DATA = 30
# Fit, pixels: how many points the hypotheses are scored on. Larger: slower; which hypothesis wins
# stays the same. Not measured separately.
SCORED_POINTS = 200
# Fit, hypotheses: so many of the first are fronto-parallel, because on narrow segments a slant is
# noise. Not measured separately.
FRONTO_PARALLEL = 5
# Fit, pixels of disparity a pixel: the steepest plane. Larger: steeper floors, wilder fits. Not
# measured separately.
MAX_SLOPE_X, MAX_SLOPE_Y = 0.7, 1.5
# Fit, times: least squares over the inliers, each time found again. Not measured separately.
REFITS = 3
# Fit, pixels^2: pulls the slope of small segments to zero, weighed against n times the variance
# of x and y. Not measured separately.
RIDGE = 30.0
# Planes, pixels: how far beyond the disparities of its inliers a plane is believed. Not measured
# separately.
EXTRAPOLATION = 3.0
# Merging, pixels^2: how much the residual variance of either part may rise for two segments to be
# one plane. Larger: larger planes, rounder corners. Not measured separately.
MERGE_RISE = 0.15
# Adoption, segments: how far a plane is handed on from neighbour to neighbour. Not measured
# separately.
ADOPTION_PASSES = 20

# Trilateral, sigmas of disparity: from there on the weight is 0. Not measured separately.
TRILATERAL_REACH = 4.0
# Weighted median: windows of radius 6 and more are sampled on a grid of so many pixels a side.
# Larger: slower. Their squares times the largest weight must fit 16 bits.
MEDIAN_SAMPLES = 11
# Weighted median, pixels: steps in which disparities are compared. Smaller: a smaller range fits
# 16 bits.
MEDIAN_STEP = 1.0 / 16.0
