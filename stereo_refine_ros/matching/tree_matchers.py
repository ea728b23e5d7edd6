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

"""Matching by aggregation on a tree: non-local (Yang 2012), segment tree (Mei et al. 2013)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from stereo_refine_ros.graph.pixel_graph import edge_weights
from stereo_refine_ros.graph.trees import aggregate, minimum_tree, PixelTree, segment_tree, Weights
from stereo_refine_ros.matching.consistency import left_right_check
from stereo_refine_ros.matching.cost_volume import truncated_cost
from stereo_refine_ros.matching.disparity_selection import select_winners, subpixel_offsets
from stereo_refine_ros.matching.match import Match
from stereo_refine_ros.matching.tree_filter import spread_over_tree
from stereo_refine_ros.matching.tuning import TREE_MEDIAN, TREE_SIGMA
from stereo_refine_ros.params import MatchingParams
from stereo_refine_ros.threads import start
from stereo_refine_ros.types import DisparityMap, FloatMap, Image, StereoPair


TreeBuilder = Callable[[Weights], PixelTree]


@dataclass(frozen=True, eq=False)
class _View:
    """One view after aggregation: its costs, its tree and its whole-pixel winners."""

    volume: FloatMap
    tree: PixelTree
    winners: FloatMap


def match_non_local(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """Match by aggregation on the minimum spanning tree of the image; see `_match_on_tree`."""
    return _match_on_tree(pair, params, minimum_tree, threads)


def match_segment_tree(pair: StereoPair, params: MatchingParams, threads: int = 1) -> Match:
    """Match by aggregation on the segment tree of the image; see `_match_on_tree`."""
    return _match_on_tree(pair, params, segment_tree, threads)


def _match_on_tree(pair: StereoPair, params: MatchingParams, build: TreeBuilder,
                   threads: int) -> Match:
    """
    Aggregate on a tree in each view, check left against right, and refine if asked to.

    With `nonlocal_refinement` the disparity is dense and whole, as its authors have it;
    without, it is sub-pixel and NaN where the check failed. `subpixel` is the latter in any
    case.
    """
    left, right = _aggregate_views(pair, params, build, threads)
    colour_tree = left.tree
    if params.second_pass:
        left, right = _aggregate_views(pair, params, build, threads, (left, right))
    stable = left_right_check(left.winners, right.winners, 0.0)
    # A winner at the start of the range has no cost before it that it would be below of.
    stable &= left.winners > params.min_disparity
    indices = (left.winners - params.min_disparity).astype(np.int32)
    subpixel = left.winners + subpixel_offsets(left.volume, indices)
    subpixel[~stable] = np.nan
    values = subpixel
    if params.nonlocal_refinement:
        refined = spread_over_tree(
            np.where(stable, left.winners, np.float32(np.nan)), colour_tree, params.min_disparity,
            params.num_disparities, TREE_SIGMA / 2, threads=threads)
        values = cv2.medianBlur(refined, TREE_MEDIAN)
    disparity = DisparityMap(values, params.min_disparity, params.num_disparities)
    return Match(disparity, subpixel=subpixel)


def _aggregate_views(pair: StereoPair, params: MatchingParams, build: TreeBuilder, threads: int,
                     first_pass: tuple[_View, _View] | None = None) -> tuple[_View, _View]:
    assert pair.right is not None
    guides = (None, None) if first_pass is None else tuple(view.winners for view in first_pass)
    right = start(threads, _aggregate_view, pair.right, pair.left, False, guides[1], params, build)
    left = _aggregate_view(pair.left, pair.right, True, guides[0], params, build)
    return left, right.result()


def _aggregate_view(base: Image, other: Image, is_left: bool, guide: FloatMap | None,
                    params: MatchingParams, build: TreeBuilder) -> _View:
    weights = edge_weights(cv2.medianBlur(base, 3))
    if guide is not None:
        weights = _mix(weights, guide, params.num_disparities)
    tree = build(weights)
    volume = truncated_cost(base, other, params.min_disparity, params.num_disparities, is_left)
    aggregate(volume, tree, TREE_SIGMA)
    winners = (select_winners(volume) + params.min_disparity).astype(np.float32)
    return _View(volume, tree, cv2.medianBlur(winners, TREE_MEDIAN))


def _mix(colour: Weights, disparity: FloatMap, num_disparities: int) -> Weights:
    """
    Weigh edges by colour + 255 |dd| / D: the second pass of the segment tree (ST-2).

    Its authors halve both terms; here colour keeps its scale, and with it sigma its meaning.
    """
    jump = np.zeros(colour.shape, np.float32)
    jump[:, :-1, 0] = np.abs(np.diff(disparity, axis=1))
    jump[:-1, :, 1] = np.abs(np.diff(disparity, axis=0))
    mixed = colour + jump * np.float32(255 / num_disparities)
    return np.minimum(np.rint(mixed), 255).astype(np.uint8)
