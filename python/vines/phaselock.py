"""The phase-locked loop, sample by sample."""

from dataclasses import dataclass

from . import _native
from .scenes import Scene, checked

_STATES = ("idle", "ramping", "acquiring", "locked", "lock lost", "tripped", "shut down")


@dataclass(frozen=True, slots=True)
class Output:
    """Drive until the next sample, and estimates.

    Attributes
    ----------
    omega : float
        Drive frequency, rad/s.
    amplitude : float
        Drive amplitude E, m.
    drive : float
        Setpoint of the base displacement at this sample, m.
    phase_error : float or None
        Phase of the response relative to the reference, minus the target, rad.
    response_amplitude : float
        Amplitude of the first harmonic of the response, m.
    coherence : float
        Power of the response's first harmonic over its sum with the residual power, 0 to 1.
    locked, settled : bool
        The lock criterion has been met and the lock has not been lost since; the criterion is met now.
    state : str
        Loop state: idle, ramping, acquiring, locked, lock lost, tripped or shut down.
    fault : int
        Number of the fault, as the output `fault` of PhaseLock.fmu; 0 for none.
    """

    omega: float
    amplitude: float
    drive: float
    phase_error: float | None
    response_amplitude: float
    coherence: float
    locked: bool
    settled: bool
    state: str
    fault: int


class PhaseLock:
    """The controller with the configuration of a scene.

    Parameters
    ----------
    scene : Scene, optional
        Its sections controller, chain and resonance configure the controller; default: the default scene.

    Raises
    ------
    ValueError
        A setting that the controller cannot work with.

    Examples
    --------
    >>> plant, lock = Plant(Scene()), PhaseLock()
    >>> output = lock.sample(0.0, 0.0)
    >>> for _ in range(100_000):
    ...     events = plant.advance(lock.sample_time, amplitude=output.amplitude, omega=output.omega)
    ...     output = lock.sample(plant.v)
    >>> output.state
    'locked'
    """

    def __init__(self, scene: Scene | None = None) -> None:
        self._native = _native.PhaseLock(checked(scene)._native)

    @property
    def sample_time(self) -> float:
        """Time from sample to sample, s."""
        return self._native.sample_time

    def sample(self, response: float, reference: float | None = None, active: bool = True) -> Output:
        """Process one sample.

        Parameters
        ----------
        response : float
            Response of the structure, m.
        reference : float, optional
            Displacement of the base, m. Without it, the internal oscillator is the reference.
        active : bool
            Whether the drive is requested.

        Returns
        -------
        Output
            Drive until the next sample, and estimates.
        """
        found = self._native.sample(response, reference, active)
        return Output(*found[:8], _STATES[found[8]], found[9])

    def copy(self) -> "PhaseLock":
        """Return a copy that continues with the same bits."""
        other = PhaseLock.__new__(PhaseLock)
        other._native = self._native.copy()
        return other

    def __getstate__(self) -> bytes:
        return self._native.save()

    def __setstate__(self, saved: bytes) -> None:
        self._native = _native.PhaseLock.restore(saved)
