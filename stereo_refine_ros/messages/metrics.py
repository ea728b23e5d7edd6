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

"""A frame's figures as a DiagnosticArray: keys of the `metrics` topic, decimal strings."""

from __future__ import annotations

from collections.abc import Mapping
import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from std_msgs.msg import Header


def decimal(value: float) -> str:
    """Write a number so that `float` reads the same number back, without an exponent."""
    if not math.isfinite(value):
        return str(float(value))  # 'nan', 'inf' or '-inf'
    if float(value).is_integer() and abs(value) < 1e15:
        return str(int(value))
    return np.format_float_positional(value, trim='0')


def metrics_message(header: Header, name: str, hardware_id: str, figures: Mapping[str, float],
                    level: bytes, text: str) -> DiagnosticArray:
    """
    Build the metrics message of one frame.

    Parameters
    ----------
    header : std_msgs.msg.Header
        Of the frame.
    name, hardware_id : str
        Of the status.
    figures : mapping of str to float
        Values by key.
    level : bytes
        Of the status.
    text : str
        What is wrong with the frame and what to do.

    """
    status = DiagnosticStatus(
        level=level, name=name, hardware_id=hardware_id, message=text,
        values=[KeyValue(key=key, value=decimal(value)) for key, value in figures.items()])
    message = DiagnosticArray(status=[status])
    message.header.stamp, message.header.frame_id = header.stamp, header.frame_id
    return message
