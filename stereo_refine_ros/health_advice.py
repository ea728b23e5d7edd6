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
What the health of a pair means: is something wrong with the cameras, and what is to be done.

`advise` judges one frame; `Settled` lets only what lasts for some frames come through. A figure
that is NaN says nothing, and a cause that is found silences the symptoms it has.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
import math

from stereo_refine_ros.types import PairHealth


class Level(IntEnum):
    """As in diagnostic_msgs."""

    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class Advice:
    """
    One thing that is wrong.

    Attributes
    ----------
    key : str
        Short code of the cause: the numbers in the text change from frame to frame.
    level : Level
    text : str
        What is wrong and what to do.

    """

    key: str
    level: Level
    text: str


@dataclass(frozen=True)
class Observation:
    """
    What is known of a frame.

    Attributes
    ----------
    health : PairHealth
    lr_consistent_ratio : float
        Share of the pixels on which the matches of both views agree; 0.85 in a good pair, and
        with the right view swapped 0.11, black 0.07, covered 0.01, three rows off 0.39,
        raw 0.45, the left view again 1.00.
    frozen : str
        'left' or 'right' where that image has the bytes of the last frame and the other not.
    has_distortion : bool
        The camera_info of images that should be rectified has a D that is not zero.
    is_external : bool
        The disparity came from another matcher.
    rows_are_corrected : bool
        Rows that are off are put right before matching.

    """

    health: PairHealth
    lr_consistent_ratio: float = float('nan')
    frozen: str = ''
    has_distortion: bool = False
    is_external: bool = False
    rows_are_corrected: bool = True


# Value and unit; then what healthy and broken pairs of the lab and field scenes have. `matched`
# is PairHealth's coarse look, `lr` the share that passed the left-right check at full size.
BLACK_CONTRAST = 1.5  # grey levels; dark pairs (x 0.12) 4 and more, a black view 0
DIM_CONTRAST = 0.35  # of the other view; healthy 0.9 and more, covered or fogged 0.05 to 0.25
UNRELATED = 0.2  # lr; views of two scenes 0.02 to 0.08, noise of 10 levels also 0.06
DOUBTFUL = 0.35  # lr; healthy 0.39 and more, dark 0.27 and more
RELATED = 0.37  # matched; healthy, dark and noisy 0.41 and more, put together wrongly 0 to 0.33
OTHERWISE_LEAST = 0.45  # matched otherwise; truly so 0.57 to 0.94, healthy up to 0.39
OTHERWISE_BETTER = 1.5  # times `matched`
RAW = 0.55  # lr; EuRoC's raw pairs 0.45
RAW_ROWS_PX = 3.0  # px, where known: no calibrated pair is so far off
ROWS_OFF_PX = 0.5  # px, where they are not put right: matching suffers from there on
ROWS_FAR_OFF_PX = 2.5  # px, where they are put right: KITTI 1.4 to 2.0, OAK up to 1.0
GAIN = 1.25  # brightness of one view over the other; healthy 0.94 to 1.17
SHARPNESS = 0.65  # detail of the blurrier view; healthy 0.80 and more, blur of 1 px 0.25 to 0.43
AT_THE_END = 0.1  # share of the matches at the last disparities of the range
NEARER = 0.03  # share of pixels nearer than the range; healthy up to 0.01, hands before OAK 0.17
GIVEN_AGREES = 0.3  # share of the sure matches on which an external map agrees
NOISY = 5.0  # grey levels; healthy 0.3 to 1.9

FRAMES_LOOKED_AT = 5
FRAMES_NEEDED = 3


def advise(seen: Observation) -> list[Advice]:
    """Judge one frame: what is wrong, the worst first; nothing for a healthy frame."""
    found = _dead_view(seen) or _wrong_view(seen) or _unrelated(seen)
    if not found:
        found = [*_hardly_matching(seen), *_misaligned(seen), *_lenses(seen.health)]
    return sorted([*found, *_external(seen)], key=lambda advice: -advice.level)


class Settled:
    """Let through what lasts: at least FRAMES_NEEDED of the last FRAMES_LOOKED_AT frames."""

    def __init__(self) -> None:
        """Start without frames."""
        self._frames: deque[list[Advice]] = deque(maxlen=FRAMES_LOOKED_AT)

    def add(self, advice: list[Advice]) -> list[Advice]:
        """Take what is said of a frame; return what holds, with its newest text, worst first."""
        self._frames.append(advice)
        newest: dict[str, Advice] = {}
        counts: dict[str, int] = {}
        for frame in self._frames:
            for item in frame:
                newest[item.key] = item
                counts[item.key] = counts.get(item.key, 0) + 1
        holding = [item for key, item in newest.items() if counts[key] >= FRAMES_NEEDED]
        return sorted(holding, key=lambda item: -item.level)


def _dead_view(seen: Observation) -> list[Advice]:
    """Find a view that shows nothing, or always the same."""
    health = seen.health
    dark = [name for name, contrast in (('left', health.contrast_left),
                                        ('right', health.contrast_right))
            if contrast < BLACK_CONTRAST]
    if dark:
        return [Advice('black', Level.ERROR, (
            f'the {" and the ".join(dark)} image shows nothing (one grey level all over): take '
            'the cap off, check exposure, light and cable'))]
    if seen.frozen:
        return [Advice('frozen', Level.ERROR, (
            f'the {seen.frozen} image is frozen: the same bytes frame after frame, while the '
            'other one changes; restart that camera or its driver'))]
    ratio = _ratio(health.contrast_left, health.contrast_right)
    if ratio < DIM_CONTRAST and seen.lr_consistent_ratio < DOUBTFUL:
        dim = 'left' if health.contrast_left < health.contrast_right else 'right'
        return [Advice('covered', Level.ERROR, (
            f'the {dim} image has only {100 * ratio:.0f} % of the contrast of the other one: its '
            'lens is covered, fogged or out of exposure; clean it, check its exposure'))]
    return []


