"""Scenes: plant, excitation, controller, measurement chain and durations."""

import json
from collections.abc import Mapping
from numbers import Integral
from os import PathLike
from pathlib import Path
from typing import Any

from . import _native
from .numbers import real, scalar, stated


class Scene:
    """A checked scene.

    Parameters
    ----------
    path : path-like, optional
        A scene file (TOML). Without it and without `text`: the default scene.
    text : str, optional
        A scene as TOML text instead.
    **sections : mapping
        Values that replace those of the scene, by section: `plant={"r": 0.7}`. lab/scene/paper.toml has all
        sections and keys with their units.

    Raises
    ------
    ValueError
        A value that is not allowed, with its unit and range; an unknown section or key.
    OSError
        A file that cannot be read.

    Examples
    --------
    >>> Scene(plant={"r": 0.7}).settings["plant"]["r"]
    0.7
    >>> Scene(plant={"r": 1.7})
    Traceback (most recent call last):
        ...
    ValueError: [plant] or [start]: r (coefficient of restitution) = 1.7 is refused; allowed is a number above 0 and ...
    """

    def __init__(
        self, path: str | PathLike[str] | None = None, *, text: str | None = None, **sections: Mapping[str, Any]
    ) -> None:
        if path is not None and text is not None:
            raise ValueError("path and text are both given: give one of them")
        origin = "text"
        if path is not None:
            origin, text = str(path), _native.utf8(str(path), Path(path).read_bytes())
        self._arguments = (text, origin, [*_overrides(sections)])
        self._native = _native.Scene(*self._arguments)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, self._arguments

    def __eq__(self, other: object) -> bool:
        return self.settings == other.settings if isinstance(other, Scene) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        numbers = ", ".join(f"{key} = {value:.6g}" for key, value in self.dimensionless.items())
        return f"<Scene {numbers}>"

    @property
    def settings(self) -> dict[str, Any]:
        """All settings, by section: plant, start and amplitude in SI units, the others in those of the scene file."""
        return dict(json.loads(self._native.settings()))

    @property
    def dimensionless(self) -> dict[str, float]:
        """epsilon, lambda, r and G, with the units of frequency omega0 (rad/s) and of length b (m).

        Examples
        --------
        >>> round(Scene().dimensionless["epsilon"], 6)
        0.008406
        """
        numbers = json.loads(self._native.dimensionless())
        return {key: value for key, value in numbers.items() if isinstance(value, float)}

    def drive(self, sigma: float = 0.0, G: float | None = None) -> dict[str, float]:
        """Return the drive in SI units: what `Plant.advance` and `Batch.advance` take.

        Parameters
        ----------
        sigma : float
            Detuning: omega = omega0 (1 + epsilon sigma).
        G : float, optional
            Dimensionless amplitude: E = epsilon G b. Without it: that of the scene.

        Returns
        -------
        dict of str to float
            amplitude E (m) and omega (rad/s).

        Raises
        ------
        ValueError
            A detuning that is so low that the frequency is not above 0.

        Examples
        --------
        >>> plant = Plant(Scene())
        >>> events = plant.advance(1.0, **Scene().drive(sigma=-1.1, G=1.2))
        """
        n, sigma = self.dimensionless, real(sigma, name="sigma")
        omega = n["omega0"] * (1.0 + n["epsilon"] * sigma)
        if not omega > 0.0:
            raise ValueError(
                f"sigma = {sigma} (dimensionless): a number above {-1.0 / n['epsilon']:.6g} is allowed, "
                "so that the frequency is above 0"
            )
        return {"amplitude": n["epsilon"] * (n["G"] if G is None else real(G, name="G")) * n["b"], "omega": omega}

    def detuning(self, omega: float, amplitude: float | None = None) -> dict[str, float]:
        """Return sigma and, with an amplitude, G: the inverse of `drive`.

        Parameters
        ----------
        omega : float
            Angular frequency, rad/s.
        amplitude : float, optional
            Amplitude E of the base displacement, m.

        Returns
        -------
        dict of str to float
            sigma and G.

        Examples
        --------
        >>> found = Scene().detuning(**Scene().drive(sigma=-1.1, G=1.2))
        >>> round(found["sigma"], 9), round(found["G"], 9)
        (-1.1, 1.2)
        """
        n = self.dimensionless
        found = {"sigma": (real(omega, "rad/s", "omega") / n["omega0"] - 1.0) / n["epsilon"]}
        return (
            found if amplitude is None else found | {"G": real(amplitude, "m", "amplitude") / (n["epsilon"] * n["b"])}
        )


def checked(scene: Scene | None) -> Scene:
    """Return the scene; without one, the default scene."""
    if scene is None:
        return Scene()
    if not isinstance(scene, Scene):
        raise TypeError(f'scene = {scene!r}: a Scene is allowed, for instance Scene(plant={{"r": 0.7}})')
    return scene


def _overrides(sections: Mapping[str, Mapping[str, Any]]) -> list[str]:
    texts = []
    for section, keys in sections.items():
        if not isinstance(keys, Mapping):
            raise TypeError(f"{section} = {keys!r}: a section is a mapping, for instance plant={{'r': 0.7}}")
        texts += [f"{section}.{key} = {_toml(f'{section}.{key}', value)}" for key, value in keys.items()]
    return texts


def _toml(name: str, given: Any) -> str:
    if isinstance(given, Mapping):
        pairs = [f"{json.dumps(key)} = {_toml(f'{name}.{key}', value)}" for key, value in given.items()]
        return f"{{ {', '.join(pairs)} }}"
    if stated(given) is not None:
        return repr(real(given, _native.unit(name), name))
    try:
        value = scalar(given)
        if isinstance(value, (bool, int, str)):
            return json.dumps(value)
        return repr(int(value)) if isinstance(value, Integral) else repr(real(value))
    except (TypeError, ValueError) as error:
        why = f" ({error})" if "masked" in str(error) else ""
        raise ValueError(f"{name} = {given!r}: a number, a text or a Boolean is allowed{why}") from None


def _restored(text: str | None, origin: str, overrides: list[str]) -> Scene:
    scene = Scene.__new__(Scene)
    scene._arguments = (text, origin, overrides)
    scene._native = _native.Scene(text, origin, overrides)
    return scene
