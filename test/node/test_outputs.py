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

"""Outputs against geometry: depth, points, planes, colours, segments."""

from harness import stamp_of
import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from stereo_refine_ros.datasets.synthetic import render_scene
from stereo_refine_ros.messages.outputs import (
    color_map, depth_map, image_message, point_cloud)
from stereo_refine_ros.messages.plane_markers import large_planes, plane_markers
from stereo_refine_ros.params import load_preset
from stereo_refine_ros.pipeline import StereoRefiner
from stereo_refine_ros.types import DisparityMap, PlaneSegmentation, StereoGeometry
from visualization_msgs.msg import Marker

GEOMETRY = StereoGeometry(400.0, 0.1, 30.0, 22.0, 28.0, 380.0)
HEADER = Header(stamp=stamp_of(5), frame_id='left_optical')
SHAPE = (48, 64)
# A wall that leans: normal . X = offset, in the optical frame.
NORMAL = np.array([0.2, -0.3, -1.0]) / np.linalg.norm([0.2, -0.3, -1.0])
OFFSET = -2.5


@pytest.fixture(scope='module')
def wall():
    """Disparity of the wall, computed ray by ray, and its plane in disparity space."""
    rows, columns = np.mgrid[0:SHAPE[0], 0:SHAPE[1]].astype(float)
    rays = np.stack([(columns - GEOMETRY.cx_left) / GEOMETRY.focal_px,
                     (rows - GEOMETRY.cy) / GEOMETRY.fy, np.ones(SHAPE)], axis=2)
    depth = OFFSET / (rays @ NORMAL)
    disparity = GEOMETRY.focal_px * GEOMETRY.baseline_m / depth - GEOMETRY.doffs_px
    design = np.stack([columns.ravel(), rows.ravel(), np.ones(columns.size)], axis=1)
    plane, *_ = np.linalg.lstsq(design, disparity.ravel(), rcond=None)
    return disparity.astype(np.float32), depth, rays * depth[..., None], plane


def test_depth_is_along_the_axis_in_metres(wall):
    values, depth, _, _ = wall
    values = values.copy()
    values[3, 4] = np.nan
    result = depth_map(DisparityMap(values, 0, 64), GEOMETRY)
    assert result.dtype == np.float32 and np.isnan(result[3, 4])
    values[3, 4], depth[3, 4] = 0, np.nan
    np.testing.assert_allclose(result, depth, rtol=1e-5)


def test_points_at_or_beyond_infinity_have_no_depth():
    values = np.array([[1.9, 2.0, 2.5]], np.float32)  # doffs is -2
    result = depth_map(DisparityMap(values, 0, 64), GEOMETRY)
    np.testing.assert_allclose(result, [[np.nan, np.nan, 80.0]])


def test_points_lie_on_the_wall_and_carry_colors(wall):
    values, _, points, _ = wall
    values = values.copy()
    values[0, 0] = np.nan
    left = np.random.default_rng(0).integers(0, 256, SHAPE + (3,), np.uint8)
    depth = depth_map(DisparityMap(values, 0, 64), GEOMETRY)
    cloud = point_cloud(HEADER, depth, GEOMETRY, left)
    assert cloud.header == HEADER
    assert (cloud.height, cloud.width) == SHAPE and not cloud.is_dense
    assert [f.name for f in cloud.fields] == ['x', 'y', 'z', 'rgb']
    assert cloud.row_step == cloud.point_step * cloud.width
    xyz, rgb = unpack(cloud)
    assert np.isnan(xyz[0, 0]).all()
    np.testing.assert_allclose(xyz[1:], points[1:], rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(rgb, left[..., ::-1])


def test_points_of_a_grey_image():
    grey = np.array([[7, 200]], np.uint8)
    cloud = point_cloud(HEADER, np.ones((1, 2), np.float32), GEOMETRY, grey)
    np.testing.assert_array_equal(unpack(cloud)[1], [[[7] * 3, [200] * 3]])


def unpack(cloud: PointCloud2):
    """Return xyz (H, W, 3) and rgb (H, W, 3)."""
    raw = np.frombuffer(cloud.data, np.uint8).reshape(cloud.height, cloud.width, -1)
    xyz = np.ascontiguousarray(raw[..., :12]).view(np.float32)
    packed = np.ascontiguousarray(raw[..., 12:16]).view(np.uint32)[..., 0]
    return xyz, np.stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255], axis=2)


def segmentation(plane, labels=None):
    labels = np.zeros(SHAPE, np.int32) if labels is None else labels
    count = labels.max() + 1
    planes = np.full((count, 3), np.nan)
    planes[0] = plane
    return PlaneSegmentation(
        labels, planes, np.arange(count) == 0, np.ones(count, np.float32))


def test_planes_are_metric(wall):
    found, = large_planes(segmentation(wall[3]), GEOMETRY)
    angle = np.degrees(np.arccos(np.clip(found.normal @ NORMAL, -1, 1)))
    assert angle < 0.01
    assert found.offset_m == pytest.approx(OFFSET, rel=1e-4)
    np.testing.assert_allclose(found.outline @ NORMAL, OFFSET, rtol=1e-4)
    assert found.normal[2] < 0  # towards the camera


