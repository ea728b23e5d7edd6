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

"""Scenes that are not there are fetched, checked by their pixels, or fail in one clear error."""

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
import io
import threading
from urllib.error import URLError

import cv2
import numpy as np
import pytest

from stereo_refine_ros.datasets import download, load_scene, locate
from stereo_refine_ros.datasets.download import (
    can_download, download_scene, pixel_digest, REMOTE_SCENES)
from stereo_refine_ros.datasets.locate import find_data
from stereo_refine_ros.datasets.middlebury import read_scene


class _Quiet(SimpleHTTPRequestHandler):

    def log_message(self, *args):
        pass


@pytest.fixture
def site(tmp_path):
    """Serve `tmp_path/site`, made of the scenes found, in the layout of Middlebury's site."""
    root = tmp_path / 'site'
    for name, remote in REMOTE_SCENES.items():
        folder = root / remote.folder
        folder.mkdir(parents=True)
        for stem, (file_name, _) in remote.files.items():
            flag = cv2.IMREAD_GRAYSCALE if stem.startswith('disp') else cv2.IMREAD_COLOR
            image = cv2.imread(str(find_data() / name / f'{stem}.png'), flag)
            cv2.imwrite(str(folder / file_name), image)
    server = ThreadingHTTPServer(('127.0.0.1', 0), partial(_Quiet, directory=str(root)))
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield root, f'http://127.0.0.1:{server.server_port}'
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.mark.parametrize('name', REMOTE_SCENES)
def test_downloaded_scene_equals_the_one_at_hand(site, tmp_path, name):
    progress = io.StringIO()
    folder = download_scene(name, tmp_path / 'cache', site[1], progress)
    fetched, there = read_scene(folder), load_scene(name)
    np.testing.assert_array_equal(fetched.pair.left, there.pair.left)
    np.testing.assert_array_equal(fetched.pair.right, there.pair.right)
    np.testing.assert_array_equal(fetched.truth, there.truth)
    assert fetched.scale == there.scale
    assert fetched.num_disparities == there.num_disparities
    lines = progress.getvalue().splitlines()
    assert len(lines) == len(REMOTE_SCENES[name].files)
    assert all('[########################]' in line and 'KiB' in line for line in lines)


def test_visible_region_is_derived_from_the_two_maps(site, tmp_path):
    fetched = read_scene(download_scene('sawtooth', tmp_path, site[1], io.StringIO()))
    there = load_scene('sawtooth')
    assert (fetched.masks['nonocc'] == there.masks['nonocc']).mean() > 0.995


def test_other_pixels_are_refused_and_leave_nothing(site, tmp_path):
    root, address = site
    path = root / REMOTE_SCENES['cones'].folder / 'im2.png'
    image = cv2.imread(str(path))
    image[0, 0, 0] ^= 1
    cv2.imwrite(str(path), image)
    with pytest.raises(ValueError, match='im2.png.*SHA-256'):
        download_scene('cones', tmp_path / 'cache', address, io.StringIO())
    assert list((tmp_path / 'cache').iterdir()) == []


def test_what_is_not_an_image_is_refused(site, tmp_path):
    root, address = site
    (root / REMOTE_SCENES['venus'].folder / 'im2.ppm').write_text('<html>moved</html>')
    with pytest.raises(ValueError, match='not an image'):
        download_scene('venus', tmp_path / 'cache', address, io.StringIO())


def test_missing_file_is_a_clear_error(site, tmp_path):
    root, address = site
    (root / REMOTE_SCENES['venus'].folder / 'im6.ppm').unlink()
    with pytest.raises(ConnectionError, match='im6.ppm.*404'):
        download_scene('venus', tmp_path / 'cache', address, io.StringIO())
    assert list((tmp_path / 'cache').iterdir()) == []


def test_scene_that_is_nowhere_goes_to_the_cache(site, tmp_path, monkeypatch):
    (tmp_path / 'data').mkdir()
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    fetch = partial(download_scene, site=site[1], progress=io.StringIO())
    monkeypatch.setattr('stereo_refine_ros.datasets.middlebury.download_scene', fetch)
    first = load_scene('Tsukuba', tmp_path / 'data')
    assert (locate.cache_dir() / 'middlebury' / 'tsukuba' / 'left.png').is_file()
    monkeypatch.setattr('stereo_refine_ros.datasets.middlebury.download_scene', None)
    again = load_scene('tsukuba', tmp_path / 'data')
    np.testing.assert_array_equal(first.truth, again.truth)


def test_two_downloads_at_once_leave_one_scene(site, tmp_path):
    first = download_scene('venus', tmp_path / 'cache', site[1], io.StringIO())
    again = download_scene('venus', tmp_path / 'cache', site[1], io.StringIO())
    assert first == again
    assert sorted(path.name for path in first.parent.iterdir()) == ['venus']
    assert not (first / 'venus').exists()


def test_offline_says_what_to_do(tmp_path, monkeypatch):
    def unreachable(*args, **kwargs):
        raise URLError('Name or service not known')

    (tmp_path / 'data').mkdir()
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path / 'cache'))
    monkeypatch.setattr(download.urllib.request, 'urlopen', unreachable)
    with pytest.raises(ConnectionError) as caught:
        load_scene('cones', tmp_path / 'data')
    text = str(caught.value)
    assert 'https://vision.middlebury.edu/stereo/data/scenes2003/newdata/cones/im2.png' in text
    assert '--data' in text and '--synthetic' in text and '\n' not in text


def test_only_the_classic_scenes_can_be_downloaded():
    assert can_download('Cones') and can_download('sawtooth')
    assert not can_download('Adirondack')


def test_digest_is_of_pixels_not_of_files():
    image = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    assert pixel_digest(image[:, ::-1]) == pixel_digest(image[:, ::-1].copy())
    assert pixel_digest(image[:, ::-1]) != pixel_digest(image)
