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

"""A DDS domain of its own for a demo, a benchmark or a test beside others on this host."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path
import tempfile

DOMAINS = range(1, 102)  # the ports of higher ones are those that Linux hands out itself
_held: list[int] = []  # open files: their locks last as long as this process


def claim_domain() -> str:
    """
    Claim a DDS domain for this process, for ROS_DOMAIN_ID.

    Claims are locks on files in the temporary folder; where all are taken, or none can be made,
    two processes may share a domain.
    """
    first = os.getpid() % len(DOMAINS)
    for number in (*DOMAINS[first:], *DOMAINS[:first]):
        try:
            lock = os.open(Path(tempfile.gettempdir()) / f'stereo_refine_ros_domain_{number}',
                           os.O_CREAT | os.O_RDWR, 0o600)
        except OSError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
            continue
        _held.append(lock)
        return str(number)
    return str(DOMAINS[first])


def use_own_domain() -> None:
    """Put this process and those that it starts into a domain of their own, unless told one."""
    if 'ROS_DOMAIN_ID' not in os.environ:
        os.environ['ROS_DOMAIN_ID'] = claim_domain()