def test_outlines_follow_the_segment(wall):
    labels = np.ones(SHAPE, np.int32)
    labels[10:25, 5:40] = 0
    found, = large_planes(segmentation(wall[3], labels), GEOMETRY)
    columns = found.outline[:, 0] / found.outline[:, 2] * GEOMETRY.focal_px + GEOMETRY.cx_left
    rows = found.outline[:, 1] / found.outline[:, 2] * GEOMETRY.fy + GEOMETRY.cy
    np.testing.assert_allclose([columns.min(), columns.max()], [5, 39], atol=1e-6)
    np.testing.assert_allclose([rows.min(), rows.max()], [10, 24], atol=1e-6)


def test_small_unfitted_and_unbounded_planes_are_left_out(wall):
    labels = np.ones(SHAPE, np.int32)
    labels[0, :5] = 0
    assert large_planes(segmentation(wall[3], labels), GEOMETRY) == []
    horizon = (0.0, 0.5, -10.0)
    assert large_planes(segmentation(horizon), GEOMETRY) == []


def test_markers_replace_the_last_frames(wall):
    planes = large_planes(segmentation(wall[3]), GEOMETRY)
    markers = plane_markers(HEADER, planes).markers
    assert [m.action for m in markers] == [Marker.DELETEALL, Marker.ADD, Marker.ADD]
    outline, normal = markers[1:]
    assert all(m.header == HEADER for m in markers)
    assert outline.type == Marker.LINE_STRIP and outline.points[0] == outline.points[-1]
    start, end = (np.array([p.x, p.y, p.z]) for p in normal.points)
    np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), NORMAL, atol=1e-4)
    assert start @ NORMAL == pytest.approx(OFFSET, rel=1e-4)
    keys = [(m.ns, m.id) for m in markers[1:]]
    assert len(set(keys)) == len(keys)


def test_colors_rise_in_lightness_and_invalid_is_black():
    values = np.array([[np.nan, 10, 20, 30, 40, 73, 99, -5]], np.float32)
    colors = color_map(DisparityMap(values, 10, 64))
    assert colors.shape == (1, 8, 3) and colors.dtype == np.uint8
    assert (colors[0, 0] == 0).all()
    lightness = colors[0, 1:6] @ np.array([0.114, 0.587, 0.299])
    assert (np.diff(lightness) > 15).all()
    np.testing.assert_array_equal(colors[0, 6], colors[0, 5])
    np.testing.assert_array_equal(colors[0, 7], colors[0, 1])


def test_labels_travel_as_32_bit():
    labels = np.array([[0, 70000], [5, 2 ** 31 - 1]], np.int32)
    message = image_message(HEADER, labels, '32SC1')
    assert (message.encoding, message.step, message.header) == ('32SC1', 8, HEADER)
    np.testing.assert_array_equal(
        np.frombuffer(message.data, np.int32).reshape(2, 2), labels)


def test_segments_with_one_plane_count_as_one(wall):
    labels = np.repeat(np.arange(3, dtype=np.int32), 16)[:, None].repeat(SHAPE[1], axis=1)
    planes = np.array([wall[3], wall[3], [0.0, 0.0, 30.0]])
    segments = PlaneSegmentation(
        labels, planes, np.ones(3, bool), np.ones(3, np.float32))
    first, second = large_planes(segments, GEOMETRY)
    np.testing.assert_allclose(first.normal, NORMAL, atol=1e-4)
    rows = first.outline[:, 1] / first.outline[:, 2] * GEOMETRY.fy + GEOMETRY.cy
    np.testing.assert_allclose([rows.min(), rows.max()], [0, 31], atol=1e-6)
    np.testing.assert_allclose(second.normal, [0.0, 0.0, -1.0])


@pytest.mark.parametrize('preset', ['live', 'accurate'])
@pytest.mark.parametrize('seed', [0, 1])
def test_planes_of_a_rendered_scene(preset, seed):
    """Every plane that is shown is a true one: normal within 1 degree, offset within 1 %."""
    scene = render_scene(seed, 480, 640, 64, doffs_px=2.5)
    params = load_preset(preset, {'matching.num_disparities': 64})
    result = StereoRefiner(params).process(scene.pair.left, scene.pair.right)
    count = len(scene.planes)
    truth = large_planes(PlaneSegmentation(
        scene.labels, scene.planes, np.ones(count, bool), np.ones(count, np.float32)),
        scene.geometry)
    found = large_planes(result.segments, scene.geometry)
    assert len(found) >= 3
    for plane in found:
        nearest = max(truth, key=lambda true: plane.normal @ true.normal - abs(
            plane.offset_m - true.offset_m))
        assert np.degrees(np.arccos(min(1.0, plane.normal @ nearest.normal))) < 1.0
        assert plane.offset_m == pytest.approx(nearest.offset_m, rel=0.01)
