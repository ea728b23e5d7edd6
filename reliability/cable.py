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
A cable that delays and loses packets, in user space: frames of one interface go to another.

As the kernel's netem does, for kernels without it. Tells at the end what it carried, what it
lost on purpose, and what it lost because it was too slow, which should be nothing.
"""

from __future__ import annotations

import argparse
from collections import deque
import random
import select
import signal
import socket
import struct
import sys
import time

_ANY_PROTOCOL = 3
_BUFFER_BYTES = 1 << 26
_SO_SNDBUFFORCE, _SO_RCVBUFFORCE = 32, 33
_SOL_PACKET, _PACKET_STATISTICS = 263, 6
_LARGEST_FRAME = 1 << 16


def open_end(interface: str) -> socket.socket:
    """Open an interface for whole Ethernet frames."""
    end = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(_ANY_PROTOCOL))
    end.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, _BUFFER_BYTES)
    end.setsockopt(socket.SOL_SOCKET, _SO_SNDBUFFORCE, _BUFFER_BYTES)
    end.bind((interface, 0))
    end.setblocking(False)
    return end


def receive(end: socket.socket) -> bytes | None:
    """Return a frame that came in, None when there is none, b'' for one that went out."""
    try:
        frame, address = end.recvfrom(_LARGEST_FRAME)
    except BlockingIOError:
        return None
    return b'' if address[2] == socket.PACKET_OUTGOING else frame


class Cable:
    """Two ends, and the frames on their way in both directions."""

    def __init__(self, interfaces: list[str], delay_s: float, loss: float) -> None:
        """Open both ends; the losses are the same in every run."""
        self._ends = [open_end(name) for name in interfaces]
        self._way: deque[tuple[float, socket.socket, bytes]] = deque()
        self._delay_s, self._loss = delay_s, loss
        self._random = random.Random(0)
        self.carried = self.lost = 0

    def carry(self) -> None:
        """Take what came in, and hand out what is due."""
        wait = max(0.0, self._way[0][0] - time.monotonic()) if self._way else 0.1
        readable, _, _ = select.select(self._ends, [], [], min(wait, 0.1))
        for end in readable:
            other = self._ends[1 - self._ends.index(end)]
            for _ in range(256):
                frame = receive(end)
                if frame is None:
                    break
                self._accept(frame, other)
        now = time.monotonic()
        while self._way and self._way[0][0] <= now:
            _, end, frame = self._way.popleft()
            end.send(frame)
            self.carried += 1

    def too_slow(self) -> int:
        """Return how many frames the sockets had no room for."""
        return sum(struct.unpack('II', end.getsockopt(_SOL_PACKET, _PACKET_STATISTICS, 8))[1]
                   for end in self._ends)

    def _accept(self, frame: bytes, other: socket.socket) -> None:
        if not frame:
            return
        if self._random.random() < self._loss:
            self.lost += 1
        else:
            self._way.append((time.monotonic() + self._delay_s, other, frame))


def main() -> None:
    """Carry frames until interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('interfaces', nargs=2)
    parser.add_argument('--delay-ms', type=float, default=0.0)
    parser.add_argument('--loss-percent', type=float, default=0.0)
    options = parser.parse_args()
    cable = Cable(options.interfaces, options.delay_ms * 1e-3, options.loss_percent * 1e-2)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        while True:
            cable.carry()
    except KeyboardInterrupt:
        print(f'cable: {cable.carried} frames carried, {cable.lost} lost on purpose, '
              f'{cable.too_slow()} for lack of speed', file=sys.stderr)


if __name__ == '__main__':
    main()
