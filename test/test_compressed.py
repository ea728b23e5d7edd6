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

"""Compressed images: as image_transport and drivers send them, damaged ones, and bombs."""

import struct
import zlib

import cv2
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest
from sensor_msgs.msg import CompressedImage

from stereo_refine_ros.compressed import check_compressed, decode_compressed
from stereo_refine_ros.encodings import BadMessage, MAX_SIDE

REASONS = {'encoding', 'zero_size', 'too_large', 'data_size'}


def message_of(data, kind='jpeg'):
    message = CompressedImage(format=kind)
    message.data.frombytes(bytes(data))
    return message


def encoded(pixels, suffix='.png'):
    return cv2.imencode(suffix, pixels)[1].tobytes()


def refusal(message):
    with pytest.raises(BadMessage) as error:
        decode_compressed('left/image_rect/compressed', message)
    assert 'left/image_rect/compressed' in str(error.value)
    return error.value.reason, str(error.value)


@pytest.fixture(scope='module')
def bgr():
    noise = np.random.default_rng(1).integers(0, 256, (6, 8, 3), np.uint8)
    return cv2.resize(noise, (32, 24), interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize('form', [
    'png', 'bgr8; png compressed bgr8', 'rgb8; png compressed bgr8', 'PNG', '',
    'bgra8; png compressed bgr8', 'image/png', 'bgr8; png'])
def test_png_is_exact_in_all_forms(bgr, form):
    # `bgr8; png` says what it was but not what was stored: as stored, as image_transport reads it
    stored = bgr[..., ::-1] if form == 'bgr8; png' else bgr
    found = decode_compressed('left', message_of(encoded(stored), form))
    np.testing.assert_array_equal(found, bgr)
    assert found.flags.c_contiguous


def test_colours_that_were_not_exchanged(bgr):
    """Old publishers compress rgb8 as it is; image_transport exchanges red and blue again."""
    message = message_of(encoded(bgr[..., ::-1]), 'rgb8; png compressed rgb8')
    np.testing.assert_array_equal(decode_compressed('left', message), bgr)


@pytest.mark.parametrize('form', [
    'jpeg', 'jpg', 'bgr8; jpeg compressed bgr8', 'rgb8; jpeg compressed bgr8'])
def test_jpeg_in_colour(bgr, form):
    data = encoded(bgr, '.jpg')
    found = decode_compressed('left', message_of(data, form))
    assert found.shape == bgr.shape and found.dtype == np.uint8
    assert np.abs(found.astype(int) - bgr).mean() < 10
    assert np.abs(found.astype(int) - bgr[..., ::-1]).mean() > 20


def test_grey_jpeg_with_padding_behind_it(bgr):
    data = encoded(bgr[..., 0], '.jpg') + bytes(100)
    found = decode_compressed('left', message_of(data, 'mono8; jpeg compressed '))
    assert found.shape == (24, 32)
    assert np.abs(found.astype(int) - bgr[..., 0]).mean() < 6


@pytest.mark.parametrize('form, channels', [
    ('mono16; png compressed mono16', 1), ('16UC1; png compressed ', 1),
    ('rgb16; png compressed bgr16', 3)])
def test_png_of_16_bits_keeps_them(bgr, form, channels):
    deep = bgr.astype(np.uint16) * 200 + 3
    deep = deep if channels == 3 else deep[..., 0]
    found = decode_compressed('left', message_of(encoded(deep), form))
    np.testing.assert_array_equal(found, deep)
    assert found.dtype == np.uint16


@pytest.mark.parametrize('bits', [8, 16])
def test_bayer_mosaic_becomes_colour(bits):
    mosaic = np.tile(np.array([[200, 100], [100, 50]]), (4, 4)).astype(f'u{bits // 8}')
    form = f'bayer_rggb{bits}; png compressed bayer_rggb{bits}'
    found = decode_compressed('left', message_of(encoded(mosaic), form))
    np.testing.assert_array_equal(
        found[2:-2, 2:-2], np.broadcast_to([50, 100, 200], (4, 4, 3)))


def test_alpha_is_dropped(bgr):
    bgra = np.dstack([bgr, bgr[..., 0]])
    np.testing.assert_array_equal(
        decode_compressed('left', message_of(encoded(bgra), 'png')), bgr)


def _png(width, height, body=b''):
    def chunk(kind, content):
        crc = struct.pack('>I', zlib.crc32(kind + content))
        return struct.pack('>I', len(content)) + kind + content + crc
    head = struct.pack('>IIBBBBB', width, height, 8, 2, 0, 0, 0)
    return (b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', head) + chunk(b'IDAT', zlib.compress(body))
            + chunk(b'IEND', b''))


def _jpeg_of_size(data, width, height):
    """Change the size in the frame header of a JPEG."""
    at = data.index(b'\xff\xc0') + 5
    return data[:at] + struct.pack('>HH', height, width) + data[at + 4:]


@pytest.mark.parametrize('width, height, reason', [
    (65535, 65535, 'too_large'), (MAX_SIDE + 1, 1, 'too_large'), (16384, 2049, 'too_large'),
    (0, 8, 'zero_size')])
def test_bombs_are_refused_by_their_header(bgr, width, height, reason):
    bomb = message_of(_jpeg_of_size(encoded(bgr, '.jpg'), width, height))
    assert refusal(bomb)[0] == reason
    assert refusal(message_of(_png(width, height), 'png'))[0] == reason
    with pytest.raises(BadMessage):
        check_compressed('left', bomb)


def test_a_png_that_unpacks_to_a_thousand_times_its_size_is_bounded_by_its_header():
    found = decode_compressed('left', message_of(_png(8, 8, bytes(50_000_000)), 'png'))
    assert found.shape == (8, 8, 3)


def test_more_data_than_any_image_of_that_size_has(bgr):
    data = encoded(bgr)
    long = data[:-12] + struct.pack('>I', 900_000) + b'teXt' + bytes(900_004) + data[-12:]
    reason, text = refusal(message_of(long, 'png'))
    assert (reason, '32 x 24 pixels' in text) == ('data_size', True)


@pytest.mark.parametrize('suffix', ['.png', '.jpg'])
@pytest.mark.parametrize('share', [0.0, 0.02, 0.1, 0.5, 0.99])
def test_cut_off_files_are_refused_not_painted_grey(bgr, suffix, share):
    data = encoded(bgr, suffix)
    reason, text = refusal(message_of(data[:int(share * len(data))], suffix[1:]))
    assert reason in ('data_size', 'encoding')
    assert 'cut off' in text or 'neither jpeg nor png' in text


def test_a_png_with_a_changed_byte_is_refused(bgr):
    data = bytearray(encoded(bgr))
    data[len(data) // 2] ^= 1
    reason, text = refusal(message_of(data, 'png'))
    assert (reason, 'checksum' in text) == ('data_size', True)


@pytest.mark.parametrize('form, data, word', [
    ('h264', b'\x00\x00\x00\x01g', 'neither jpeg nor png'),
    ('16UC1; compressedDepth png', b'\0' * 12 + b'\x89PNG', 'depth map'),
    ('x' * 3000, b'', 'neither jpeg nor png')])
def test_other_formats_are_named(form, data, word):
    reason, text = refusal(message_of(data, form))
    assert reason == 'encoding' and word in text and len(text) < 300


@settings(max_examples=300, deadline=None)
@given(data=st.binary(max_size=300), start=st.sampled_from([b'', b'\xff\xd8', _png(4, 4)[:33]]),
       form=st.text(max_size=30) | st.sampled_from(['jpeg', 'bayer_rggb8; png compressed']),
       end=st.sampled_from([b'', b'\xff\xd9', _png(4, 4)[-12:]]))
def test_any_bytes_give_pixels_or_a_reason(data, start, form, end):
    try:
        found = decode_compressed('left', message_of(start + data + end, form))
    except BadMessage as error:
        assert error.reason in REASONS
    else:
        assert found.dtype in (np.uint8, np.uint16) and found.ndim in (2, 3)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=6))
def test_a_jpeg_with_changed_bytes_gives_its_size_or_a_reason(changes):
    pixels = np.random.default_rng(1).integers(0, 256, (24, 32), np.uint8)
    data = bytearray(encoded(pixels, '.jpg'))
    for where, value in changes:
        data[int(where * (len(data) - 1))] = value
    try:
        header = check_compressed('left', message_of(data))
        found = decode_compressed('left', message_of(data))
    except BadMessage as error:
        assert error.reason in REASONS
    else:
        assert found.shape[:2] == (header.height, header.width)
