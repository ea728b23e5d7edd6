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

"""What /diagnostics says once a second: a level that means something, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from stereo_refine_ros.health_advice import Advice, Level
from stereo_refine_ros.messages.metrics import decimal
from stereo_refine_ros.node.counters import Counts

ADVICE = {
    'encoding': 'publish one of the encodings in docs/cameras.md, or convert with image_proc',
    'zero_size': 'check the camera driver: the image is empty',
    'too_large': 'check width and height; crop or decimate the image',
    'step': 'check the driver: step must be at least width times bytes per pixel',
    'data_size': 'check the driver or the link: the message is cut off or too long',
    'size_differs': 'set both cameras to one resolution',
    'camera_info_size': 'calibrate for this resolution, or set roi and binning in camera_info',
    'focal_length': 'calibrate the cameras and publish the rectified projection matrix P',
    'distortion': 'publish K, D, R and P of a stereo calibration, or set inputs.rectify to false',
    'delta_d': 'publish 32FC1 in pixels, or set delta_d (1/16 for OpenCV)',
    'aspect_ratio': 'publish the disparity of the whole image, at any scale',
    'baseline': 'check that left and right are not swapped and that P[3] is set on the right',
    'processing': 'see the log for the error; report it with the parameters in use',
}
LOW_VALID_RATIO = 0.3
SLOW_SHARE = 0.1


@dataclass(frozen=True)
class FrameSummary:
    """What /diagnostics needs of the last frame."""

    frame_id: str = ''
    latency_ms: float = float('nan')
    valid_ratio: float = float('nan')
    advice: tuple[Advice, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Health:
    """
    What is known of the last period.

    Attributes
    ----------
    listening, ready : bool
        Somebody wants an output; the kernels are compiled.
    compiling : bool
        Kernels that nobody foresaw were compiled meanwhile.
    now, before : Counts
        Counters now and a period ago.
    silent : tuple of str
        Required topics that deliver nothing.
    silent_why : tuple of str
        What the ROS graph says of them.
    feedback : tuple of str
        Outputs that come back as inputs.
    incompatible : tuple of str
        Topics offered with a QoS that does not fit.
    unmatched, unmatched_before : int
    unmatched_why : str
        Why pairs are not complete, and what to do.
    fps, latency_ms, valid_ratio : float
    advice : tuple of Advice
        What the images say of the cameras.
    notes : tuple of str
        What is doubtful about the calibration.

    """

    listening: bool = False
    ready: bool = True
    compiling: bool = False
    now: Counts = field(default_factory=Counts)
    before: Counts = field(default_factory=Counts)
    silent: tuple[str, ...] = ()
    silent_why: tuple[str, ...] = ()
    feedback: tuple[str, ...] = ()
    incompatible: tuple[str, ...] = ()
    unmatched: int = 0
    unmatched_before: int = 0
    unmatched_why: str = ''
    fps: float = 0.0
    latency_ms: float = float('nan')
    valid_ratio: float = float('nan')
    advice: tuple[Advice, ...] = ()
    notes: tuple[str, ...] = ()


def assess(health: Health) -> tuple[bytes, str]:
    """Choose the level and say what is wrong and what to do, the worst first."""
    if not health.ready:
        return DiagnosticStatus.OK, 'starting: compiling kernels'
    errors = list(_errors(health))
    warnings = list(_warnings(health))
    if errors:
        return DiagnosticStatus.ERROR, '; '.join(errors + warnings)
    if warnings:
        return DiagnosticStatus.WARN, '; '.join(warnings)
    if health.compiling:
        return DiagnosticStatus.OK, (
            'compiling kernels for other parameters or a longer search range, once: pairs that '
            'come meanwhile are superseded')
    if not health.listening:
        return DiagnosticStatus.OK, 'idle: nobody subscribes to an output'
    return DiagnosticStatus.OK, f'refining at {health.fps:.1f} frames a second'


def frame_status(is_degraded: bool, advice: tuple[Advice, ...]) -> tuple[bytes, str]:
    """Choose the level and the text of one frame's metrics."""
    texts = [item.text for item in advice]
    if is_degraded:
        texts.insert(0, 'refinement failed: disparity is the preliminary one')
    if is_degraded or any(item.level == Level.ERROR for item in advice):
        return DiagnosticStatus.ERROR, '; '.join(texts)
    if advice:
        return DiagnosticStatus.WARN, '; '.join(texts)
    return DiagnosticStatus.OK, 'refined'


def diagnostic_status(name: str, hardware_id: str, health: Health) -> DiagnosticStatus:
    """Build the status: level, text, and every counter."""
    level, text = assess(health)
    counts = health.now
    values: dict[str, float] = {
        'pairs_received': counts.received, 'pairs_published': counts.published,
        'pairs_superseded': counts.superseded, 'pairs_in_flight': counts.in_flight,
        'pairs_refused': sum(counts.refused.values()), 'pairs_unmatched': health.unmatched,
        'processing_failures': counts.failures, 'frames_degraded': counts.degraded,
        'fps': health.fps, 'frame_latency_ms': health.latency_ms,
        'valid_ratio_refined': health.valid_ratio}
    values.update({f'refused.{reason}': count
                   for reason, count in sorted(counts.refused.items())})
    return DiagnosticStatus(
        level=level, name=name, hardware_id=hardware_id, message=text,
        values=[KeyValue(key=key, value=decimal(value)) for key, value in values.items()])


def diagnostic_array(stamp: object, status: DiagnosticStatus) -> DiagnosticArray:
    """Wrap a status in a message."""
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def _errors(health: Health) -> Iterable[str]:
    if health.now.failures > health.before.failures:
        failed = health.now.failures - health.before.failures
        yield f'refinement failed {failed} times in the last second: {ADVICE["processing"]}'
    if health.now.degraded > health.before.degraded:
        yield 'publishing the preliminary disparity instead'
    yield from (item.text for item in health.advice if item.level == Level.ERROR)
    if health.silent:
        yield f'no input on {", ".join(health.silent)}: {"; ".join(health.silent_why)}'
    yield from health.feedback
    if health.incompatible:
        yield (f'incompatible QoS on {", ".join(health.incompatible)}: set qos_overrides or '
               'change the publisher')


def _warnings(health: Health) -> Iterable[str]:
    yield from (item.text for item in health.advice if item.level == Level.WARN)
    yield from health.notes
    for reason, count in sorted(health.now.refused.items()):
        recent = count - health.before.refused.get(reason, 0)
        if recent > 0 and reason != 'processing':
            yield f'refused {recent} pairs ({reason}): {ADVICE.get(reason, "see the log")}'
    if health.unmatched > health.unmatched_before:
        yield (f'{health.unmatched - health.unmatched_before} pairs unmatched: '
               f'{health.unmatched_why}')
    received = health.now.received - health.before.received
    superseded = health.now.superseded - health.before.superseded
    if superseded > SLOW_SHARE * max(received, 1) and not health.compiling:
        yield (f'too slow: {superseded} of {received} pairs superseded by newer ones; lower '
               'the frame rate, the resolution or matching.num_disparities, or use preset live')
    if health.listening and health.valid_ratio < LOW_VALID_RATIO:
        yield (f'only {100 * health.valid_ratio:.0f} % of the disparity is valid: check '
               'rectification, exposure and matching.min_disparity / num_disparities')
