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
Where compiled kernels are kept: in the user's cache, one folder for each state of the sources.

Numba looks only at the file that a kernel stands in. A kernel that calls into another file, or
uses a constant of it, would be served from the cache with the other file's old code. The
processor is part of the state: machine code of another one may not run here.

A cache that cannot be written, of a read-only image or made by another user, is copied to a
private folder, so that what fits is used and the rest can be added; numba itself gives up there.
"""

from __future__ import annotations

import atexit
from collections.abc import Iterator
import contextlib
from dataclasses import dataclass
import hashlib
import os
from pathlib import Path
import platform
import re
import shutil
import stat
import sys
import tempfile

_KERNEL = re.compile(rb'@(numba\.)?(njit|guvectorize|vectorize|intrinsic)\b')
# What /proc/cpuinfo says of a processor and its instructions, on x86 and on ARM.
_PROCESSOR_KEYS = ('vendor_id', 'cpu family', 'model', 'flags', 'CPU implementer', 'CPU part',
                   'Features')
_PRIVATE = 0o700


@dataclass(frozen=True)
class KernelCache:
    """
    Where this process finds and leaves compiled kernels.

    Parameters
    ----------
    folder : str
        The folder in use, writable.
    wanted : str
        Where they were to be kept; another one than `folder` if that cannot be written.
    state : str
        Digest of sources and processor that the kernels are for.

    """

    folder: str
    wanted: str
    state: str

    @property
    def is_private(self) -> bool:
        """Whether another folder had to be taken than the one wanted."""
        return self.folder != self.wanted


def use_versioned_cache() -> KernelCache:
    """
    Point numba to the folder of this state of the sources, unless the user chose one.

    Raises
    ------
    OSError
        When no folder at all can be written.

    """
    state = f'{_digest_of_sources()}-{_digest_of_processor()}'
    wanted = os.environ.get('NUMBA_CACHE_DIR') or _folder_of(state)
    folder = wanted if _is_usable(wanted) else _private_copy(wanted, state)
    os.environ['NUMBA_CACHE_DIR'] = folder
    if 'numba' in sys.modules:
        sys.modules['numba'].config.CACHE_DIR = folder
    return KernelCache(folder, wanted, state)


def _folder_of(state: str) -> str:
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    return os.path.join(home, 'stereo_refine_ros', f'kernels-{state}')


def _is_usable(folder: str) -> bool:
    """Whether all there is can be read, and files can be added anywhere: numba asks no less."""
    if not os.path.isabs(folder) and 'NUMBA_CACHE_DIR' not in os.environ:
        return False  # an account without a home
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return all(os.access(entry, os.R_OK | (os.W_OK | os.X_OK if entry.is_dir() else 0))
               for entry in Path(folder).rglob('*'))


def _private_copy(wanted: str, state: str) -> str:
    """Return a folder of this user alone, with the kernels of `wanted` that are for `state`."""
    folder = Path(_private_root(), f'kernels-{state}')
    folder.mkdir(exist_ok=True)
    source = Path(wanted)
    if source.name == folder.name or any(source.glob(f'compiled-{state}-*')):
        for path in source.rglob('*'):
            target = folder / path.relative_to(source)
            with contextlib.suppress(OSError):  # what cannot be read is compiled anew
                _copy_if_missing(path, target)
    return str(folder)


def _copy_if_missing(source: Path, target: Path) -> None:
    if source.is_dir():
        target.mkdir(exist_ok=True)
    elif not target.exists():
        unfinished = target.with_name(f'{target.name}.{os.getpid()}')
        shutil.copyfile(source, unfinished)
        unfinished.replace(target)  # another process may be reading


def _private_root() -> str:
    """
    Make a folder that nobody else can plant kernels in.

    It stays from one start to the next, unless somebody else has taken its name.
    """
    for parent in _temporary_folders():
        path = os.path.join(parent, f'stereo_refine_ros-{os.geteuid()}')
        try:
            with contextlib.suppress(FileExistsError):
                os.mkdir(path, _PRIVATE)
            if not _is_own(path):
                path = tempfile.mkdtemp(prefix='stereo_refine_ros-', dir=parent)
                atexit.register(shutil.rmtree, path, ignore_errors=True)
            tempfile.TemporaryFile(dir=path).close()
        except OSError:
            continue
        return path
    raise OSError('no folder can be written for compiled kernels: set NUMBA_CACHE_DIR to one '
                  'that can (docker run --read-only: add --tmpfs /tmp)')


def _temporary_folders() -> Iterator[str]:
    with contextlib.suppress(FileNotFoundError):
        yield tempfile.gettempdir()
    yield '/dev/shm'


def _is_own(path: str) -> bool:
    found = os.lstat(path)
    return (stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
            and stat.S_IMODE(found.st_mode) == _PRIVATE)


def _digest_of_sources() -> str:
    """Digest every folder that holds kernels, whole, and other files that hold one."""
    digest = hashlib.sha256()
    root = Path(__file__).resolve().parent
    folders: dict[Path, list[bytes]] = {}
    for path in sorted(root.rglob('*.py')):
        text = path.read_bytes()
        folders.setdefault(path if path.parent == root else path.parent, []).append(text)
    for texts in folders.values():
        if any(_KERNEL.search(text) for text in texts):
            for text in texts:
                digest.update(text)
    return digest.hexdigest()[:16]


def _digest_of_processor() -> str:
    """
    Digest what decides about machine code.

    LLVM's own names of it would take a quarter of a second to ask for.
    """
    known = [platform.machine(), os.environ.get('NUMBA_CPU_NAME', ''),
             os.environ.get('NUMBA_CPU_FEATURES', '')]
    with contextlib.suppress(OSError):
        first = Path('/proc/cpuinfo').read_text(encoding='utf-8').split('\n\n')[0]
        known += [line for line in first.splitlines()
                  if line.partition(':')[0].strip() in _PROCESSOR_KEYS]
    return hashlib.sha256('\n'.join(known).encode()).hexdigest()[:8]
