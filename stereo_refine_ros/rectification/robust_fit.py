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

"""A smooth surface of row offsets through matched points, some of which are wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stereo_refine_ros.rectification import tuning

Array = NDArray[np.float64]
# Largest effect in the image of one pixel of each term: centre, width, height, both.
EFFECT = np.array([1.0, 0.5, 0.5, 0.25])


@dataclass(frozen=True, eq=False)
class RowFit:
    """
    Row offsets over the image, dy = t[0] + t[1] * across + t[2] * down + t[3] * across * down.

    Attributes
    ----------
    terms : float64 ndarray of shape (4,)
        Pixels; 0 for a term without evidence.
    errors : float64 ndarray of shape (4,)
        Standard errors of the terms, infinite where the term was not fitted.
    points : int
        How many points lie near the fit.
    share : float
        ... and their share of all points, 0..1.

    """

    terms: Array
    errors: Array
    points: int
    share: float

    @property
    def is_fitted(self) -> bool:
        """Whether enough points lie near the fit."""
        return self.points >= tuning.FEWEST_POINTS and self.share >= tuning.LEAST_SHARE


def basis(across: Array, down: Array) -> Array:
    """Return what the terms are multiplied with, float64 (4, ...)."""
    return np.stack([np.ones_like(across), across, down, across * down])


def fit_rows(across: Array, down: Array, dy: Array, sigma: Array) -> RowFit:
    """
    Fit the terms, forgiving outliers; a term that is not clearly there is left out.

    Parameters
    ----------
    across, down : float64 ndarray of shape (N,)
        Where the points are, -0.5..0.5 over the width and the height.
    dy, sigma : float64 ndarray of shape (N,)
        Row offset of each, and its standard deviation, pixels.

    """
    if len(dy) < tuning.FEWEST_POINTS:
        return RowFit(np.zeros(4), np.full(4, np.inf), 0, 0.0)
    rows, patch = basis(across, down), _patches(across, down)
    certainty = 1 / (sigma ** 2 + tuning.POINT_SIGMA_PX ** 2)
    is_used = np.ones(4, bool)
    fit = _fit(rows, patch, dy, certainty, is_used)
    for _ in range(3):
        is_clear = ((np.abs(fit.terms) > tuning.TERM_ERRORS * fit.errors)
                    & (EFFECT * np.abs(fit.terms) > tuning.TERM_PX)
                    & (fit.points >= tuning.FEWEST_FOR_SLOPES)
                    & (fit.share >= tuning.LEAST_SHARE_FOR_SLOPES))
        is_clear[0] = True
        if is_clear[is_used].all():
            break
        is_used &= is_clear
        fit = _fit(rows, patch, dy, certainty, is_used)
    return fit


def _fit(rows: Array, patch: NDArray[np.int64], dy: Array, certainty: Array,
         is_used: NDArray[np.bool_]) -> RowFit:
    """
    Fit the terms that are used.

    The scale beyond which a residual is forgiven falls from step to step (graduated
    non-convexity), so that the start does not decide which points are believed.
    """
    rows = rows[is_used]
    prior = np.diag(1 / np.array(tuning.PRIOR_PX)[is_used] ** 2)
    terms = np.zeros(len(rows))
    terms[0] = _weighted_median(dy, certainty)
    for scale in tuning.FIT_SCALES_PX:
        residual = dy - np.einsum('ip,i->p', rows, terms)
        weight = certainty / (1 + (residual / scale) ** 2) ** 2
        weight /= 1 + tuning.PATCH_SIGMA_PX ** 2 * _sum(weight, patch)[patch]
        normal = np.einsum('ip,jp->ij', rows * weight, rows) + prior
        terms = np.linalg.solve(normal, np.einsum('ip,p->i', rows, weight * dy))
    residual = dy - np.einsum('ip,i->p', rows, terms)
    # Residuals of neighbours go together: what counts is how the patches disagree.
    pulls = np.stack([_sum(row * weight * residual, patch) for row in rows])
    inverse = np.linalg.inv(normal)
    variance = np.maximum(np.diag(inverse), np.diag(
        inverse @ np.einsum('ip,jp->ij', pulls, pulls) @ inverse))
    is_near = np.abs(residual) <= tuning.NEAR_PX
    out, errors = np.zeros(4), np.full(4, np.inf)
    out[is_used], errors[is_used] = terms, np.sqrt(variance)
    return RowFit(out, errors, int(np.count_nonzero(is_near)), float(is_near.mean()))


def _patches(across: Array, down: Array) -> NDArray[np.int64]:
    column, row = (np.floor(tuning.PATCHES * (part + 0.5)).clip(0, tuning.PATCHES - 1)
                   for part in (across, down))
    return (row * tuning.PATCHES + column).astype(np.int64)


def _sum(values: Array, patch: NDArray[np.int64]) -> Array:
    return np.bincount(patch, values, tuning.PATCHES ** 2).astype(np.float64)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values, kind='stable')
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, total[-1] / 2)]])
