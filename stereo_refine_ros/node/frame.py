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

"""One frame: messages checked in the callback, pixels decoded in the worker."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import numpy as np
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header
from stereo_msgs.msg import DisparityImage

from stereo_refine_ros.camera_info import AS_PUBLISHED
from stereo_refine_ros.decoding import PairDecoder, view_size
from stereo_refine_ros.encodings import BadMessage
from stereo_refine_ros.messages.disparity import (
    check_disparity, read_disparity, ReceivedDisparity, resize_disparity)
from stereo_refine_ros.node.calibration import calibrate, Calibration, Note
from stereo_refine_ros.pairing import MessageSet
from stereo_refine_ros.params import CameraParams, Params, SPEC_BY_NAME
from stereo_refine_ros.types import FloatMap, StereoGeometry, StereoPair

LEFT, RIGHT = 'left/image_rect', 'right/image_rect'
LEFT_INFO, RIGHT_INFO = 'left/camera_info', 'right/camera_info'
PRELIMINARY, TRUTH = 'preliminary/disparity', 'ground_truth/disparity'
View = Image | CompressedImage


@dataclass(frozen=True, eq=False)
class Frame:
    """
    Checked messages of one instant.

    Attributes
    ----------
    header : std_msgs.msg.Header
        For every output: of the left image in the frame of its camera_info, or of the external
        disparity.
    geometry : StereoGeometry or None
        None where there is none, or it has to come from the external disparity itself.
    left, right, preliminary : messages, or None where the frame has none
    calibration : Calibration
        The messages behind the geometry; the left one goes out beside the depth.
    is_raw : bool
        The images have to be rectified by them.
    notes : tuple of Note
        What is doubtful.

    """

    header: Header
    geometry: StereoGeometry | None
    left: View
    right: View | None = None
    preliminary: DisparityImage | None = None
    calibration: Calibration = Calibration()
    is_raw: bool = False
    notes: tuple[Note, ...] = ()

    @property
    def stamp_ns(self) -> int:
        """Stamp of the left image in nanoseconds: ground truth comes with it."""
        return stamp_ns(self.left.header)


@dataclass(frozen=True, eq=False)
class DecodedFrame:
    """
    Pixels and numbers of one instant.

    Attributes
    ----------
    pair : StereoPair
    geometry : StereoGeometry
    has_principal_point : bool
        False where no camera_info came: points are unknown, depth too where `has_depth` is
        False.
    preliminary : float32 ndarray of shape (H, W), or None
        Differences of image columns, NaN invalid.
    search_range : (int, int) or None
        Smallest disparity and number of disparities that the external matcher declared.
    rescaled : bool
        The external disparity had another size than the image.

    """

    pair: StereoPair
    geometry: StereoGeometry
    has_principal_point: bool = True
    preliminary: FloatMap | None = None
    search_range: tuple[int, int] | None = None
    rescaled: bool = False

    @property
    def has_depth(self) -> bool:
        """Whether focal length and baseline are known."""
        return self.geometry.focal_px > 0 and self.geometry.baseline_m > 0


def check_frame(found: MessageSet, calibration: Calibration,
                camera: CameraParams = AS_PUBLISHED, is_raw: bool = False) -> Frame:
    """
    Check a set of messages without touching pixels.

    Parameters
    ----------
    found : MessageSet
        Images, and the disparity of another matcher.
    calibration : Calibration
        Of the images.
    camera : CameraParams
        What stands instead of the calibration.
    is_raw : bool
        Whether the images have to be rectified.

    Raises
    ------
    BadMessage
        Saying which message is wrong and why.

    """
    messages = found.messages
    left, right = messages[LEFT], messages.get(RIGHT)
    size = view_size(LEFT, left)
    if right is not None:
        _check_same_size(size, view_size(RIGHT, right))
    if is_raw:
        _check_can_rectify(calibration, right is not None)
    if PRELIMINARY in messages:
        preliminary = messages[PRELIMINARY]
        check_disparity(PRELIMINARY, preliminary)
        # Where neither camera_info nor parameters say it, the map's own f and T serve.
        is_known = calibration.is_complete or (camera.baseline and camera.focal_length)
        geometry, notes = calibrate(calibration, camera, *size) if is_known else (None, ())
        return Frame(preliminary.header, geometry, left, right, preliminary, calibration, is_raw,
                     notes)
    geometry, notes = calibrate(calibration, camera, *size)
    info = calibration.left
    frame_id = (info.header.frame_id if info is not None else '') or left.header.frame_id
    header = Header(stamp=left.header.stamp, frame_id=frame_id)
    return Frame(header, geometry, left, right, None, calibration, is_raw, notes)


def decode_frame(frame: Frame, decoder: PairDecoder | None = None) -> DecodedFrame:
    """Decode the pixels of a checked frame, as those of the frames before it were."""
    infos = (frame.calibration.left, frame.calibration.right) if frame.is_raw else None
    pair = (decoder or PairDecoder()).decode(frame.left, frame.right, infos)
    if frame.preliminary is not None:
        return _with_preliminary(frame, frame.preliminary, pair)
    if frame.geometry is None:
        return DecodedFrame(pair, _no_geometry(pair), has_principal_point=False)
    return DecodedFrame(pair, frame.geometry)


def with_declared_range(params: Params, search_range: tuple[int, int] | None) -> Params:
    """Take the search range that an external matcher declared, if parameters can hold it."""
    if search_range is None:
        return params
    try:
        return params.updated({'matching.min_disparity': search_range[0],
                               'matching.num_disparities': search_range[1]})
    except ValueError:
        return params


def stamp_ns(header: Header) -> int:
    """Return a stamp in nanoseconds; rclpy's own Time refuses those before 1970."""
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def with_nearest(params: Params, geometry: StereoGeometry) -> Params:
    """Search as far as `matching.nearest` asks, where it is set and the geometry is known."""
    matching = params.matching
    if matching.nearest <= 0.0 or geometry.baseline_m <= 0.0:
        return params
    largest = geometry.focal_px * geometry.baseline_m / matching.nearest - geometry.doffs_px
    spec = SPEC_BY_NAME['matching.num_disparities']
    count = math.ceil(largest - 1e-6) - matching.min_disparity + 1
    return params.updated({'matching.num_disparities': int(
        min(max(count, spec.low or 1), spec.high or count))})


