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

"""Image messages to pixels: every encoding, padding, byte order, and refusals by reason."""

import cv2
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from sensor_msgs.msg import Image

from stereo_refine_ros.encodings import BadMessage, decode_image, ENCODINGS, MAX_SIDE

RED_BGR = (0, 0, 255)
PADDINGS = (0, 3)


def message_of(rows: np.ndarray, width: int, encoding: str, padding: int = 0,
               is_bigendian: int = 0) -> Image:
    """Build a message from rows of bytes, with bytes of padding that must not be read."""
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=0xEE)
    message = Image(height=rows.shape[0], width=width, encoding=encoding,
                    step=padded.shape[1], is_bigendian=is_bigendian)
    message.data.frombytes(padded.tobytes())
    return message


@pytest.fixture
def bgr():
    return np.random.default_rng(1).integers(0, 256, (6, 8, 3), np.uint8)


@pytest.mark.parametrize('padding', PADDINGS)
@pytest.mark.parametrize('encoding', ['mono8', '8UC1'])
def test_grey_is_taken_as_it_is(bgr, encoding, padding):
    grey = bgr[..., 0]
    decoded = decode_image('left', message_of(grey, 8, encoding, padding))
    np.testing.assert_array_equal(decoded, grey)
    assert decoded.flags.c_contiguous and decoded.flags.writeable


@pytest.mark.parametrize('padding', PADDINGS)
@pytest.mark.parametrize('encoding,order', [
    ('bgr8', [0, 1, 2]), ('8UC3', [0, 1, 2]), ('rgb8', [2, 1, 0]),
    ('bgra8', [0, 1, 2, 1]), ('8UC4', [0, 1, 2, 1]), ('rgba8', [2, 1, 0, 1])])
def test_colors_become_bgr(bgr, encoding, order, padding):
    rows = np.ascontiguousarray(bgr[..., order]).reshape(6, -1)
    decoded = decode_image('left', message_of(rows, 8, encoding, padding))
    np.testing.assert_array_equal(decoded, bgr)
    assert decoded.flags.c_contiguous


@pytest.mark.parametrize('padding', PADDINGS)
@pytest.mark.parametrize('is_bigendian', [0, 1])
@pytest.mark.parametrize('encoding', ['mono16', '16UC1'])
def test_sixteen_bits_stay_sixteen(encoding, is_bigendian, padding):
    values = np.array([[0, 128, 129, 257], [300, 32768, 65406, 65535]])
    rows = values.astype('>u2' if is_bigendian else '<u2').view(np.uint8)
    decoded = decode_image('left', message_of(rows, 4, encoding, padding, is_bigendian))
    np.testing.assert_array_equal(decoded, values)
    assert decoded.dtype == np.uint16 and decoded.dtype.isnative


@pytest.mark.parametrize('padding', PADDINGS)
@pytest.mark.parametrize('is_bigendian', [0, 1])
@pytest.mark.parametrize('encoding,order', [
    ('bgr16', [0, 1, 2]), ('16UC3', [0, 1, 2]), ('rgb16', [2, 1, 0]),
    ('bgra16', [0, 1, 2, 1]), ('16UC4', [0, 1, 2, 1]), ('rgba16', [2, 1, 0, 1])])
def test_colors_of_sixteen_bits_become_bgr(bgr, encoding, order, is_bigendian, padding):
    deep = bgr.astype(np.uint16) * 200 + 7
    rows = np.ascontiguousarray(deep[..., order]).astype('>u2' if is_bigendian else '<u2')
    decoded = decode_image('left', message_of(
        rows.reshape(6, -1).view(np.uint8), 8, encoding, padding, is_bigendian))
    np.testing.assert_array_equal(decoded, deep)
    assert decoded.dtype == np.uint16 and decoded.dtype.isnative


@pytest.mark.parametrize('encoding,order', [
    ('yuv422', 'uyvy'), ('uyvy', 'uyvy'), ('yuv422_yuy2', 'yuyv'), ('yuyv', 'yuyv')])
