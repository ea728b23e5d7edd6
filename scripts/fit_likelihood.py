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
Fit the likelihood model: the coefficients in stereo_refine_ros/refinement/likelihood_table.py.

From every scene with ground truth of the lab (middlebury) and the field (field/kitti2012,
field/eth3d, field/middlebury) below --data: the own map, SGBM's and BM's as they come and filled
(so that "dense" does not come to mean "trust"), and the network's where there is one; on both
grids; with and without the right view. Pixels whose columns cannot be believed to a pixel, since
rows are bent there, teach nothing. Each set weighs the same. Newton's method on the
log-likelihood with a small ridge. --leave-out SET fits without a set, to see that the model
carries over to sets that it has not seen; --write replaces the table.

    python scripts/fit_likelihood.py --data ../shared --write
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
import sys
from typing import NamedTuple

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'benchmarks')]

from field_scenes import FieldScene, read_field_scene, scene_folders, SETS  # noqa: E402, I100

from stereo_refine_ros.graph.segment_graph import build_segment_graph  # noqa: E402
from stereo_refine_ros.health.pair import PairExaminer  # noqa: E402
from stereo_refine_ros.levels import grid_scale, to_grid  # noqa: E402
from stereo_refine_ros.matching import compute_match  # noqa: E402
from stereo_refine_ros.matching.match import Match  # noqa: E402
from stereo_refine_ros.params import load_preset, Params  # noqa: E402
from stereo_refine_ros.rectification import columns_hold  # noqa: E402
from stereo_refine_ros.refinement.candidates import propose  # noqa: E402
from stereo_refine_ros.refinement.evidence import gather_evidence, match_half  # noqa: E402
from stereo_refine_ros.refinement.filling import fill_from_background  # noqa: E402
from stereo_refine_ros.refinement.likelihood import FEATURES, features_at  # noqa: E402
from stereo_refine_ros.refinement.plane_stage import PlaneStage, share_planes  # noqa: E402
from stereo_refine_ros.refinement.tuning import ALIKE  # noqa: E402
from stereo_refine_ros.types import DisparityMap, FloatMap, StereoPair  # noqa: E402

TABLE = ROOT / 'stereo_refine_ros' / 'refinement' / 'likelihood_table.py'
PIXELS = 1000  # of every map
HOLD = 0.95  # how sure the columns of a pixel must be
RIDGE, STEPS = 3.0, 10
PRESETS = ('live', 'accurate')


class Rows(NamedTuple):
    """Features and whether each was right, of one scene."""

    group: str
    has_right: bool
    features: FloatMap
    is_right: np.ndarray


def given_maps(pair: StereoPair, scene: FieldScene, own: Match, params: Params,
               ) -> Iterator[FloatMap]:
    """Yield the maps that the model learns from."""
    yield own.disparity.values
    for method in ('sgbm', 'bm'):
        matching = params.updated({'matching.method': method}).matching
        values = compute_match(pair, matching, 2).disparity.values
        yield values
        yield fill_from_background(values)
    if scene.network is not None:
        yield scene.network


def rows_of(scene: FieldScene, preset: str, rng: np.random.Generator) -> Iterator[Rows]:
    """Gather training rows of a scene with the grid and the planes of a preset."""
    params = load_preset(preset, {'matching.num_disparities': scene.num_disparities})
    prepared = PairExaminer(params).prepare(StereoPair(scene.left, scene.right), 2)
    pair = prepared.pair
    scale = grid_scale(pair.shape, params.processing.refine_pixels)
    own = compute_match(pair, params.matching, 2)
    evidence = gather_evidence(pair, own, to_grid(own.disparity.values, scale),
                               match_half(pair, params.matching), params.matching, scale, 2)
    graph = build_segment_graph(evidence.image, params.segmentation, scale)
    truth = to_grid(scene.truth, scale)
    hold = columns_hold(truth, prepared.offset, pair.shape[1], scale)
    truth = np.where(hold >= HOLD, truth, np.float32(np.nan))
    for given in given_maps(pair, scene, own, params):
        match = Match(DisparityMap(given, 0, scene.num_disparities), is_own=False)
        on_grid = to_grid(given, scale)
        blind = gather_evidence(pair, match, on_grid, None, params.matching, scale, 2)
        for seen in (evidence, blind):
            stage = PlaneStage(on_grid, on_grid, graph, seen, 0.0, scene.num_disparities - 1.0)
            _, planes = share_planes(stage, params.planes, 2)
            maps = propose(on_grid, planes, seen)
            if np.isnan(maps[0]).any():
                continue
            features = features_at(maps, on_grid, planes, seen)
            y, x = np.nonzero(np.isfinite(truth))
            chosen = rng.permutation(len(y))[:PIXELS]
            y, x = y[chosen], x[chosen]
            counts = np.abs(maps[:, y, x] - maps[0, y, x]) > ALIKE
            counts[0] = True
            is_right = np.abs(maps[:, y, x] - truth[y, x]) <= 1
            yield Rows(scene.group, seen.has_right, features[:, y, x][counts], is_right[counts])


