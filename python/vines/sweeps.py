"""Sweeps over any numbers of a scene and of its start."""

import errno
import operator
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from numpy.typing import NDArray

from . import _native
from .datasets import opened
from .numbers import real, reals, scalar
from .scenes import Scene, checked

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Range:
    """Values of an axis at equal distances, as `linspace` makes them."""

    first: float
    last: float
    number: int


def linspace(first: float, last: float, number: int) -> Range:
    """Return the values of an axis at equal distances; the store keeps first, last and number instead of all values.

    Parameters
    ----------
    first, last : float
        First and last value; the first is below the last.
    number : int
        Number of values, at least 2.

    Returns
    -------
    Range

    Raises
    ------
    ValueError
        A number of values that is not allowed.

    Examples
    --------
    >>> linspace(0.3, 0.9, 7)
    Range(first=0.3, last=0.9, number=7)
    """
    count = scalar(number)
    if isinstance(count, bool) or not hasattr(count, "__index__") or count < 2:
        raise ValueError(f"number of values = {number!r}: a whole number of at least 2 is allowed")
    return Range(real(first), real(last), operator.index(count))


#: Values of an axis: a `linspace`, a list or an array, or ("random", first, last).
Values: TypeAlias = "Range | Sequence[float] | NDArray[Any] | tuple[str, float, float]"

#: Names of the regimes, by their code in a store.
REGIMES: tuple[str, ...] = tuple(_native.regimes())


def sweep(
    scene: Scene | None,
    axes: Mapping[str, Values] | None = None,
    *,
    out: str | PathLike[str],
    paired: Mapping[str, Sequence[float] | NDArray[Any]] | None = None,
    sigma: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    periods: int = 20_000,
    results: Iterable[str] = (),
    chunk: int = 4096,
    adaptive: int | None = None,
    confirm: bool = False,
    progress: bool = False,
    client: Any = None,
) -> "xarray.Dataset":
    """Compute one plant per cell, write the results to a Zarr store as they are computed, and open it.

    An interrupted store is continued, and damaged chunks are computed again, with a RuntimeWarning that names them.
    The store has the same bytes as that of `vines sweep`; docs/scale.md describes it.

    Parameters
    ----------
    scene : Scene or None
        None: the default scene.
    axes : mapping of str to values, optional
        By name, `"sigma"` or `"section.key"` of a scene: a list or an array, `linspace(first, last, number)`, or a
        tuple ("random", first, last).
    out : path-like
        Folder of the store.
    paired : mapping of str to sequence of float, optional
        Samples of your own: by the same names, one value per sample each, all of the same length. They share the
        dimension `sample`.
    sigma : float, optional
        Detuning, if it is not an axis. Without it: that of the scene's stable phase-resonant orbit, or 0.
    samples : int, optional
        Number of samples of random axes, which share the dimension `sample`.
    seed : int
        Seed of random axes.
    periods : int
        Largest number of periods that a cell is followed.
    results : iterable of str
        Further results: `"response"`, `"orbits"`, `"lock"`.
    chunk : int
        Largest number of cells in a chunk.
    adaptive : int, optional
        Only the regime: compute every n-th cell of two grids (16 is usual), then where neighbours differ,
        and infer the rest; `inferred` marks it. Not with `client`.
    confirm : bool
        Confirms a sweep of more than 2 hours or 20 GB.
    progress : bool
        Whether tqdm shows a bar.
    client : dask.distributed.Client, str or callable, optional
        Its workers compute the chunks and write them to the store, whose folder they must all see. Another
        scheduler of Dask is named as for `dask.compute`: `"processes"`, or its `get`.

    Returns
    -------
    xarray.Dataset
        The store, opened lazily, with units as attributes. `regime` is a code, an index into `vines.REGIMES`; 255 is
        a cell without one. Mappings among its attributes are JSON texts, so that it can be written as netCDF.

    Raises
    ------
    ValueError
        An unknown axis, a value that is not allowed, a large sweep that is not confirmed, or a store of
        another sweep, which stays as it is.
    OSError
        The store cannot be written. Complete chunks stay.
    KeyboardInterrupt
        Ctrl-C. Complete chunks stay, and the same call continues.

    Examples
    --------
    >>> axes = {"sigma": linspace(-2, 0, 5), "plant.r": [0.5, 0.65]}
    >>> cells = sweep(None, axes, out=folder / "r.zarr", periods=400)
    >>> dict(cells.sizes), cells.settling.attrs["units"]
    ({'sigma': 5, 'plant.r': 2}, '1')
    """
    scene = checked(scene)
    settings = {
        "sigma": None if sigma is None else real(sigma),
        "samples": samples,
        "seed": seed,
        "periods": periods,
        "results": [results] if isinstance(results, str) else list(results),
        "chunk": chunk,
        "adaptive": adaptive,
    }
    if adaptive is not None and client is not None:
        raise ValueError("an adaptive sweep runs in one process: leave out adaptive or client")
    given: dict[str, Any] = {name: _values(name, values) for name, values in (axes or {}).items()}
    for name, values in (paired or {}).items():
        if name in given:
            raise ValueError(f"{name} is in axes and in paired: give one of them")
        given[name] = (_list(name, values),)
    # Workers may have another working directory.
    folder = str(Path(out).absolute())
    plan = _native.Sweep(scene._native, given, settings)
    cells = plan.cells
    hours, size, large = plan.estimate()
    if large and not confirm:
        raise ValueError(
            f"{cells} cells would take about {hours:.1f} h on this machine and {size / 1e9:.1f} GB before compression; "
            "confirm with confirm=True"
        )
    with _bar(cells, progress) as bar:
        if client is not None:
            # A part without chunks: it makes the store, so that workers can tell whether they see it.
            plan.run(folder, (plan.chunks, plan.chunks + 1), None)
            _distributed(client, (scene, given, settings, folder), plan.chunks, cells, bar)
        look = None if bar is None or client is not None else lambda complete: bar.update(complete - bar.n)
        # After workers nothing is left to compute; this removes what a killed one has left.
        plan.run(folder, (0, 1), look)
    return opened(out)


