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

"""Print the paper's tables in Markdown from the rows that `evaluate --json` wrote."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from stereo_refine_ros.evaluation.tables import (
    check_claim, claim_text, compare, Comparison, format_number, markdown_table)

COLUMNS = (('mse', 'MSE', 1), ('psnr', 'PSNR dB', 2), ('ssim', 'SSIM', 4),
           ('mse_all_pixels', 'MSE all pixels', 1), ('bad_1_0', 'bad-1.0 %', 2),
           ('bad_2_0', 'bad-2.0 %', 2))


def cells(pair: Comparison) -> list[str]:
    """Write one line of a table: before and after."""
    return [f'{pair.after["matching"]}, {pair.after["filter"]}', *(
        f'{format_number(pair.before[name], digits)} → {format_number(pair.after[name], digits)}'
        for name, _, digits in COLUMNS)]


def main() -> None:
    """Print the claim, then a table for every projection and scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('json', type=Path, help='file that `evaluate --json` wrote')
    rows = json.loads(parser.parse_args().json.read_text(encoding='utf-8'))
    for claim in check_claim(rows):
        print('\n'.join(f'* {line.strip()}' for line in claim_text(claim)))
    tables: dict[tuple[str, str], list[Comparison]] = {}
    for pair in compare(rows):
        tables.setdefault((pair.after['projection'], pair.after['scene']), []).append(pair)
    for (projection, scene), pairs in tables.items():
        print()
        print(markdown_table([f'{scene}, {projection}', *(title for _, title, _ in COLUMNS)],
                             [cells(pair) for pair in pairs]))


if __name__ == '__main__':
    main()