def decode_truth(message: DisparityImage, decoded: DecodedFrame) -> tuple[
        FloatMap, float | None]:
    """
    Decode the ground truth of a frame.

    Returns
    -------
    truth : float32 ndarray of shape (H, W)
        Differences of image columns, NaN unknown.
    scale : float or None
        Grey levels per pixel of the data set's 8-bit maps: 1 / delta_d where that keeps the
        declared range within 8 bits, else None.

    Raises
    ------
    BadMessage
        For a truth that cannot be read or does not fit the image.

    """
    received = read_disparity(TRUTH, message)
    if received.values.shape != decoded.pair.shape:
        raise BadMessage('truth', f'{TRUTH}: shape {received.values.shape}, the image has '
                         f'{decoded.pair.shape}; publish it at the size of the image')
    scale = None
    if received.delta_d > 0 and received.max_disparity / received.delta_d <= 256:
        scale = 1.0 / received.delta_d
    return received.values - received.values.dtype.type(decoded.geometry.doffs_px), scale


def _with_preliminary(frame: Frame, message: DisparityImage, pair: StereoPair
                      ) -> DecodedFrame:
    received = read_disparity(PRELIMINARY, message)
    height, width = pair.shape
    ratio = width / received.values.shape[1]
    _check_aspect(received.values.shape, (height, width))
    geometry = frame.geometry or _declared_geometry(received, ratio, pair)
    values = resize_disparity(received.values, width, height)
    doffs = geometry.doffs_px
    columns = values - values.dtype.type(doffs)
    columns[np.abs(columns) > width] = np.nan  # no column of the right image lies there
    return DecodedFrame(
        pair, geometry, frame.geometry is not None, columns,
        _search_range(received, ratio, doffs), received.values.shape != (height, width))


def _check_aspect(given: tuple[int, ...], image: tuple[int, int]) -> None:
    """Refuse a crop: stretched, it would lie beside the image."""
    if abs(given[0] * image[1] / given[1] - image[0]) > 1.5 * image[1] / given[1]:
        raise BadMessage(
            'aspect_ratio', f'{PRELIMINARY} is {given[1]} x {given[0]}, the left image '
            f'{image[1]} x {image[0]}: another aspect ratio is a crop of it')


def _search_range(received: ReceivedDisparity, ratio: float, doffs: float
                  ) -> tuple[int, int] | None:
    if not received.has_range:
        return None
    low = math.floor(received.min_disparity * ratio - doffs + 1e-3)
    high = math.ceil(received.max_disparity * ratio - doffs - 1e-3)
    return low, high - low + 1


def _declared_geometry(received: ReceivedDisparity, ratio: float, pair: StereoPair
                       ) -> StereoGeometry:
    """Take focal length and baseline from the external map, where it says both."""
    middle = _no_geometry(pair)
    if not (math.isfinite(received.focal_px) and math.isfinite(received.baseline_m)):
        return middle
    return replace(
        middle, focal_px=received.focal_px * ratio, baseline_m=received.baseline_m)


def _no_geometry(pair: StereoPair) -> StereoGeometry:
    """Return a geometry that says nothing: focal length and baseline 0, as a message says it."""
    height, width = pair.shape
    cx = (width - 1) / 2.0
    return StereoGeometry(0.0, 0.0, cx, (height - 1) / 2.0, cx)


def _check_same_size(left: tuple[int, int], right: tuple[int, int]) -> None:
    if left != right:
        raise BadMessage('size_differs', f'left image is {left[0]} x {left[1]}, '
                         f'right image {right[0]} x {right[1]}')


def _check_can_rectify(calibration: Calibration, has_right: bool) -> None:
    missing = [LEFT_INFO] if calibration.left is None else []
    missing += [RIGHT_INFO] if has_right and calibration.right is None else []
    if missing:
        raise BadMessage(
            'distortion', f'inputs.rectify needs {" and ".join(missing)}, and none came')
