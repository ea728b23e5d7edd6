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

import math

import numpy as np

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

# Likelihood, pixels of the grid: where the neighbours sit that are asked, (down, right): rings of
# 4, 6, 7 and 7 at radius 2, 4, 8 and 14. More of them change nothing (prototype of 44 features).
RING = np.array([
    (round(radius * math.sin(angle + radius)), round(radius * math.cos(angle + radius)))
    for radius, count in ((2, 4), (4, 6), (8, 7), (14, 7))
    for angle in (2 * math.pi * i / count for i in range(count))], np.int64)
# Likelihood, pixels: how far a neighbour's match may be off to agree, and what a pixel of distance
# adds, since surfaces slant.
REACH, REACH_GROWTH = 1.0, 0.1
# Likelihood, grey levels: a neighbour that differs by this counts half.
COLOR_SCALE = 8.0
# Likelihood, pixels of the grid: window of the roughness of the map given.
LOCAL_WINDOW = 9
# Likelihood, pixels of the grid: windows over how unique matches are around a pixel, by how much
# those at full and at half resolution differ, and by how much they are off their planes. The first
# of 9 instead: the same log loss, and the area under the sparsification curve of KITTI is 2 %
# larger.
UNIQUE_WINDOW, AROUND_WINDOW, MISFIT_WINDOW = 25, 9, 15
# Choice, pixels: candidates nearer than this are one.
ALIKE = 0.4
# Choice, units of 255 grey levels: colour change that a pixel's vote survives.
VOTE_SIGMA = 0.02
# Confidence, units of 255 grey levels: the same for what neighbours of like colour say of their
# own disparities. Without them the area under the sparsification curve is a tenth larger.
SETTLE_SIGMA = 0.05
# Choice, log-odds: how much likelier than a hole filled from the background another candidate must
# be. 1.1: Rocks1 gets worse by 0.5 instead of 0.2 (live), the lab gains 0.4; 1.4: the lab loses
# 0.1, Middlebury 0.2 (benchmarks/field.py, own map).
MARGIN_HOLE = 1.2
# Choice, log-odds: the same for a given disparity: MARGIN_GIVEN - MARGIN_SLOPE x roughness, within
# MARGINS; the roughness of the whole map is about -2 for a network's, 1 for a matcher's.
# HITNet on KITTI: 1.5 makes 000168_10 worse by 0.2 (benchmarks/field.py, live), this none by 0.1.
MARGIN_GIVEN, MARGIN_SLOPE, MARGINS = 2.0, 2.0, (0.7, 5.0)
# Planes, ratio: what an adopted plane is believed like: as one with so many inliers.
ADOPTED_QUALITY = 0.3
# In time, grey levels: a pixel stands still where no blurred grey level within 5x5 changed by
# more than this, and by so many standard deviations of the noise.
UNCHANGED, UNCHANGED_NOISE = 2.0, 1.5
# In time, pixels of disparity: a smaller change is noise of one surface.
SAME_SURFACE = 1.0
# In time, frames: so many are averaged at most. Larger: steadier; what moves together is followed
# at once whatever this is.
FRAMES_AVERAGED = 5
# In time, pixels: window over which what moves together is found.
FOLLOW_WINDOW = 15
# In time, ratio: what is left of the last frame's confidence in each next one.
FADE_OF_LAST = 0.85
# Confidence, grey levels, parts of the width, log-odds: where the standard deviation within a
# window of this part of the width is below that, nothing is there to match. Such a pixel is so
# much less likely right. It costs the field's area under the curve 3 % (benchmarks/field.py), and
# a covered lens or a plain view is no longer sure.
PLAIN_CONTRAST, PLAIN_PARTS, PLAIN_ODDS = 1.0, 12, 5.0
