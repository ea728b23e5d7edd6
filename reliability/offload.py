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

"""Make a network interface send complete packets: python offload.py INTERFACE, as root."""

import array
import fcntl
import socket
import struct
import sys

_SIOCETHTOOL = 0x8946  # linux/sockios.h
# linux/ethtool.h: checksums, scatter-gather, TCP and generic segmentation by the card.
_SETTINGS = {'tx': 0x17, 'sg': 0x19, 'tso': 0x1f, 'gso': 0x24}


def switch_off(interface: str) -> None:
    """Leave nothing of a packet to the network card."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        for command in _SETTINGS.values():
            value = array.array('I', [command, 0])
            address, _ = value.buffer_info()
            fcntl.ioctl(any_socket, _SIOCETHTOOL, struct.pack('16sP', interface.encode(), address))


if __name__ == '__main__':
    switch_off(sys.argv[1])
