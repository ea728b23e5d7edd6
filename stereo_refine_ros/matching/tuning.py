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
Tuning of the matchers: what each constant is measured in, does, and rests on.

"Not measured separately": kept as it was when the whole was last measured, by
`python benchmarks/accuracy.py`. The tree matchers follow their papers (Yang 2012).
"""

# Tree cost, ratio: weight of colour; the gradient has the rest. Yang 2012.
COLOR_WEIGHT = 0.11
# Tree cost, grey levels: a mean colour difference above this counts as this. Yang 2012.
COLOR_LIMIT = 7.0
# Tree cost, grey levels a pixel: the same for the difference of the gradients. Yang 2012.
GRADIENT_LIMIT = 2.0
# Trees, units of 255 grey levels: support falls to 1 / e over a path of this length. Larger: more
# support from farther away; the refinement of the papers takes half of it. Yang 2012.
TREE_SIGMA = 0.1
# Trees, pixels: side of the medians over the winners and after the refinement. Larger: fewer
# specks, fewer thin things. Not measured separately.
TREE_MEDIAN = 5

# SGBM, pixels: side of the block. Larger: smoother, and wider shadows at edges. Not measured
# separately.
SGBM_BLOCK = 3
# SGBM, grey levels a pixel: gradients above this count as this. Not measured separately.
SGBM_PREFILTER = 15
# BM, pixels: side of the block. Not measured separately.
BM_BLOCK = 15
# OpenCV's matchers: pixels that left and right may differ by; percent by which the best cost must
# win; pixels of a speckle, and pixels of disparity within one. OpenCV's usual ones.
OPENCV_CHECKS = {
    'disp12MaxDiff': 1, 'uniquenessRatio': 10, 'speckleWindowSize': 100, 'speckleRange': 2}

# Memory, bytes for a pixel and a disparity of a cost volume: more is refused than the machine
# has. At the peak 5.7 were measured: python reliability/large_pair.py.
BYTES_PER_CELL = 8
# Memory, bytes for a pixel of the scanline matcher, whatever the number of disparities: planes of
# features, maps and what refines them.
BYTES_PER_PIXEL = 120

# Scanline cost, grey levels a pixel: both gradients' differences together count as this at most.
# benchmarks/field.py, bad % of the preliminary map, KITTI / ETH3D / Middlebury / lab: 10 gives
# 5.0 / 7.5 / 17.8 / 8.8, 14 gives 4.6 / 7.6 / 18.0 / 9.0.
GRADIENT_CAP = 14
# Scanline cost, bits: the differing bits of both censuses together count as this at most.
# Larger: noise and repetition outvote the rest (28: ETH3D 8.7).
CENSUS_CAP = 20
# Scanline cost, pixels: the steps that the two censuses look at. What becomes of the own map in
# `accurate` (benchmarks/field.py before the likelihood was fitted to it; KITTI / ETH3D /
# Middlebury / lab): (1, 2) 3.6 / 4.8 / 14.8 / 6.3, (1, 3) 3.5 / 4.8 / 14.4 / 6.6, (1, 4) 3.7 / 5.0
# / 13.3 / 6.6, (1, 1) 3.7 / 5.4 / 15.7 / 6.1; (1, 3) with a blur of 3x3 before the second 3.4 /
# 4.5 / 15.9 / 6.8: a blur makes the near surface wider.
# Of the second census only pixels count that no edge (EDGE_STEP) parts from the middle one. With
# all of them, and the likelihood of then: 3.6 / 4.8 / 12.8 / 6.5; without those beyond an edge of
# a grey image alone 3.6 / 4.7 / 12.3 / 6.3, of any channel 3.6 / 4.7 / 12.2 / 6.2.
CENSUS_STRIDES = (1, 3)
# Scanline cost: of a partner outside the right view: worse than a fair match, better than a bad
# one. Two thirds of the caps' sum.
OUT_OF_VIEW = 22
# Scanline penalties P1 and P2, units of cost: along rows, then along columns (floors and tables
# change their disparity from row to row). Half of these: KITTI 5.8, ETH3D 12.9; 1.4 times: ETH3D
# 7.1, the rest 0.3 worse.
PENALTIES = ((55, 147), (33, 114))
# Scanline penalties, ratio: what is left of them across an edge of the left view, and grey levels
# that make a step an edge. What becomes of the own map in `accurate`, with 0.25: 3.5 / 4.8 / 14.4
# / 6.6, with 0.1: 3.6 / 4.7 / 12.9 / 6.2.
EDGE_FACTOR, EDGE_STEP = 0.1, 20
# Scanline, pixels: with more disparities than FULL_RANGE, half size comes first, and full size in
# windows of WINDOW around it that hold the pixel's own value at least WINDOW_MARGIN inside.
# FULL_RANGE 64 instead, filled map: bad-1 % of Pipes 24.9 for 22.3, of Reindeer_half 13.0 for
# 11.8; bad-3 % of KITTI 000120_10 12.6 for 12.5, of 000168_10 6.4 for 6.2.
FULL_RANGE, WINDOW, WINDOW_MARGIN = 256, 32, 3
# Scanline, parts of the image: matched regions smaller than one part in this many are chance.
ISLANDS = 3500
# Scanline: of left pixels that claim one right pixel, the one with the least total of the paths,
# each less its own least, plus so many times its cost, keeps it. 8, 16, 32, 1000 instead, own map
# of `live`, before the likelihood was fitted to it, bad-1 % (KITTI bad-3): lab 7.04, 6.99, 6.97,
# 6.93; KITTI 3.41, 3.35, 3.48, 3.58; ETH3D 5.23, 5.26, 5.32, 5.33; Middlebury 13.18, 12.88, 12.50,
# 12.42.
COST_WEIGHT = 20
# Scanline, units of cost summed over the paths: what `uniqueness` counts as one.
UNIQUENESS_UNIT = 100.0
