"""A client of the network protocol of vines (docs/network-protocol.md): drives a rig for 1000 samples.

python3 client.py PORT        a rig in real time, over UDP
python3 client.py PORT tcp    a rig in lock-step
"""

import random
import socket
import struct
import sys
import zlib

FRAME, HELLO, WELCOME, REFUSAL, SENSORS, DRIVE, FAREWELL = "<4sHBBQQd6d", 1, 2, 3, 4, 5, 6
session, peer, tcp = random.getrandbits(64), ("127.0.0.1", int(sys.argv[1])), "tcp" in sys.argv
link = socket.socket(socket.AF_INET, socket.SOCK_STREAM if tcp else socket.SOCK_DGRAM)
link.connect(peer)
link.settimeout(1)


def send(kind, sequence, *values):
    body = struct.pack(
        FRAME, b"VINE", 2, kind, 0, session, sequence, sequence * sample_time, *values, *[0] * (6 - len(values))
    )
    link.send(body + struct.pack("<I", zlib.crc32(body)))


def receive(wanted):
    while True:
        data = link.recv(84, socket.MSG_WAITALL if tcp else 0)
        if len(data) == 84 and zlib.crc32(data[:80]) == struct.unpack("<I", data[80:])[0]:
            magic, version, kind, flags, owner, sequence, _time, *values = struct.unpack(FRAME, data[:80])
            if (magic, version, kind, owner) == (b"VINE", 2, REFUSAL, session) or flags & 16:
                sys.exit(f"the rig has refused or shut down: {values}")
            if (magic, version, kind, owner) == (b"VINE", 2, wanted, session):
                return sequence, values
        elif not data:
            sys.exit("the rig has closed the connection")


sample_time = 2 * 3.141592653589793 / (11.68e3 / 3.807) ** 0.5 / 100
send(HELLO, 0, sample_time)
receive(WELCOME)
for _ in range(1000):
    sequence, (response, base, *_) = receive(SENSORS)
    send(DRIVE, sequence, 55.4, 92e-6)
if not tcp:
    send(FAREWELL, 0)
print(f"sample {sequence}: response {response:.6f} m, base {base:.6f} m")