def _values(name: str, values: Any) -> Any:
    if isinstance(values, Range):
        return (values.first, values.last, values.number)
    if isinstance(values, tuple):
        if len(values) == 3 and isinstance(values[0], str):
            return (values[0], real(values[1]), real(values[2]))
        raise ValueError(
            f"{name} = {values!r}: a tuple could be a range or values; a range is "
            "vines.linspace(first, last, number), values are a list"
        )
    return _list(name, values)


def _list(name: str, values: Any) -> list[float]:
    try:
        numbers = reals(name, values)
    except ValueError as error:
        raise ValueError(f"{error}: {_ALLOWED}") from None
    if numbers.ndim != 1:
        raise ValueError(f"{name} = {values!r}: {_ALLOWED}")
    listed: list[float] = numbers.tolist()
    return listed


_ALLOWED = "a list of numbers, linspace(first, last, number) or (sequence, first, last) is allowed"


def _bar(cells: int, progress: bool) -> Any:
    if not progress:
        return nullcontext()
    from tqdm.auto import tqdm  # type: ignore[import-untyped]

    return tqdm(total=cells, unit="cell")


def _chunk(part: int, chunks: int, scene: Scene, axes: Any, settings: Any, out: str) -> int:
    """Compute one chunk in a worker; only the number of its cells returns."""
    if not Path(out, "zarr.json").is_file():
        raise FileNotFoundError(
            errno.ENOENT, f"{out}: this worker does not see the store; name a folder that client and all workers see"
        )
    return _native.Sweep(scene._native, axes, settings).run(out, (part, chunks), None)[0]


def _distributed(client: Any, arguments: Any, chunks: int, cells: int, bar: Any) -> None:
    if not hasattr(client, "submit"):
        from dask.base import compute
        from dask.delayed import delayed

        tasks = [delayed(_chunk)(part, chunks, *arguments) for part in range(chunks)]
        compute(*tasks, scheduler=client)  # type: ignore[no-untyped-call]
        return

    from dask.distributed import as_completed

    # The scheduler holds a few tasks per thread at a time, however many chunks there are.
    waiting = iter(range(chunks))

    def submit() -> Any:
        part = next(waiting, None)
        return None if part is None else client.submit(_chunk, part, chunks, *arguments, pure=False)

    running: Any = as_completed([submit()])  # type: ignore[no-untyped-call]

    def fill() -> None:
        # Workers may come and go, and the first ones after this began.
        at_once = 4 * max(1, sum(client.nthreads().values()))
        while running.count() < at_once:
            further = submit()
            if further is None:
                return
            running.add(further)

    fill()
    for finished in running:
        finished.result()
        if bar is not None:
            bar.update(cells / chunks)
        fill()
