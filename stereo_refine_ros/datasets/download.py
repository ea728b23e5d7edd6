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

"""Fetch the classic scenes from Middlebury's site, checked pixel by pixel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import hashlib
import http.client
import json
import os
from pathlib import Path
import sys
import tempfile
from typing import TextIO
import urllib.request

import cv2
import numpy as np

from stereo_refine_ros.types import Image

SITE = 'https://vision.middlebury.edu/stereo/data'
_TIMEOUT_S = 20.0
_CHUNK = 1 << 15


@dataclass(frozen=True)
class RemoteScene:
    """
    Where a scene is published and what its decoded pixels must be.

    `files` maps the local stem to (remote name, SHA-256 of the decoded pixels).
    """

    folder: str
    scale: int
    num_disparities: int
    invalid_value: int | None
    files: Mapping[str, tuple[str, str]]


_STEMS = ('left', 'right', 'disp_left', 'disp_right')


def _scene_2001(name: str, num_disparities: int, *digests: str) -> RemoteScene:
    names = ('im2.ppm', 'im6.ppm', 'disp2.pgm', 'disp6.pgm')
    files = dict(zip(_STEMS, zip(names, digests, strict=True), strict=True))
    return RemoteScene(f'scenes2001/data/{name}', 8, num_disparities, None, files)


def _scene_2003(name: str, *digests: str) -> RemoteScene:
    names = ('im2.png', 'im6.png', 'disp2.png', 'disp6.png')
    files = dict(zip(_STEMS, zip(names, digests, strict=True), strict=True))
    return RemoteScene(f'scenes2003/newdata/{name}', 4, 60, 0, files)


REMOTE_SCENES: dict[str, RemoteScene] = {
    'tsukuba': RemoteScene('scenes2001/data/tsukuba', 16, 16, 0, {
        'left': ('scene1.row3.col3.ppm',
                 '7f924e38154917a3190d1cbf6899a87d67fc79b73dd5dc9f7404405261cb3932'),
        'right': ('scene1.row3.col4.ppm',
                  '30360f3317b305429621fed8c7d341c5c4e2f9494d263a48ac837f0b16cf55d3'),
        'disp_left': ('truedisp.row3.col3.pgm',
                      '47abc47b94f9a87f2ef7e709cc0bbc53e0f723a2b1ce25930795fc61ff6b335d')}),
    'venus': _scene_2001(
        'venus', 20,
        '03f190361ccb6233704c869d4b6d6b1067a4e0593b98dd6690a663febcc8c396',
        '6ca46cac8c9663d864807d87bae828fe9acad8470799a89ed61b1bd14bfc31d8',
        '9ebde58a97edabf1dc175229e40ba44343a31bfaae4a243f462f81da23e58ad2',
        '2c78ab90881be4500295a973111d444333a8f3dfa87339788a97b0bd03995250'),
    'sawtooth': _scene_2001(
        'sawtooth', 19,
        '255dfddcfca029eb0c4bb5426f6e7792407832399686dc2615914f509626e2d4',
        '7d0c2fcfeb7108f7ae2fcbc528e23b59d957fbc52714a72da1fc7c36cd23e662',
        'e719285d00a5a4e1a68355494c243ac852912cc4332ca45e675f3102b885a9fc',
        'c4ef1d8adc82694c948171e38a03a57f50df6c7db338a256f5737a480da6985c'),
    'teddy': _scene_2003(
        'teddy',
        '6bdc4d75242ecdca4e91820064eb9a16637299a4783489226d8953dc7fc5032b',
        'e405672e5af9357a82529ea321f42fab400baaa03b33fbedc92d442bb3c53024',
        'a72b62f309e8b1cadd72d7f923d51efde0592fe4fc782b5febb225dadeedf672',
        'eaea072f20c121b66c17c2fd79625b99f2a86b085e864806f628f56a11616a63'),
    'cones': _scene_2003(
        'cones',
        'c271be6b3b314fc54ee8dec1a26adbe39d007d7ffa53b827ef00e876b4e3f994',
        '9359ff982f7d7bf72785ffb3b58f26c287182033345bdc043f381c57b8682898',
        'aab8a5299141937786ee7a0c2d0739e9591cb428696d37b663371fd54334a6ba',
        '8e92db749ad53745d8b4e955a2945d8cbf59bb913ec3c8e95aa14ccc057ed6fc'),
}


def can_download(name: str) -> bool:
    """Say whether the scene `name` is one of those published at a fixed address."""
    return name.casefold() in REMOTE_SCENES


def download_scene(name: str, destination: Path, site: str = SITE,
                   progress: TextIO | None = None) -> Path:
    """
    Fetch a scene into `destination`/`name`, whole or not at all.

    Parameters
    ----------
    name : str
        A key of `REMOTE_SCENES`.
    destination : Path
        Folder of the scenes, made where missing.
    site : str
        Address that the scene's folder is relative to.
    progress : text stream, optional
        Where the progress bar goes; standard error by default.

    Raises
    ------
    ConnectionError
        When the site cannot be reached or does not have the file.
    ValueError
        When the decoded pixels are not the published ones.

    """
    remote = REMOTE_SCENES[name]
    stream = progress or sys.stderr
    destination.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=destination) as temporary:
        folder = Path(temporary) / name
        folder.mkdir()
        for stem, (file_name, digest) in remote.files.items():
            url = f'{site}/{remote.folder}/{file_name}'
            image = _decode(_fetch(url, _bar(stream, f'{name}/{file_name}')), url, digest)
            cv2.imwrite(str(folder / f'{stem}.png'), image)
        height, width = image.shape[:2]
        _write_meta(folder, name, remote, width, height)
        try:
            os.rename(folder, destination / name)
        except OSError:
            # Another process may have been quicker; what it left is as good.
            if not (destination / name / 'meta.json').is_file():
                raise
    return destination / name


def pixel_digest(image: Image) -> str:
    """Return the SHA-256 of the pixels, whatever file they came in."""
    return hashlib.sha256(np.ascontiguousarray(image).tobytes()).hexdigest()


def _fetch(url: str, report: Callable[[int, int], None]) -> bytes:
    parts: list[bytes] = []
    received = 0
    try:
        with urllib.request.urlopen(url, timeout=_TIMEOUT_S) as response:  # noqa: S310
            total = int(response.headers.get('Content-Length') or 0)
            while chunk := response.read(_CHUNK):
                parts.append(chunk)
                received += len(chunk)
                report(received, total)
    except (http.client.HTTPException, OSError) as error:
        raise ConnectionError(
            f'cannot download {url}: {error}. Connect to the internet, or give the folder of '
            'the scenes with --data or STEREO_REFINE_DATA, or use --synthetic') from error
    return b''.join(parts)


def _decode(content: bytes, url: str, digest: str) -> Image:
    decoded = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None:
        raise ValueError(f'{url}: what came is not an image')
    image = np.asarray(decoded, np.uint8)
    if pixel_digest(image) != digest:
        raise ValueError(f'{url}: its pixels are not the published ones (SHA-256 differs)')
    return image


def _bar(stream: TextIO, label: str) -> Callable[[int, int], None]:
    """Return a callback that draws one line a file: redrawn on a terminal, else once."""
    is_terminal = stream.isatty()

    def report(received: int, total: int) -> None:
        is_last = received >= total
        if not is_terminal and not is_last:
            return
        share = received / total if total else 1.0
        filled = int(24 * share)
        bar = '#' * filled + '-' * (24 - filled)
        end = '\n' if is_last or not is_terminal else ''
        start = '\r' if is_terminal else ''
        stream.write(f'{start}{label:32s} [{bar}] {received / 1024:7.0f} KiB{end}')
        stream.flush()

    return report


def _write_meta(folder: Path, name: str, remote: RemoteScene, width: int, height: int) -> None:
    meta = {'scene': name, 'width': width, 'height': height, 'disp_scale': remote.scale,
            'ndisp': remote.num_disparities, 'invalid_value': remote.invalid_value,
            'source': f'{SITE}/{remote.folder}'}
    text = json.dumps(meta, indent=1) + '\n'
    (folder / 'meta.json').write_text(text, encoding='utf-8')
