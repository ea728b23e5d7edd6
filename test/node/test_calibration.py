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

"""Calibration as drivers publish it: which message serves, what it means, what is doubtful."""

from harness import camera_info
import pytest

from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.node.calibration import calibrate, Calibration
from stereo_refine_ros.node.frame import with_nearest
from stereo_refine_ros.params import CameraParams, load_preset
from stereo_refine_ros.types import StereoGeometry

pytestmark = pytest.mark.ros
NOTHING = CameraParams()


def infos(baseline=0.1, **values):
    pair = [camera_info(160, 96, 1), camera_info(160, 96, 1, baseline=baseline)]
    for info in pair:
        for name, value in values.items():
            setattr(info, name, value)
    return Calibration(*pair)


def of(calibration, camera=NOTHING, size=(160, 96)):
    return calibrate(calibration, camera, *size)


def test_a_good_calibration_raises_no_doubt():
    geometry, notes = of(infos())
    assert (geometry.focal_px, geometry.baseline_m, notes) == (200.0, pytest.approx(0.1), ())


def test_the_baseline_is_between_both_cameras():
    """Check KITTI's colour cameras 2 and 3, both relative to camera 0."""
    calibration = infos()
    calibration.left.p[0] = calibration.right.p[0] = 721.5377
    calibration.left.p[3], calibration.right.p[3] = 44.85728, -339.5242
    assert of(calibration)[0].baseline_m == pytest.approx(0.53272545, abs=1e-6)


@pytest.mark.parametrize('baseline,doubtful', [(4.9, False), (120.0, True)])
def test_a_long_baseline_is_asked_for_its_unit(baseline, doubtful):
    geometry, notes = of(infos(baseline))
    assert geometry.baseline_m == pytest.approx(baseline)
    assert [('is P in millimetres?' in note.text, note.is_lasting) for note in notes] == (
        [(True, True)] if doubtful else [])
    geometry, notes = of(infos(baseline), CameraParams(baseline=0.12))
    assert (geometry.baseline_m, notes) == (0.12, ())


@pytest.mark.parametrize('size', [(160, 94), (162, 96), (159, 97)])
def test_a_size_a_pixel_or_two_off_is_taken_with_a_note(size):
    geometry, notes = of(infos(), size=size)
    assert geometry.focal_px == 200.0
    assert [note.key for note in notes] == ['left size', 'right size']
    assert f'is for 160 x 96, the image is {size[0]} x {size[1]}' in notes[0].text
    assert not notes[0].is_lasting


def test_another_size_is_refused():
    with pytest.raises(BadMessage) as refused:
        of(infos(), size=(160, 93))
    assert refused.value.reason == 'camera_info_size'


@pytest.mark.parametrize('calibration,text', [
    (Calibration(), 'no left/camera_info came'),
    (Calibration(infos().left), 'no right/camera_info came'),
    (infos(p=[0.0] * 12), 'P has fx 0'), (infos(0.0), 'the baseline is 0 m')])
def test_without_a_usable_calibration_there_is_no_geometry(calibration, text):
    geometry, (note,) = of(calibration)
    assert geometry is None and note.is_lasting
    assert note.text.startswith('disparity comes without depth: ') and text in note.text


@pytest.mark.parametrize('calibration,expected', [
    (Calibration(), StereoGeometry(300.0, 0.2, 79.5, 47.5, 79.5, 300.0)),
    (infos(p=[0.0] * 12), StereoGeometry(300.0, 0.2, 79.5, 47.5, 79.5, 300.0)),
    (infos(), StereoGeometry(300.0, 0.2, 80.0, 48.0, 80.0, 300.0))])
def test_parameters_stand_instead(calibration, expected):
    geometry, notes = of(calibration, CameraParams(baseline=0.2, focal_length=300.0))
    assert (geometry, notes) == (expected, ())


def test_cameras_the_wrong_way_round_are_refused():
    with pytest.raises(BadMessage, match='are left and right swapped'):
        of(infos(-0.1))


@pytest.mark.parametrize('nearest,expected', [
    (0.0, 64), (0.5, 41), (1.0, 21), (1000.0, 2), (0.001, 2048)])
def test_the_nearest_distance_gives_the_number_of_disparities(nearest, expected):
    params = load_preset('live', {'matching.nearest': nearest})
    geometry = StereoGeometry(200.0, 0.1, 80.0, 48.0, 80.0)
    assert with_nearest(params, geometry).matching.num_disparities == expected


def test_the_nearest_distance_knows_offset_and_smallest_disparity():
    params = load_preset('live', {'matching.nearest': 1.0, 'matching.min_disparity': 5})
    shifted = StereoGeometry(200.0, 0.1, 80.0, 48.0, 77.5)  # 22.5 px between the columns
    found = with_nearest(params, shifted).matching
    assert found.min_disparity + found.num_disparities - 1 == 23
    unknown = StereoGeometry(0.0, 0.0, 80.0, 48.0, 80.0)
    assert with_nearest(params, unknown) is params
