"""A rig in real time for the network protocol of vines (docs/network-protocol.md): replace the class `Hardware`.

python3 rig.py PORT
"""

import math
import socket
import struct
import sys
import time
import zlib

FRAME = "<4sHBBQQd6d"
HELLO, WELCOME, SENSORS, DRIVE, FAREWELL, REPORT = 1, 2, 4, 5, 6, 7
SILENCE, AMPLITUDE_MAX = 0.1, 5e-4  # longest silence, s; largest drive, m


class Hardware:
    """Replace this class by your converters. Here: the linear oscillator of the default scene, without a particle."""

    def __init__(self):
        self.theta = self.q = self.speed = self.base = 0.0

    def read(self):
        """Response and base, m."""
        return self.q, self.base

    def write(self, omega, amplitude, step):
        """Drives the base with this frequency, rad/s, and amplitude, m, for one step, s."""
        for _ in range(100):
            e, e_rate = amplitude * math.sin(self.theta), amplitude * omega * math.cos(self.theta)
            force = 11.68e3 * (e - self.q) + 2.53 * (e_rate - self.speed)
            self.speed += force / 3.807 * step / 100
            self.q += self.speed * step / 100
            self.theta = (self.theta + omega * step / 100) % (2 * math.pi)
        self.base = amplitude * math.sin(self.theta)


server = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
server.bind(("127.0.0.1", int(sys.argv[1])))
step = 2 * math.pi / math.sqrt(11.68e3 / 3.807) / 100  # sample time, s: as in the scene of the client


def send(peer, session, kind, sequence, *values, flags=0):
    body = struct.pack(
        FRAME, b"VINE", 2, kind, flags, session, sequence, sequence * step, *values, *[0] * (6 - len(values))
    )
    server.sendto(body + struct.pack("<I", zlib.crc32(body)), peer)


def received(wait):
    """The next valid frame within `wait` seconds: (peer, kind, session, sequence, values) or None."""
    server.settimeout(max(wait, 1e-6))
    try:
        data, peer = server.recvfrom(200)
    except (TimeoutError, BlockingIOError):
        return None
    if len(data) != 84 or zlib.crc32(data[:80]) != struct.unpack("<I", data[80:])[0]:
        return None
    magic, version, kind, _, session, sequence, _, *values = struct.unpack(FRAME, data[:80])
    return (peer, kind, session, sequence, values) if (magic, version) == (b"VINE", 2) else None


while True:
    frame = received(3600)
    if frame is None or frame[1] != HELLO:
        continue
    peer, _, session, _, _ = frame
    hardware, drive, newest, sample, missed, start = Hardware(), (0.0, 0.0), None, 0, 0, None
    send(peer, session, WELCOME, 0, step, SILENCE, 0)  # 0: the sensors read v and the base displacement
    send(peer, session, SENSORS, 0, *hardware.read(), flags=4)
    while True:
        # Until the end of this period, the newest valid drive of this session counts.
        end = None if start is None else start + (sample + 1) * step
        frame = received(1.0 if end is None else end - time.monotonic())
        if frame is not None and frame[2] == session:
            _, kind, _, sequence, values = frame
            if kind == HELLO:
                send(peer, session, WELCOME, 0, step, SILENCE, 0)
                send(peer, session, SENSORS, 0, *hardware.read(), flags=4)
            elif kind == FAREWELL:
                send(peer, session, REPORT, sample, sample, missed, 0, missed)
                break
            elif kind == DRIVE and all(map(math.isfinite, values)) and abs(values[1]) <= AMPLITUDE_MAX:
                if newest is None or sequence > newest:
                    newest, drive = sequence, values[:2]
                start = start or time.monotonic()
        if end is None or time.monotonic() < end:
            if end is None and frame is None:
                break  # the client has gone before its first drive
            continue
        missed += newest < sample
        if (sample - newest) * step > SILENCE:  # the client is silent or behind: shut down
            print("shut down: no drive for too long")
            break
        hardware.write(*drive, step)
        sample += 1
        send(peer, session, SENSORS, sample, *hardware.read(), flags=4)
    hardware.write(0.0, 0.0, step)
    print(f"session ended after {sample} samples, {missed} without a drive in time", flush=True)
