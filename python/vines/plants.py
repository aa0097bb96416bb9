"""Plants: oscillator, particle and walls, advanced from event to event in closed form."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .datasets import dataset
from .scenes import Scene

if TYPE_CHECKING:
    import xarray

_PARAMETERS = ("M", "k", "c", "m", "b", "r")
_START = ("q1", "dq1", "q2", "dq2")
_UNITS = {"M": "kg", "k": "N/m", "c": "N s/m", "m": "kg", "b": "m", "r": "1"}

#: Kinds of events, by their code.
KINDS = ("impact", "stuck", "released")


@dataclass(frozen=True)
class Events:
    """Events of one or more plants, plant by plant, each in the order of time.

    Attributes
    ----------
    plant : ndarray of uint64, shape (n,)
        Number of the plant in its batch.
    time : ndarray of float64, shape (n,)
        Time since the plant's start, s.
    kind : ndarray of uint8, shape (n,)
        0: the particle hit a wall; 1: it came to rest on a wall; 2: the wall released it.
    wall : ndarray of int8, shape (n,)
        1 at w = q1 - q2 = b, -1 at w = -b.
    velocity : ndarray of float64, shape (n,)
        Relative velocity w' just before an impact, m/s; NaN for other events.
    """

    plant: NDArray[np.uint64]
    time: NDArray[np.float64]
    kind: NDArray[np.uint8]
    wall: NDArray[np.int8]
    velocity: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.time)

    def to_xarray(self) -> "xarray.Dataset":
        """Return a dataset over the dimension `event`, with units as attributes."""
        units = {"time": "s", "velocity": "m/s", "plant": "1", "kind": "1", "wall": "1"}
        return dataset({name: ("event", getattr(self, name)) for name in units}, units)


class Batch:
    """Plants that advance independently of each other, on all cores.

    Parameters
    ----------
    parameters : mapping of str to array_like, or Scene
        M (kg), k (N/m), c (N s/m), m (kg), b (m) and r, each a number or an array; they are broadcast to shape (n,).
    starts : mapping of str to array_like, optional
        q1, q2 (m), dq1 and dq2 (m/s) likewise. What is left out is zero, or that of the scene.

    Raises
    ------
    ValueError
        A value that is not allowed, with the number of the plant, its unit and range.

    Examples
    --------
    >>> batch = Batch(Scene(), {"dq2": [0.4, 0.5, 0.6]})
    >>> events = batch.advance(1.0, amplitude=9.2e-5, omega=54.9)
    >>> batch.states.shape, len(events) >= 20
    ((3, 4), True)
    """

    def __init__(
        self, parameters: Scene | Mapping[str, ArrayLike], starts: Mapping[str, ArrayLike] | None = None
    ) -> None:
        first: dict[str, ArrayLike] = dict.fromkeys(_START, 0.0)
        values: Mapping[str, ArrayLike]
        if isinstance(parameters, Scene):
            settings = parameters.settings
            values, first = settings["plant"], settings["start"]
        else:
            values = parameters
        given = dict(first) | dict(starts or {})
        _check("parameters", values, _PARAMETERS)
        _check("starts", given, _START)
        given = {**values, **given}
        columns = [_numbers(name, given[name]) for name in (*_PARAMETERS, *_START)]
        try:
            rows = np.stack(np.broadcast_arrays(*np.atleast_1d(*columns)), axis=-1)
        except ValueError:
            shapes = ", ".join(f"{name} {np.shape(value)}" for name, value in given.items() if np.ndim(value))
            raise ValueError(f"arrays of different shapes: {shapes}; numbers and equal lengths are allowed") from None
        if rows.ndim != 2:
            raise ValueError(f"parameters and starts of shape {rows.shape[:-1]}: one-dimensional arrays are allowed")
        self._native = _native.Plants(np.ascontiguousarray(rows[:, :6]), np.ascontiguousarray(rows[:, 6:]))

    def __len__(self) -> int:
        return len(self._native)

    def advance(
        self, duration: ArrayLike, *, amplitude: ArrayLike = 0.0, omega: ArrayLike = 0.0, events: bool = True
    ) -> Events | None:
        """Advance all plants; the base moves as e = E sin(phase + omega t), and its phase continues from call to call.

        Parameters
        ----------
        duration : array_like, shape () or (n,)
            Duration, s.
        amplitude : array_like, shape () or (n,)
            Amplitude E of the base displacement, m.
        omega : array_like, shape () or (n,)
            Angular frequency, rad/s.
        events : bool
            Whether the events are kept.

        Returns
        -------
        Events or None
            The events, if they are kept.

        Raises
        ------
        ValueError
            A value that is not allowed. No plant is advanced then.
        """

        def array(name: str, given: ArrayLike) -> NDArray[np.float64]:
            values = _numbers(name, given)
            if values.shape not in ((), (1,), (len(self),)):
                raise ValueError(f"{name} of shape {values.shape}: a number or {len(self)} numbers are allowed")
            return np.ascontiguousarray(np.broadcast_to(values, (len(self),)))

        drive = array("duration", duration), array("amplitude", amplitude), array("omega", omega)
        found = self._native.advance(*drive, events)
        return None if found is None else Events(*found)

    def copy(self) -> "Batch":
        """Return a copy that continues with the same bits."""
        other = type(self).__new__(type(self))
        other._native = self._native.copy()
        return other

    def __getstate__(self) -> bytes:
        return self._native.save()

    def __setstate__(self, saved: bytes) -> None:
        self._native = _native.Plants.restore(saved)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} plants>"

    @property
    def states(self) -> NDArray[np.float64]:
        """q1 (m), q1' (m/s), q2 (m) and q2' (m/s), shape (n, 4)."""
        return self._native.states()

    @property
    def times(self) -> NDArray[np.float64]:
        """Time since the start, s, shape (n,)."""
        return self._native.times()

    @property
    def walls(self) -> NDArray[np.int8]:
        """Wall that the particle is stuck to: 1 at w = b, -1 at w = -b, 0 if it is free; shape (n,)."""
        return self._native.walls()

    @property
    def impacts(self) -> NDArray[np.uint64]:
        """Impacts since the start, shape (n,)."""
        return self._native.totals()[0]

    @property
    def dissipated(self) -> NDArray[np.float64]:
        """Energy dissipated by impacts since the start, J, shape (n,)."""
        return self._native.totals()[1]

    def to_xarray(self) -> "xarray.Dataset":
        """Return the present states as a dataset over the dimension `plant`, with units as attributes."""
        units = {"q1": "m", "dq1": "m/s", "q2": "m", "dq2": "m/s", "time": "s", "impacts": "1", "dissipated": "J"}
        columns = [*self.states.T, self.times, *self._native.totals()]
        return dataset({name: ("plant", values) for name, values in zip(units, columns, strict=True)}, units)


class Plant(Batch):
    """One plant.

    Parameters
    ----------
    parameters : Scene or mapping of str to float, optional
        M (kg), k (N/m), c (N s/m), m (kg), b (m) and r; default: the default scene.
    **start : float
        q1, q2 (m), dq1, dq2 (m/s).

    Raises
    ------
    ValueError
        A value that is not allowed, with its unit and range.

    Examples
    --------
    >>> plant = Plant(Scene(), dq2=0.5)
    >>> events = plant.advance(2.0, amplitude=9.2e-5, omega=54.9)
    >>> plant.impacts == int(sum(events.kind == 0))
    True
    >>> sorted(plant.state)
    ['dq1', 'dq2', 'q1', 'q2']
    """

    def __init__(self, parameters: Scene | Mapping[str, float] | None = None, **start: float) -> None:
        super().__init__(Scene() if parameters is None else parameters, start)
        if len(self) != 1:
            raise ValueError(f"values for {len(self)} plants: one is allowed here; Batch has more")

    def __repr__(self) -> str:
        state = ", ".join(f"{name} = {value:.6g}" for name, value in self.state.items())
        return f"<Plant at {self.time:.6g} s: {state}>"

    def advance(  # type: ignore[override]
        self, duration: float, *, amplitude: float = 0.0, omega: float = 0.0
    ) -> Events:
        """Advance the plant; see `Batch.advance`."""
        events = super().advance(duration, amplitude=amplitude, omega=omega)
        assert events is not None
        return events

    @property
    def state(self) -> dict[str, float]:
        """q1, q2 (m), dq1 and dq2 (m/s)."""
        return dict(zip(_START, self.states[0].tolist(), strict=True))

    @property
    def impacts(self) -> int:  # type: ignore[override]
        """Impacts since the start."""
        return int(super().impacts[0])

    @property
    def dissipated(self) -> float:  # type: ignore[override]
        """Energy dissipated by impacts since the start, J."""
        return float(super().dissipated[0])

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return float(self.times[0])

    @property
    def wall(self) -> int:
        """Wall that the particle is stuck to: 1 at w = b, -1 at w = -b, 0 if it is free."""
        return int(self.walls[0])


def _numbers(name: str, given: ArrayLike) -> NDArray[np.float64]:
    values = np.asarray(given)
    if values.dtype.kind not in "fiu":
        raise ValueError(f"{name} of type {values.dtype}: real numbers are allowed")
    return values.astype(np.float64, copy=False)


def _check(what: str, given: Mapping[str, Any], names: tuple[str, ...]) -> None:
    for name in given:
        if name not in names:
            raise ValueError(f"{what}: unknown {name!r}; known are {', '.join(names)}")
    for name in names:
        if name not in given:
            raise ValueError(f"{what}: {name} ({_UNITS.get(name, 'm or m/s')}) is missing")