def fit(rows: list[Rows]) -> np.ndarray:
    """Fit one logistic regression, each set with the same weight."""
    sizes: dict[str, int] = {}
    for part in rows:
        sizes[part.group] = sizes.get(part.group, 0) + len(part.is_right)
    x = np.vstack([part.features for part in rows]).astype(np.float64)
    y = np.concatenate([part.is_right for part in rows]).astype(np.float64)
    weight = np.concatenate([
        np.full(len(part.is_right), 1e5 / sizes[part.group]) for part in rows])
    beta = np.zeros(x.shape[1])
    for _ in range(STEPS):
        p = 1 / (1 + np.exp(-np.clip(x @ beta, -30, 30)))
        slope = (weight * p * (1 - p))[:, np.newaxis]
        hessian = (x * slope).T @ x + RIDGE * np.eye(x.shape[1])
        beta += np.linalg.solve(hessian, x.T @ (weight * (y - p)) - RIDGE * beta)
    return beta


def log_loss(rows: list[Rows], beta: np.ndarray) -> float:
    """Mean log loss of a model on rows."""
    x, y = np.vstack([part.features for part in rows]), np.concatenate(
        [part.is_right for part in rows])
    p = np.clip(1 / (1 + np.exp(-x @ beta)), 1e-6, 1 - 1e-6)
    return float(-np.mean(np.where(y, np.log(p), np.log(1 - p))))


def table_text(pair: np.ndarray, alone: np.ndarray) -> str:
    """Write the module that holds the coefficients."""
    head = (ROOT / 'setup.py').read_text(encoding='utf-8').split('\n\n')[0]
    lines = [head, '', '"""Coefficients of the likelihood: made by scripts/fit_likelihood.py."""']
    for name, beta in (('PAIR', pair), ('ALONE', alone)):
        lines += ['', f'{name} = (']
        lines += [f'    {value:.4f},  # {feature}'
                  for feature, value in zip(FEATURES, beta, strict=True)]
        lines += [')']
    return '\n'.join(lines) + '\n'


def main() -> None:
    """Gather rows, fit, say how the model does on sets left out, write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--data', type=Path, default=ROOT.parent / 'shared')
    parser.add_argument('--leave-out', default='', help='write the table fitted without this set')
    parser.add_argument('--rows', type=Path, help='keep the rows in this file, or take them')
    parser.add_argument('--write', type=Path, nargs='?', const=TABLE)
    args = parser.parse_args()
    rows = load_rows(args.data, args.rows)
    groups = sorted({part.group for part in rows})
    models = {}
    for has_right in (True, False):
        kind = [part for part in rows if part.has_right == has_right]
        for group in groups:
            others = [part for part in kind if part.group != group]
            left_out = [part for part in kind if part.group == group]
            loss = log_loss(left_out, fit(others))
            print(f'{"pair" if has_right else "left view alone"}: {group} left out: '
                  f'log loss {loss:.4f}', flush=True)
        models[has_right] = fit([part for part in kind if part.group != args.leave_out])
    text = table_text(models[True], models[False])
    if args.write:
        args.write.write_text(text, encoding='utf-8')
    print(text)


def load_rows(data: Path, kept: Path | None) -> list[Rows]:
    """Gather the rows of all scenes, or take them from a file."""
    if kept is not None and kept.exists():
        stored = np.load(kept, allow_pickle=True)['rows']
        return [Rows(*row) for row in stored]
    rng = np.random.default_rng(0)
    cv2.setNumThreads(2)
    rows = []
    folders = [(group, folder) for group in SETS for folder in scene_folders(data, group)]
    for group, folder in folders:
        scene = read_field_scene(folder, group)
        for preset in PRESETS:
            rows += list(rows_of(scene, preset, rng))
        print(f'{scene.group} {scene.name}', flush=True)
    if kept is not None:
        stored = np.empty(len(rows), object)
        stored[:] = [tuple(part) for part in rows]
        np.savez(kept, rows=stored)
    return rows


if __name__ == '__main__':
    main()
