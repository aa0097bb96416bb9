"""Rigs without a particle that speak the lock-step protocol (docs/network-protocol.md), without this project's code."""

import contextlib
import math
import socket
import struct
import threading
import zlib

FRAME = "<4sHBBQQd6d"
HELLO, WELCOME, SENSORS, DRIVE = 1, 2, 4, 5
#: Structure of the default scene: mass, kg, stiffness, N/m, damping, N s/m.
MASS, STIFFNESS, DAMPING = 3.807, 11.68e3, 2.53
#: Steps of Runge and Kutta's method per sample: 400 a period leave errors of 1e-9.
STEPS = 4


class Oscillator:
    """An oscillator on a moving base, with the cubic stiffness `cubic`, 1/m², over its linear one."""

    def __init__(self, cubic: float) -> None:
        self.cubic = cubic
        self.phase = self.q = self.rate = self.base = 0.0

    def acceleration(self, q: float, rate: float, e: float, e_rate: float) -> float:
        stretch = q - e
        force = STIFFNESS * (stretch + self.cubic * q**3) + DAMPING * (rate - e_rate)
        return -force / MASS

    def advance(self, omega: float, amplitude: float, duration: float) -> None:
        """Moves the base as `amplitude sin(phase)` for a sample period, by Runge and Kutta's method of fourth order."""
        h = duration / STEPS
        for _ in range(STEPS):
            e, e_rate = [], []
            for part in (0.0, 0.5, 1.0):
                angle = self.phase + omega * h * part
                e.append(amplitude * math.sin(angle))
                e_rate.append(amplitude * omega * math.cos(angle))
            q, v = self.q, self.rate
            a1 = self.acceleration(q, v, e[0], e_rate[0])
            v2 = v + 0.5 * h * a1
            a2 = self.acceleration(q + 0.5 * h * v, v2, e[1], e_rate[1])
            v3 = v + 0.5 * h * a2
            a3 = self.acceleration(q + 0.5 * h * v2, v3, e[1], e_rate[1])
            v4 = v + h * a3
            a4 = self.acceleration(q + h * v3, v4, e[2], e_rate[2])
            self.q = q + h * (v + 2 * v2 + 2 * v3 + v4) / 6
            self.rate = v + h * (a1 + 2 * a2 + 2 * a3 + a4) / 6
            self.phase = (self.phase + omega * h) % (2 * math.pi)
        self.base = amplitude * math.sin(self.phase)


class LockStepServer:
    """Serves one session of a rig; its address is `tcp://127.0.0.1:PORT`. It reports no impacts."""

    def __init__(self, rig: Oscillator) -> None:
        self.rig = rig
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.thread = threading.Thread(target=self.serve, daemon=True)

    def __enter__(self) -> str:
        self.thread.start()
        return f"tcp://127.0.0.1:{self.listener.getsockname()[1]}"

    def __exit__(self, *_: object) -> None:
        self.listener.close()
        self.thread.join(timeout=60)

    def serve(self) -> None:
        client, _ = self.listener.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        step = 0.0
        # A client that has ended may leave readings unread.
        with contextlib.suppress(ConnectionError), client, client.makefile("rb") as stream:
            while (data := stream.read(84)) and len(data) == 84:
                assert struct.unpack("<I", data[80:])[0] == zlib.crc32(data[:80])
                magic, version, kind, _, session, sequence, _, *values = struct.unpack(FRAME, data[:80])
                assert (magic, version) == (b"VINE", 2)
                if kind == HELLO:
                    step = values[0]
                    # The sensors read q1 and the base displacement; the rig is silent for 5 s at most.
                    client.sendall(frame(WELCOME, session, 0, step, (step, 5.0, 1.0)))
                elif kind == DRIVE:
                    self.rig.advance(values[0], values[1], step)
                    sequence += 1
                else:
                    return
                client.sendall(frame(SENSORS, session, sequence, step, (self.rig.q, self.rig.base), flags=4))


def frame(kind: int, session: int, sequence: int, step: float, values: tuple[float, ...], flags: int = 0) -> bytes:
    """A frame of the protocol."""
    values += (0.0,) * (6 - len(values))
    body = struct.pack(FRAME, b"VINE", 2, kind, flags, session, sequence, sequence * step, *values)
    return body + struct.pack("<I", zlib.crc32(body))