def _wrong_view(seen: Observation) -> list[Advice]:
    """Find a right view that is an image, but not the right one."""
    health = seen.health
    if health.is_same_image:
        return [Advice('same_image', Level.ERROR, (
            'left and right are the same image: remap right/image_rect to the right camera'))]
    ratio, key, text = max(
        (_known(health.upside_down_ratio), 'upside_down', (
            'the right image is upside down: turn the camera or its image by 180 degrees (in the '
            'driver), and calibrate again')),
        (_known(health.swapped_ratio), 'exchanged', (
            'left and right are exchanged: swap the topics, or the cables')))
    as_is = seen.lr_consistent_ratio if math.isnan(health.matched_ratio) else health.matched_ratio
    if ratio >= OTHERWISE_LEAST and ratio > OTHERWISE_BETTER * as_is:
        return [Advice(key, Level.ERROR, text)]
    return []


def _unrelated(seen: Observation) -> list[Advice]:
    """Find views of two scenes."""
    if not seen.lr_consistent_ratio < UNRELATED or seen.health.matched_ratio >= RELATED:
        return []
    if _looks_raw(seen):
        return []
    return [Advice('unrelated', Level.ERROR, (
        f'{_share(seen)}: the images do not show one scene; check that both topics are of one '
        'stereo camera, that it is synchronised, and its calibration'))]


def _hardly_matching(seen: Observation) -> Iterator[Advice]:
    health = seen.health
    if _looks_raw(seen):
        yield Advice('raw', Level.WARN, (
            f'{_share(seen)} and camera_info has distortion: the images look raw; publish '
            'rectified ones (image_proc), or set inputs.rectify to true'))
    elif seen.lr_consistent_ratio < DOUBTFUL and health.noise_sigma > NOISY:
        yield Advice('noisy', Level.WARN, (
            f'{_share(seen)}, the noise is {health.noise_sigma:.0f} grey levels: give more '
            'light or a longer exposure, and less gain'))
    elif seen.lr_consistent_ratio < DOUBTFUL and not (
            health.matched_ratio >= RELATED or health.row_offset_px >= ROWS_OFF_PX):
        yield Advice('doubtful', Level.WARN, (
            f'{_share(seen)}: check that the images are rectified, exposure, and '
            'matching.min_disparity / num_disparities'))


def _looks_raw(seen: Observation) -> bool:
    return (seen.lr_consistent_ratio < RAW and seen.has_distortion
            and not seen.health.row_offset_px < RAW_ROWS_PX)


def _misaligned(seen: Observation) -> Iterator[Advice]:
    health = seen.health
    limit = ROWS_FAR_OFF_PX if seen.rows_are_corrected else ROWS_OFF_PX
    if health.row_offset_px >= limit and not _looks_raw(seen):
        yield Advice('rows_off', Level.WARN, (
            f'the rows of left and right are up to {health.row_offset_px:.1f} px apart: calibrate '
            'the cameras again; until then keep rectification.correct true'))
    if health.last_disparity_ratio >= AT_THE_END or health.nearer_ratio >= NEARER:
        share = max(_known(health.last_disparity_ratio), _known(health.nearer_ratio))
        yield Advice('too_near', Level.WARN, (
            f'{100 * share:.0f} % of the matches are at the end of the search range or beyond: '
            'things are nearer than it, and may come out far away; raise '
            'matching.num_disparities, or set matching.nearest'))


def _lenses(health: PairHealth) -> Iterator[Advice]:
    if not 1.0 / GAIN <= health.gain_ratio <= GAIN and health.gain_ratio > 0:
        yield Advice('gain', Level.WARN, (
            f'the right image is {health.gain_ratio:.2f} times as bright as the left one: give '
            'both cameras the same exposure and gain'))
    if health.sharpness_ratio < SHARPNESS:
        yield Advice('blurred', Level.WARN, (
            f'one image has {100 * health.sharpness_ratio:.0f} % of the detail of the other: '
            'its lens is dirty, fogged or out of focus; clean both'))


def _external(seen: Observation) -> Iterator[Advice]:
    if not seen.is_external:
        return
    if seen.health.fits_right_better:
        yield Advice('given_right', Level.WARN, (
            'preliminary/disparity fits the right image better than the left one: publish the '
            'map of the left camera (OAK: setDepthAlign to the left one)'))
    elif seen.health.given_agreement < GIVEN_AGREES:
        yield Advice('given_wrong', Level.ERROR, (
            'preliminary/disparity does not fit these images (agrees with '
            f'{100 * seen.health.given_agreement:.0f} % of the sure matches): check that it is of '
            'this camera and stamp, that its unit is px, and its sign (positive is near)'))


def _share(seen: Observation) -> str:
    ratio = seen.lr_consistent_ratio
    return f'only {100 * ratio:.0f} % of the pixels match between left and right'


def _known(ratio: float) -> float:
    return 0.0 if math.isnan(ratio) else ratio


def _ratio(first: float, second: float) -> float:
    """Return the smaller over the larger; NaN where one is unknown."""
    larger = max(first, second)
    return min(first, second) / larger if larger > 0 else float('nan')
