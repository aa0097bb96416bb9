"""What a run of the benchmark measures: rows, points, what other programs took, and what is wrong with an answer."""

import os
import re
import statistics
import time
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path


class Load:
    """Processor time that other programs take while this one measures."""

    def __init__(self, workers):
        self.workers = workers
        self.began, self.all_began, self.own_began = time.monotonic(), self.all(), self.own()

    @staticmethod
    def all():
        """Busy seconds of all cores since the machine started; none where the system does not say."""
        try:
            user, nice, system, _, _, irq, softirq, steal = map(int, Path("/proc/stat").read_text().split()[1:9])
        except (OSError, ValueError):
            return None
        return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")

    def own(self):
        """Processor seconds of this program and its workers, the ended ones included."""
        parts = os.times()
        total = parts.user + parts.system + parts.children_user + parts.children_system
        for worker in self.workers:
            total += worker.processor_seconds()
        return total

    def others(self):
        """Cores that other programs kept busy on average; none where the system does not say."""
        if self.all_began is None:
            return None
        busy = self.all() - self.all_began - (self.own() - self.own_began)
        return max(0.0, busy / (time.monotonic() - self.began))


def middle_point(points):
    """Of points (size, ns, work) of the same size, that with the median of the times."""
    return [points[0][0], statistics.median(point[1] for point in points), points[0][2]]


@dataclass
class Row:
    """One method at one setting on one scene."""

    scene: str
    method: str
    side: str
    name: str
    setting: float
    times: list = field(default_factory=list)  # A median per round.
    ratios: list = field(default_factory=list)  # Over the plant's time, a pair of turns each.
    error: float | None = None
    impacts: int = 0
    failure: str | None = None

    @property
    def median(self):
        return statistics.median(self.times)

    @property
    def spread(self):
        """Half the distance of the quartiles, as a part of the median."""
        if len(self.times) < 2:
            return None
        low, _, high = statistics.quantiles(self.times, n=4, method="inclusive")
        return 0.5 * (high - low) / self.median

    def over(self, plant):
        """Time over the plant's: median of the pairs between their quartiles; else the ratio of the medians alone."""
        if len(self.ratios) > 1:
            return statistics.quantiles(self.ratios, n=4, method="inclusive")
        return None, self.median / plant.median, None

    def given_up(self):
        """Whether it failed in the first round: it is not tried again."""
        return self.failure is not None and not self.times


# Half-widths beyond the wall that rounding and a method's own penetration may make.
TOUCH = 0.01
LOST = 0.1

SHORT = (
    ("missed", "misses impacts"),
    ("tunnelled", "tunnels"),
    ("stalled", "stalls"),
    ("lost", "lost"),
    ("time limit", "too slow"),
    ("hung", "hangs"),
    ("crashed", "crashes"),
    ("not asked", "\N{EN DASH}"),
)


def short(failure):
    """One word for it."""
    return next((word for start, word in SHORT if failure.startswith(start)), "gives up")


def judge(name, scene, truth, answer, checks):
    """Largest error over the instants compared, and how the answer is wrong, if it is."""
    wanted = {entry[0]: entry[1:5] for entry in truth["rows"]}
    error, widest = Decimal(0), 0.0
    for n, state in zip(checks, answer["states"], strict=True):
        error = max(error, *(abs(Decimal(x) - Decimal(y)) for x, y in zip(state, wanted[n], strict=True)))
        widest = max(widest, abs(state[0] - state[2]) / scene["b"])
    error, impacts = float(error), answer["impacts"]
    if error != error:
        return error, "lost the trajectory: not a number"
    beyond = widest - 1.0
    # A time-stepping scheme goes a little into the wall at every impact: that alone is no tunnelling.
    if beyond > (LOST if name == "moreau" else TOUCH):
        return error, f"tunnelled through the wall: by {0.5 * beyond:.2g} gap widths, error {error:.1g}"
    few = impacts < truth["impacts"] and not truth["events"] and error > 1e-7
    if few and error < LOST:
        what = "the graze" if truth["impacts"] == 1 else "impacts"
        return error, f"missed {what}: {impacts} of {truth['impacts']}, error {error:.0e}"
    if error > LOST * scene["b"]:
        count = f", {impacts} of {truth['impacts']} impacts" if impacts != truth["impacts"] else ""
        return error, f"lost the trajectory: error {error:.1g}{count}"
    return error, None


def time_at_the_limit(failure, limit, impacts):
    """ns per impact at the pace of a run that was given up, or None."""
    found = re.match(r"time limit: ([\d.]+) %", failure or "")
    if not found or not float(found[1]):
        return None
    return 1e9 * limit / (0.01 * float(found[1])) / max(1, impacts)