def test_yuv_of_one_color(encoding, order):
    # BT.601 in studio range: red is Y 81, U 90, V 240.
    pair = [{'y': 81, 'u': 90, 'v': 240}[name] for name in order]
    rows = np.tile(np.array(pair, np.uint8), (4, 3))
    decoded = decode_image('left', message_of(rows, 6, encoding))
    assert decoded.shape == (4, 6, 3)
    assert np.abs(decoded.astype(int) - RED_BGR).max() <= 3


def _planes(encoding, left, right):
    """Build rows of 4:2:0 or 4:4:4 video with one colour left and another right, 8 x 4 pixels."""
    luma = np.repeat([[left[0], right[0]]], 4, axis=0).repeat(4, axis=1)
    order = [2, 1] if encoding == 'nv21' else [1, 2]
    pairs = [[color[order[0]], color[order[1]]] for color in (left, right)]
    if encoding == 'nv24':
        chroma = np.tile(np.repeat(pairs, 4, axis=0).reshape(1, 16), (4, 1)).reshape(8, 8)
    else:
        chroma = np.tile(np.repeat(pairs, 2, axis=0).reshape(1, 8), (2, 1))
    return np.vstack([luma, chroma]).astype(np.uint8)


@pytest.mark.parametrize('padding', PADDINGS)
@pytest.mark.parametrize('encoding', ['nv12', 'nv21', 'nv24'])
def test_planes_of_video(encoding, padding):
    # Red and blue in studio range: Y, U, V of BT.601.
    rows = _planes(encoding, (81, 90, 240), (41, 240, 110))
    message = message_of(rows, 8, encoding, padding)
    message.height = 4
    decoded = decode_image('left', message)
    assert decoded.shape == (4, 8, 3) and decoded.dtype == np.uint8
    assert np.abs(decoded[:, :4].astype(int) - RED_BGR).max() <= 3
    assert np.abs(decoded[:, 4:].astype(int) - (255, 0, 0)).max() <= 3


def test_grey_of_all_planes_is_the_same():
    grey = []
    for encoding in ('nv12', 'nv21', 'nv24'):
        rows = _planes(encoding, (16, 128, 128), (235, 128, 128))
        rows[:4, :4] += np.arange(16, dtype=np.uint8).reshape(4, 4) * 10
        message = message_of(rows, 8, encoding)
        message.height = 4
        grey.append(decode_image('left', message).astype(int))
    assert np.ptp(grey, axis=0).max() <= 1
    assert (grey[0][:, 4:] >= 254).all() and grey[0][0, 0].max() == 0


@pytest.mark.parametrize('encoding, step', [('nv12', 12), ('nv21', 16), ('nv24', 24)])
def test_planes_end_to_end_under_a_step_that_counts_them_all(encoding, step):
    message = message_of(_planes(encoding, (81, 90, 240), (41, 240, 110)), 8, encoding)
    expected = message_of(_planes(encoding, (81, 90, 240), (41, 240, 110)), 8, encoding)
    message.height = expected.height = 4
    message.step = step
    np.testing.assert_array_equal(decode_image('l', message), decode_image('l', expected))


@pytest.mark.parametrize('is_bigendian', [0, 1])
@pytest.mark.parametrize('bits', [8, 16])
@pytest.mark.parametrize('pattern', ['rggb', 'bggr', 'gbrg', 'grbg'])
def test_bayer_of_one_color(pattern, bits, is_bigendian):
    factor, kind = (1, 'u1') if bits == 8 else (250, '>u2' if is_bigendian else '<u2')
    cell = np.array([200 if c == 'r' else 100 if c == 'g' else 50 for c in pattern]) * factor
    rows = np.tile(cell.reshape(2, 2), (4, 4)).astype(kind).view(np.uint8)
    decoded = decode_image(
        'left', message_of(rows, 8, f'bayer_{pattern}{bits}', is_bigendian=is_bigendian))
    assert decoded.shape == (8, 8, 3) and decoded.dtype == f'u{bits // 8}'
    expected = np.broadcast_to(np.array([50, 100, 200]) * factor, (4, 4, 3))
    np.testing.assert_array_equal(decoded[2:-2, 2:-2], expected)


