"""What is wrong with an answer, in words and in one word."""

import re
from decimal import Decimal

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
