"""The motion between impacts in arithmetic of any precision: closed forms and the search for their roots."""

from cmath import exp
from dataclasses import dataclass

from mpmath import mp, mpc, mpf


@dataclass
class Oscillator:
    """mass q'' + c q' + k q = k e + c e', with e = amplitude sin(omega t + phase)."""

    mass: mpf
    c: mpf
    k: mpf

    def roots(self):
        half = self.c / (2 * self.mass)
        return (-half + mp.sqrt(mpc(half**2 - self.k / self.mass)), -half - mp.sqrt(mpc(half**2 - self.k / self.mass)))


class Motion:
    """One stretch of the oscillator's motion from (x, v), as sums of complex exponentials: Re sum (a + b t) e^(s t)."""

    def __init__(self, oscillator, x, v, amplitude, omega, phase):
        one, two = oscillator.roots()
        self.terms = []
        x_rest, v_rest = mpc(x), mpc(v)
        if amplitude:
            # e = Re(-i A e^(i phase) e^(i omega t)); the base pulls with k e + c e'.
            s = mpc(0, omega)
            pull = -1j * amplitude * mp.expj(phase) * (oscillator.k + s * oscillator.c)
            stiffness = oscillator.mass * s**2 + oscillator.c * s + oscillator.k
            if stiffness:
                a, b = pull / stiffness, mpc(0)
            else:  # Undamped resonance: b t e^(s t), with 2 mass s b = pull.
                a, b = mpc(0), pull / (2 * oscillator.mass * s)
            self.terms.append((s, a, b))
            x_rest -= a.real
            v_rest -= (a * s + b).real
        if one == two:
            raise ValueError("critical damping is no scene of these")
        first = (v_rest - two * x_rest) / (one - two)
        self.terms += [(one, first, mpc(0)), (two, x_rest - first, mpc(0))]
        self.double = [(complex(s), complex(a), complex(b)) for s, a, b in self.terms]

    def at(self, t, order):
        """The order-th derivative of the position."""
        total = mpf(0)
        for s, a, b in self.terms:
            e = mp.exp(s * t)
            value = (a + b * t) * s**order + (order * b * s ** (order - 1) if order else 0)
            total += (value * e).real
        return total

    def both_near(self, t):
        """Position and velocity in doubles."""
        x = v = 0.0
        for s, a, b in self.double:
            e = exp(s * t)
            value = (a + b * t) * e
            x += value.real
            v += (s * value + b * e).real
        return x, v

    def near(self, t, order):
        """As `at`, in doubles."""
        total = 0.0
        for s, a, b in self.double:
            value = (a + b * t) * s**order + (order * b * s ** (order - 1) if order else 0)
            total += (value * exp(s * t)).real
        return total


def newton(f, slope, t):
    """A simple root of f from close by: once a step is below the 22nd digit, the next is below the 40th."""
    for _ in range(100):
        step = f(t) / slope(t)
        t -= step
        if abs(step) <= abs(t) * mpf("1e-22"):
            return t - f(t) / slope(t)
    raise ArithmeticError("Newton's iteration does not settle")


def bisected(f, low, high, times):
    """The side of the change of sign of f in [low, high] after so many halvings: (low, high)."""
    sign = f(low) > 0
    for _ in range(times):
        middle = (low + high) / 2
        if (f(middle) > 0) == sign:
            low = middle
        else:
            high = middle
    return low, high
