"""Plants: oscillator, particle and walls, advanced from event to event in closed form."""

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._native import Plant as _Plant
from ._native import Plants as _Plants
from ._native import plant_table
from .datasets import dataset
from .numbers import real, reals
from .results import Result, axes
from .scenes import Scene

if TYPE_CHECKING:
    import xarray

_NEEDED, _OF_CAVITY, _LAWS = plant_table()
_PARAMETERS = tuple(name for name, _ in _NEEDED)
#: Parameters of a real cavity; what is left out is ideal.
_CAVITY = tuple(name for name, _ in _OF_CAVITY)
_START = ("q1", "dq1", "q2", "dq2")
_UNITS = {name: unit or "1" for name, unit in (*_NEEDED, *_OF_CAVITY)}
_STATE_UNITS = {
    "q1": "m", "dq1": "m/s", "q2": "m", "dq2": "m/s", "time": "s", "impacts": "1", "dissipated": "J",
    "sticks": "1", "stuck_time": "s", "friction_loss": "J",
}  # fmt: skip

#: Kinds of events, by their code.
KINDS = ("impact", "stuck", "released", "sticking", "slip", "reversal")


@dataclass(frozen=True, eq=False, repr=False)
class Events(Result):
    """Events of one or more plants, plant by plant, each in the order of time.

    Attributes
    ----------
    plant : ndarray of uint64, shape (n,)
        Number of the plant in its batch.
    time : ndarray of float64, shape (n,)
        Time since the plant's start, s.
    kind : ndarray of uint8, shape (n,)
        0: the particle hit a wall; 1: it came to rest on a wall; 2: the wall released it. With friction also 3: it
        stuck to the floor inside the cavity; 4: it slid again; 5: it turned round without sticking.
    wall : ndarray of int8, shape (n,)
        1 at w = q1 - q2 = b (or b_plus), -1 at w = -b (or -b_minus), 0 inside the cavity.
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

    def __repr__(self) -> str:
        counts = np.bincount(self.kind, minlength=len(KINDS))
        texts = [f"{count} {kind}" for kind, count in zip(KINDS, counts, strict=True) if count]
        return f"<Events {len(self)}: {', '.join(texts)}>" if texts else "<Events 0>"

    def plot(self, ax: Any = None) -> Any:
        """Draw the relative velocity of the impacts over time with matplotlib, and return the axes."""
        ax, impacts = axes(ax), self.kind == 0
        ax.plot(self.time[impacts], self.velocity[impacts], ".")
        ax.set(xlabel="time, s", ylabel="relative velocity before an impact, m/s")
        return ax

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
        Those of a real cavity likewise: see `Plant`.
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
        columns = _values(parameters, starts)
        try:
            rows = np.stack(np.broadcast_arrays(*np.atleast_1d(*columns)), axis=-1)
        except ValueError:
            cavity = _CAVITY if len(columns) > len(_PARAMETERS) + len(_START) else ()
            names = zip((*_PARAMETERS, *cavity, *_START), columns, strict=True)
            shapes = ", ".join(f"{name} {value.shape}" for name, value in names if value.ndim)
            raise ValueError(f"arrays of different shapes: {shapes}; numbers and equal lengths are allowed") from None
        if rows.ndim != 2:
            raise ValueError(f"parameters and starts of shape {rows.shape[:-1]}: one-dimensional arrays are allowed")
        values, first = np.split(rows, [-len(_START)], axis=1)
        self._native = _Plants(np.ascontiguousarray(values), np.ascontiguousarray(first))

    def __len__(self) -> int:
        return len(self._native)

    @overload
    def advance(
        self, duration: ArrayLike, *, amplitude: ArrayLike = 0.0, omega: ArrayLike = 0.0, events: Literal[True] = True
    ) -> Events: ...

    @overload
    def advance(
        self, duration: ArrayLike, *, amplitude: ArrayLike = 0.0, omega: ArrayLike = 0.0, events: Literal[False]
    ) -> None: ...

    @overload
    def advance(
        self, duration: ArrayLike, *, amplitude: ArrayLike = 0.0, omega: ArrayLike = 0.0, events: bool
    ) -> Events | None: ...

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

        def array(name: str, given: ArrayLike, unit: str) -> NDArray[np.float64]:
            values = reals(name, given, unit)
            if values.shape not in ((), (1,), (len(self),)):
                raise ValueError(f"{name} of shape {values.shape}: a number or {len(self)} numbers are allowed")
            return np.ascontiguousarray(np.broadcast_to(values, (len(self),)))

        drive = array("duration", duration, "s"), array("amplitude", amplitude, "m"), array("omega", omega, "rad/s")
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
        self._native = _Plants.restore(saved)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} plants>"

    def __eq__(self, other: object) -> bool:
        return self._native.save() == other._native.save() if isinstance(other, Batch) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

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

    @property
    def sticks(self) -> NDArray[np.uint64]:
        """How often the particle has stuck to the floor inside the cavity since the start, shape (n,)."""
        return self._native.totals()[2]

    @property
    def stuck_time(self) -> NDArray[np.float64]:
        """How long it has stuck there, s, shape (n,)."""
        return self._native.totals()[3]

    @property
    def friction_loss(self) -> NDArray[np.float64]:
        """Energy lost to friction in the cavity since the start, J, shape (n,)."""
        return self._native.totals()[4]

    def to_xarray(self) -> "xarray.Dataset":
        """Return the present states as a dataset over the dimension `plant`, with units as attributes."""
        columns = [*self.states.T, self.times, *self._native.totals()]
        named = zip(_STATE_UNITS, columns, strict=True)
        return dataset({name: ("plant", values) for name, values in named}, _STATE_UNITS)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Result):
    """The motion of a plant at equal distances of time.

    Attributes
    ----------
    time : ndarray of float64, shape (n + 1,)
        Time since the plant's start, s.
    q1, q2, dq1, dq2 : ndarray of float64, shape (n + 1,)
        Displacements, m, and velocities, m/s.
    base : ndarray of float64, shape (n + 1,)
        Displacement of the base, m.
    events : Events
        All events.
    """

    time: NDArray[np.float64]
    q1: NDArray[np.float64]
    dq1: NDArray[np.float64]
    q2: NDArray[np.float64]
    dq2: NDArray[np.float64]
    base: NDArray[np.float64]
    events: Events

    def __len__(self) -> int:
        return len(self.time)

    def to_xarray(self) -> "xarray.Dataset":
        """Return a dataset over the dimension `time`, with units as attributes."""
        units = {"time": "s", "q1": "m", "dq1": "m/s", "q2": "m", "dq2": "m/s", "base": "m"}
        return dataset({name: ("time", getattr(self, name)) for name in units}, units)

    def plot(self, ax: Any = None) -> Any:
        """Draw the displacements over time with matplotlib, into `ax` or new axes, and return these."""
        ax = axes(ax)
        for name in ("q1", "q2"):
            ax.plot(self.time, getattr(self, name), label=name)
        ax.set(xlabel="time, s", ylabel="displacement, m")
        ax.legend()
        return ax


class Plant(_Plant):
    """One plant.

    A step of a sample loop takes about a microsecond. All that the plant shows is read at once:

    - `q1`, `q2` (m), `dq1`, `dq2` (m/s): displacements and velocities of the primary mass and of the particle;
    - `v` = q1 + epsilon q2 (m), `w` = q1 - q2 (m) and its velocity `dw` (m/s);
    - `base` (m) and `phase` (rad): displacement of the base, and phase of its oscillator;
    - `time` (s), `impacts`, `dissipated` (J): since the start; `wall`: 1 or -1 if the particle is stuck to the wall at
      w = b or -b, otherwise 0;
    - with friction `sticking`, whether the particle sticks to the floor inside the cavity, and since the start
      `sticks`, `stuck_time` (s) and `friction_loss` (J).

    Parameters
    ----------
    parameters : Scene or mapping of str to float, optional
        M (kg), k (N/m), c (N s/m), m (kg), b (m) and r; default: the default scene. A real cavity has gaps, tilt,
        friction and a law of restitution, under the names of the keys in `[plant]` of a scene, which the page
        "Parameters of the plant" lists.
    **start : float
        q1, q2 (m), dq1, dq2 (m/s).

    Raises
    ------
    ValueError
        A value that is not allowed, with its unit and range.

    Examples
    --------
    >>> plant = Plant(Scene(), dq2=0.5)
    >>> for _ in range(1000):
    ...     events = plant.advance(0.001, amplitude=9.2e-5, omega=54.9)
    ...     response = plant.v
    >>> plant.impacts > 5
    True
    >>> sorted(plant.state)
    ['dq1', 'dq2', 'q1', 'q2']
    """

    __slots__ = ()

    def __new__(cls, parameters: Scene | Mapping[str, float] | None = None, **start: float) -> Self:
        values = _values(Scene() if parameters is None else parameters, start)
        sizes = [np.size(value) for value in values if np.ndim(value)]
        if sizes and np.broadcast_shapes(*(np.shape(value) for value in values)) != (1,):
            raise ValueError(
                f"values for {max(sizes) if min(sizes) else 0} plants: one is allowed here; Batch has more"
            )
        numbers = [float(value.item()) for value in values]
        given, first = numbers[: -len(_START)], numbers[-len(_START) :]
        ideal = [math.nan] * (len(_PARAMETERS) + len(_CAVITY) - len(given))
        return super().__new__(cls, given + ideal, first)

    def __repr__(self) -> str:
        state = ", ".join(f"{name} = {value:.6g}" for name, value in self.state.items())
        return f"<Plant at {self.time:.6g} s: {state}>"

    def __eq__(self, other: object) -> bool:
        return self._save() == other._save() if isinstance(other, Plant) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def advance(self, duration: float, *, amplitude: float = 0.0, omega: float = 0.0) -> Events:
        """Advance the plant; the base moves as e = E sin(phase + omega t), and its phase continues from call to call.

        Parameters
        ----------
        duration : float
            Duration, s.
        amplitude : float
            Amplitude E of the base displacement, m.
        omega : float
            Angular frequency, rad/s.

        Returns
        -------
        Events
            The events.

        Raises
        ------
        ValueError
            A value that is not allowed. The plant is not advanced then.
        """
        found = self._advance(duration, amplitude, omega)
        return _NO_EVENTS if found is None else Events(*found)

    def trajectory(self, duration: float, steps: int, *, amplitude: float = 0.0, omega: float = 0.0) -> Trajectory:
        """Advance the plant in equal steps, and return its motion: bit-identical to one call of `advance` per step.

        Parameters
        ----------
        duration : float
            Duration of all steps, s.
        steps : int
            Number of steps, 1 to 10^9.
        amplitude, omega : float
            As of `advance`.

        Returns
        -------
        Trajectory
            The motion at the start and after every step, and all events.

        Raises
        ------
        ValueError
            A value that is not allowed. The plant is not advanced then.

        Examples
        --------
        >>> motion = Plant(Scene(), dq2=0.5).trajectory(1.0, 500, amplitude=9.2e-5, omega=54.9)
        >>> motion
        <Trajectory time = 501 values, q1 = 501 values, ..., events = <Events 6: 6 impact>>
        """
        if not 1 <= operator.index(steps) <= 10**9:
            raise ValueError(f"steps = {steps}: a whole number from 1 to 10^9 is allowed")
        rows, found = self._trajectory(duration, steps, amplitude, omega)
        time, q1, dq1, q2, dq2, base = np.ascontiguousarray(rows.T)
        return Trajectory(time, q1, dq1, q2, dq2, base, Events(*found))

    def copy(self) -> Self:
        """Return a copy that continues with the same bits."""
        other = type(self)(_ANY)
        other._restore(self._save())
        return other

    def __getstate__(self) -> bytes:
        return self._save()

    def __setstate__(self, saved: bytes) -> None:
        self._restore(saved)

    @property
    def state(self) -> dict[str, float]:
        """q1, q2 (m), dq1 and dq2 (m/s). What is assigned to it may be a part; base, time and totals stay."""
        return {"q1": self.q1, "dq1": self.dq1, "q2": self.q2, "dq2": self.dq2}

    @state.setter
    def state(self, values: Mapping[str, float]) -> None:
        merged = self.state | dict(values)
        _check("state", merged, _START)
        self._set_state([real(merged[name], _STATE_UNITS[name], name) for name in _START])

    def to_xarray(self) -> "xarray.Dataset":
        """Return the present state as a dataset without dimensions, with units as attributes."""
        values = {name: getattr(self, name) for name in _STATE_UNITS}
        return dataset({name: ((), value) for name, value in values.items()}, _STATE_UNITS)


#: What a step without events returns.
_NO_EVENTS = Events(
    plant=np.empty(0, np.uint64),
    time=np.empty(0),
    kind=np.empty(0, np.uint8),
    wall=np.empty(0, np.int8),
    velocity=np.empty(0),
)
#: Parameters of a plant that is about to become another one.
_ANY = dict.fromkeys(_PARAMETERS, 1.0)


def _values(
    parameters: Scene | Mapping[str, ArrayLike], starts: Mapping[str, ArrayLike] | None
) -> list[NDArray[np.float64]]:
    """Return parameters and starts, checked: `_PARAMETERS`, `_CAVITY` unless the cavity is ideal, and `_START`."""
    first: dict[str, ArrayLike] = dict.fromkeys(_START, 0.0)
    values: Mapping[str, ArrayLike] = {}
    if isinstance(parameters, Scene):
        settings = parameters.settings
        if "structure" in settings:
            raise ValueError(
                "a Plant has one oscillator, and the scene has a [structure] or a [shaker]: take StructurePlant(scene)"
            )
        values, first = settings["plant"], settings["start"]
    else:
        values = parameters
    given = dict(first) | dict(starts or {})
    _check("parameters", values, _PARAMETERS, _CAVITY)
    _check("starts", given, _START)
    if values.get("r_law") in _LAWS[1:] and "r_plus" not in values:
        raise ValueError(f"parameters: r_law = {values['r_law']!r} without r_plus, which is its parameter k or v_y")
    columns = [reals(name, values[name], _UNITS[name]) for name in _PARAMETERS]
    # Most batches have an ideal cavity: without its columns they need less memory.
    if any(name in values for name in _CAVITY):
        columns += [_of_cavity(name, values[name]) if name in values else np.array(np.nan) for name in _CAVITY]
    return columns + [reals(name, given[name], _STATE_UNITS[name]) for name in _START]


def _of_cavity(name: str, given: Any) -> NDArray[np.float64]:
    """Return values of a parameter of the cavity; the law of restitution as its code."""
    if name == "r_law":
        if given not in _LAWS:
            raise ValueError(f"r_law = {given!r}: {', '.join(_LAWS)} are allowed")
        given = _LAWS.index(given)
    values = reals(name, given, _UNITS[name])
    if np.isnan(values).any():
        raise ValueError(f"{name} = nan: a number is allowed")
    return values


def _check(what: str, given: Mapping[str, Any], names: tuple[str, ...], optional: tuple[str, ...] = ()) -> None:
    for name in given:
        if name not in (*names, *optional):
            raise ValueError(f"{what}: unknown {name!r}; known are {', '.join((*names, *optional))}")
    for name in names:
        if name not in given:
            raise ValueError(f"{what}: {name} ({_UNITS.get(name, 'm or m/s')}) is missing")