@pytest.mark.parametrize('change,reason', [
    ({'encoding': 'rgb9'}, 'encoding'), ({'encoding': '32FC1'}, 'encoding'),
    ({'encoding': ''}, 'encoding'), ({'width': 0}, 'zero_size'), ({'height': 0}, 'zero_size'),
    ({'height': 7}, 'data_size'), ({'height': 5}, 'data_size'), ({'step': 7}, 'step'),
    ({'step': 0}, 'step'), ({'step': 9}, 'data_size'),
    ({'width': 2 ** 32 - 1, 'step': 2 ** 32 - 1}, 'too_large'),
    ({'height': 2 ** 32 - 1}, 'too_large'), ({'width': 8193, 'height': 4096}, 'too_large'),
    ({'width': MAX_SIDE + 1}, 'too_large'),
    ({'encoding': 'nv12'}, 'data_size'), ({'encoding': 'nv24', 'height': 3}, 'data_size'),
    ({'encoding': 'nv21', 'height': 5}, 'data_size'), ({'encoding': 'bgr16'}, 'step'),
    ({'encoding': 'nv21', 'height': 4, 'width': 7}, 'encoding'),
    ({'encoding': 'bgr8'}, 'step'), ({'width': 3, 'encoding': 'yuv422'}, 'encoding'),
    ({'width': 2, 'encoding': 'bayer_rggb8'}, 'encoding')])
def test_refusals(bgr, change, reason):
    message = message_of(bgr[..., 0], 8, 'mono8')
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(BadMessage) as error:
        decode_image('left/image_rect', message)
    assert error.value.reason == reason
    assert 'left/image_rect' in str(error.value)


@settings(max_examples=300, deadline=None)
@given(height=st.integers(0, 2 ** 32 - 1) | st.integers(0, 6),
       width=st.integers(0, 2 ** 32 - 1) | st.integers(0, 6),
       step=st.integers(0, 2 ** 32 - 1) | st.integers(0, 24), size=st.integers(0, 100),
       encoding=st.sampled_from([*ENCODINGS, 'other']), is_bigendian=st.integers(0, 255),
       fits=st.booleans())
def test_any_fields_give_pixels_or_a_reason(height, width, step, size, encoding, is_bigendian,
                                            fits):
    if fits and height * step < 1000:
        size = int(height * step * (ENCODINGS[encoding].rows if encoding in ENCODINGS else 1))
    message = Image(height=height, width=width, step=step, encoding=encoding,
                    is_bigendian=is_bigendian)
    message.data.frombytes(bytes(size))
    try:
        decoded = decode_image('left', message)
    except BadMessage as error:
        assert error.reason in {
            'encoding', 'zero_size', 'too_large', 'step', 'data_size'}
    else:
        assert decoded.shape[:2] == (height, width)
        assert decoded.dtype == f'u{ENCODINGS[encoding].item_bytes}'


def test_conversions_agree_with_opencv(bgr):
    """A gradient through UYVY and back stays within the loss of chroma sub-sampling."""
    smooth = cv2.resize(bgr[:2, :2], (16, 8), interpolation=cv2.INTER_CUBIC)
    yuv = cv2.cvtColor(smooth, cv2.COLOR_BGR2YUV).astype(int)
    luma = np.rint(16 + yuv[..., 0] * 219 / 255)
    chroma = np.full(luma.shape, 128.0)
    rows = np.stack([chroma, luma], axis=2).astype(np.uint8).reshape(8, -1)
    decoded = decode_image('left', message_of(rows, 16, 'yuv422'))
    assert np.abs(cv2.cvtColor(decoded, cv2.COLOR_BGR2GRAY).astype(int) - yuv[..., 0]).max() <= 3
