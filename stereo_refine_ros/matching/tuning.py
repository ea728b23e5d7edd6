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
# has. At the peak 5.7 were measured: python benchmarks/large_pair.py.
BYTES_PER_CELL = 8
