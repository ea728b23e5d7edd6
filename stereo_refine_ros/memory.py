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
Memory that one frame frees serves the next.

By default glibc gives freed arrays back to the system, and every frame asks for them again, page
by page: a fifth of the time of a live frame.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache

# Names and numbers from malloc.h.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
# The largest that glibc takes; arrays above it come from the system in huge pages.
_LARGEST_KEPT = 32 << 20
# At the end of each of glibc's arenas.
_KEPT = 128 << 20


@lru_cache(maxsize=None)
def keep_freed_memory() -> bool:
    """
    Let the C library keep freed memory for later; once in a process, and for all of it.

    Returns
    -------
    bool
        False where the C library is not glibc; then everything stays as it was.

    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)
    if mallopt is None:
        return False
    return bool(mallopt(_MMAP_THRESHOLD, _LARGEST_KEPT)
                and mallopt(_TRIM_THRESHOLD, _KEPT))
