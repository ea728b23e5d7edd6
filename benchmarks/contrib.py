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

"""OpenCV's contributed filters, run by a Python of their own."""

from __future__ import annotations

import json
from pathlib import Path
import subprocess
import tempfile

import numpy as np
from opencv_methods import Views

_PROGRAM = Path(__file__).resolve().parent / 'opencv_methods.py'


def run_contrib(python: str, views: Views, num_disparities: int, rounds: int, budget_s: float
                ) -> tuple[dict[str, list[float]], dict[str, np.ndarray]]:
    """
    Run every method of `opencv_methods.contrib_methods` on a pair.

    Parameters
    ----------
    python : str
        The interpreter of an environment with opencv-contrib.
    views : pair of uint8 ndarray
        Left and right.
    num_disparities : int
        From 0.
    rounds, budget_s : int and float
        As in `timing.time_rounds`.

    Returns
    -------
    times, results : dict
        ms of every round, and the last result, by method.

    """
    with tempfile.TemporaryDirectory() as folder:
        pair, output = Path(folder) / 'pair.npz', Path(folder) / 'output.npz'
        np.savez(pair, left=views[0], right=views[1], num_disparities=num_disparities)
        done = subprocess.run(
            [python, str(_PROGRAM), str(pair), str(output),
             '--rounds', str(rounds), '--budget', str(budget_s)],
            check=True, stdout=subprocess.PIPE, text=True)
        return json.loads(done.stdout)['times'], dict(np.load(output))
