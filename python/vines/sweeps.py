"""Sweeps over any numbers of a scene and of its start."""

import hashlib
import itertools
import json
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from math import ceil
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _native
from .datasets import needed
from .numbers import real, reals
from .scenes import Scene, checked

if TYPE_CHECKING:
    import xarray

#: Values of an axis: a list or an array; ("sample", values) for axes that share a dimension; or a DataArray.
Values: TypeAlias = "Sequence[float] | NDArray[Any] | tuple[str, Sequence[float] | NDArray[Any]] | xarray.DataArray"

#: Names of the regimes, by their code in a dataset.
REGIMES: tuple[str, ...] = tuple(_native.regimes())
_CODES = {**dict(enumerate(REGIMES)), 254: "failed", 255: "not computed"}

#: Cells of a chunk: some seconds of work, and files of some ten kilobytes.
_CELLS = 10_000


@dataclass(frozen=True)
class _Cells:
    """The cells as a function of the values of the axes: arrays of one shape, as those of a ufunc."""

    scene: Scene
    keys: tuple[str, ...]
    sigma: float | None
    results: tuple[str, ...]
    periods: int

    def native(self) -> _native.Cells:
        return _native.Cells(self.scene._native, [*self.keys], self.sigma, [*self.results], self.periods)

    def dtype(self) -> np.dtype[Any]:
        """A record per cell: all results as numbers but the code of the regime, and why the cell failed."""
        numbers = [(name, "u1" if name == "regime" else "f8") for name, _, _ in self.native().variables]
        return np.dtype([*numbers, ("failure", "O")])

    def __call__(self, *values: NDArray[np.float64], look: Callable[[int], object] | None = None) -> NDArray[Any]:
        arrays = np.broadcast_arrays(*values)
        cells = np.empty(arrays[0].shape, self.dtype())
        rows = np.stack([array.ravel() for array in arrays], axis=-1)
        numbers, failures = self.native().compute(rows, look)
        table = numbers.reshape(cells.size, -1)
        for n, name in enumerate(cells.dtype.names[:-1]):
            cells[name] = table[:, n].reshape(cells.shape)
        cells["failure"] = np.array(failures, dtype=object).reshape(cells.shape)
        return cells


def sweep(
    scene: Scene | None,
    axes: Mapping[str, Values],
    *,
    results: Iterable[str] = (),
    sigma: float | None = None,
    periods: int = 20_000,
    store: str | PathLike[str] | None = None,
    chunks: Mapping[str, int] | None = None,
    progress: bool = False,
) -> "xarray.Dataset":
    """Compute one plant per cell, on all cores, and return the results as a dataset.

    With `chunks`, or a client of Dask, the dataset is lazy: Dask computes it where its values are needed. With `store`,
    the chunks are written to a Zarr store as they are computed, by the workers of the client or in this process. The
    same call continues an interrupted store: it reads all chunks, and computes those that are missing or damaged.

    Parameters
    ----------
    scene : Scene or None
        None: the default scene.
    axes : mapping of str to values
        By name, `"sigma"` or `"section.key"` of a scene: what xarray takes as a coordinate. A list or an array has a
        dimension of its own; `("sample", values)` shares a dimension with others of that name.
    results : iterable of str
        Further results: `"response"`, `"orbits"`, `"lock"`.
    sigma : float, optional
        Detuning, if it is not an axis. Without it: that of the scene's stable phase-resonant orbit, or 0.
    periods : int
        Largest number of periods that a cell is followed.
    store : path-like, optional
        Folder of the store. All workers must see it.
    chunks : mapping of str to int, optional
        Cells of a chunk along each dimension; others are not divided. Default: chunks of about 10,000 cells.
    progress : bool
        Whether tqdm shows a bar. A lazy dataset has those of Dask.

    Returns
    -------
    xarray.Dataset
        With units as attributes. `regime` is a code, an index into `vines.REGIMES`; 254 is a cell that failed, with
        the reason in `failure`. What does not exist is NaN. The attribute `vines` says in JSON what was computed.

    Raises
    ------
    ValueError
        An unknown axis, a value that is not allowed, or a store of another sweep, which stays as it is.
    OSError
        The store cannot be written. Complete chunks stay.
    KeyboardInterrupt
        Ctrl-C. Complete chunks stay, and the same call continues.

    Warns
    -----
    RuntimeWarning
        Chunks of the store were damaged, and have been computed again, or metadata of arrays were, and have been
        written again; their files are named.

    Examples
    --------
    >>> axes = {"sigma": np.linspace(-2, 0, 5), "plant.r": [0.5, 0.65]}
    >>> cells = sweep(None, axes, periods=400)
    >>> dict(cells.sizes), cells.settling.attrs["units"]
    ({'sigma': 5, 'plant.r': 2}, '1')
    """
    module = needed("xarray")
    scene = checked(scene)
    variables = {name: _axis(name, values, scene) for name, values in axes.items()}
    if not variables:
        raise ValueError('a sweep needs at least one axis, for instance {"plant.r": [0.5, 0.65]}')
    asked = (results,) if isinstance(results, str) else tuple(results)
    cells = _Cells(scene, tuple(variables), None if sigma is None else real(sigma, name="sigma"), asked, periods)
    attributes = {"title": "Sweep of a linear oscillator with a vibro-impact nonlinear energy sink"}
    attributes["vines"] = json.dumps(_identity(cells, variables))
    sizes: dict[str, int] = {}
    for name, one in variables.items():
        for dimension, size in one.sizes.items():
            if sizes.setdefault(str(dimension), size) != size:
                shared = sizes[str(dimension)]
                raise ValueError(f"{name} has {size} values along {dimension}, and another axis {shared}")
    if (client := _client()) is not None or chunks is not None or store is not None:
        chunks = _lengths(sizes, chunks)
    if store is not None:
        plan = _Store(str(Path(store).absolute()), cells, variables, sizes, chunks or {})
        plan.run(attributes, client, progress)
        stored: xarray.Dataset = module.open_zarr(plan.folder, consolidated=False)
        return stored[list(cells.dtype().names or ())]
    arrays = [module.DataArray(one if chunks is None else one.chunk(chunks)) for one in variables.values()]
    with _bar(int(np.prod([*sizes.values()])), progress and chunks is None) as bar:
        look = None if bar is None else lambda complete: bar.update(complete - bar.n)
        records = module.apply_ufunc(
            cells, *arrays, kwargs={"look": look}, dask="parallelized", output_dtypes=[cells.dtype()]
        ).transpose(*sizes)
    data = {name: (records.dims, _part(records.data, name), about) for name, about in _about(cells)}
    found: xarray.Dataset = module.Dataset(data, variables, attributes)
    return found


def _axis(name: str, values: Any, scene: Scene) -> "xarray.Variable":
    """Return the values of an axis as a variable of xarray, checked."""
    dimensions: Any = (name,)
    if isinstance(values, tuple):
        if len(values) != 2 or not isinstance(values[0], str):
            raise ValueError(
                f"{name} = {values!r}: a list of numbers, an array or a tuple (dimension, values) is allowed; "
                "numpy.linspace(first, last, number) makes a range"
            )
        dimensions, values = (values[0],), values[1]
    dimensions = getattr(values, "dims", dimensions)
    try:
        numbers = reals(name, values, _native.unit(name, scene._native))
    except ValueError as error:
        raise ValueError(f"{error}: a list of numbers is allowed") from None
    if numbers.ndim != len(dimensions) or numbers.size == 0:
        raise ValueError(f"{name} = {values!r}: a list of numbers is allowed, with at least one")
    if not np.isfinite(numbers).all():
        raise ValueError(f"{name} = {numbers[~np.isfinite(numbers)][0]}: finite numbers are allowed")
    found: xarray.Variable = needed("xarray").Variable(
        dimensions, numbers, {"long_name": name, "units": _native.unit(name, scene._native)}
    )
    return found


def _identity(cells: _Cells, variables: "Mapping[str, xarray.Variable]") -> dict[str, Any]:
    """Return what determines the cells; of the axes, their dimensions and the SHA-256 of their values."""
    axes = {
        name: {"dimensions": one.dims, "sha256": hashlib.sha256(one.values.astype("<f8").tobytes()).hexdigest()}
        for name, one in variables.items()
    }
    return {
        "version": _native.version,
        "scene": cells.scene.settings,
        "sigma": cells.native().sigma,
        "axes": axes,
        "periods": cells.periods,
        "results": sorted({"regime", *cells.results}),
    }


def _about(cells: _Cells) -> Iterator[tuple[str, dict[str, Any]]]:
    """Return the variables with their attributes."""
    for name, unit, meaning in cells.native().variables:
        about: dict[str, Any] = {"long_name": meaning, "units": unit}
        if name == "regime":
            about["flag_values"] = [*_CODES]
            about["flag_meanings"] = " ".join(one.replace(" ", "_") for one in _CODES.values())
        yield name, about
    yield "failure", {"long_name": "why the cell failed; empty if it did not; `not computed` if there is no result yet"}


def _part(records: Any, name: str) -> Any:
    # A view of the records would keep all of them.
    return records[name].copy()


def _lengths(sizes: Mapping[str, int], chunks: Mapping[str, int] | None) -> dict[str, int]:
    """Return the cells of a chunk along each dimension."""
    if chunks is None:
        lengths, left = dict(sizes), _CELLS
        for dimension in reversed(lengths):
            lengths[dimension] = min(left, lengths[dimension])
            left = max(1, left // lengths[dimension])
        return lengths
    for dimension, length in chunks.items():
        if dimension not in sizes or length < 1:
            raise ValueError(
                f"chunks = {dict(chunks)!r}: a number of at least 1 is allowed for each of {', '.join(sizes)}"
            )
    return {dimension: min(size, chunks.get(dimension, size)) for dimension, size in sizes.items()}


def _client() -> Any:
    """Return the current client of Dask, if there is one."""
    if "distributed" not in sys.modules:
        return None
    from distributed import Client

    try:
        return Client.current()  # type: ignore[no-untyped-call]
    except ValueError:
        return None


def _bar(cells: int, progress: bool) -> Any:
    if not progress:
        return nullcontext()
    from tqdm.auto import tqdm  # type: ignore[import-untyped]

    return tqdm(total=cells, unit="cell")


@dataclass(frozen=True)
class _Store:
    """A Zarr store, and the sweep that it belongs to."""

    folder: str
    cells: _Cells
    variables: "Mapping[str, xarray.Variable]"
    sizes: Mapping[str, int]
    chunks: Mapping[str, int]

    def run(self, attributes: Mapping[str, str], client: Any, progress: bool) -> None:
        """Compute the chunks that are missing or damaged; workers of a client compute and write one each."""
        counts = [ceil(size / self.chunks[dimension]) for dimension, size in self.sizes.items()]
        indices = list(itertools.product(*map(range, counts)))
        damaged: list[str] = []
        try:
            self._open(attributes)
            self._metadata_restored()
            damaged += self._axes_restored()
            with _bar(len(indices), progress) as bar:
                tasks = ((self.folder, self.cells, index, self._values(index)) for index in indices)
                for found in _local(tasks) if client is None else _distributed(client, tasks):
                    damaged += found
                    if bar is not None:
                        bar.update()
        except OSError as error:
            error.add_note(f"cannot write to {self.folder}: complete chunks stay, and the same call continues")
            raise
        finally:
            if damaged:
                more = "; ..." if len(damaged) > 10 else ""
                warnings.warn(
                    f"{len(damaged)} damaged chunks were computed again: {'; '.join(damaged[:10])}{more}",
                    RuntimeWarning,
                    stacklevel=3,
                )

    def _values(self, index: tuple[int, ...]) -> list[NDArray[np.float64]]:
        """Return the values of the axes in a chunk, in the shape of its dimensions."""
        inside = {
            dimension: slice(n * self.chunks[dimension], (n + 1) * self.chunks[dimension])
            for n, dimension in zip(index, self.sizes, strict=True)
        }
        values = (one.isel(inside, missing_dims="ignore") for one in self.variables.values())
        return [one.set_dims([*self.sizes]).values for one in values]  # type: ignore[no-untyped-call]

    def _open(self, attributes: Mapping[str, str]) -> None:
        """Create the store, or see that it belongs to this sweep."""
        zarr, folder = needed("zarr"), Path(self.folder)
        if not folder.exists() or not any(folder.iterdir()):
            # Complete or absent: the name is given at the end.
            # After Ctrl-C, a thread of zarr may still write there: the interruption counts, not what is left.
            prefix = f"{folder.name}."
            with tempfile.TemporaryDirectory(dir=folder.parent, prefix=prefix, ignore_cleanup_errors=True) as partial:
                self._create(zarr.open_group(f"{partial}/store", mode="w", attributes=attributes))
                Path(partial, "store").rename(folder)
        try:
            found = json.loads(zarr.open_group(self.folder, mode="r").attrs["vines"])
        except (KeyError, ValueError, TypeError) as error:
            if not (folder / "regime").is_dir():
                raise ValueError(
                    f"{folder} is not the store of a sweep; it stays as it is. Name another folder"
                ) from None
            file = folder / "zarr.json"
            why = f"is damaged ({error})" if file.exists() else "is missing"
            raise ValueError(
                f"{file}, which says to which sweep the store belongs, {why}. The folder stays as it is. If it is the "
                "store of this sweep, start the same call with an empty folder, end it with Ctrl-C, and copy zarr.json "
                "from there: all chunks are kept. Otherwise name another folder"
            ) from None
        here = json.loads(attributes["vines"])
        # The chunks of an array whose zarr.json is damaged are those of the others.
        stored = (_document(folder / name / "zarr.json") for name in self.cells.dtype().names or ())
        if (known := next((one for one in stored if one is not None), None)) is not None:
            found["chunks"] = known.get("chunk_grid", {}).get("configuration", {}).get("chunk_shape")
            here["chunks"] = [*self.chunks.values()]
        differs = [f"`{key}`" for key, value in here.items() if found.get(key) != value]
        if differs:
            raise ValueError(
                f"{self.folder} belongs to another sweep, with another {', '.join(differs)}. It stays as it is; write "
                "to another folder, or delete it"
            )

    def _create(self, group: Any) -> None:
        """Create the arrays, with a checksum of every chunk."""
        codecs = needed("zarr.codecs")
        dtype = self.cells.dtype()
        kinds = {"u": ("uint8", 255), "f": ("float64", np.nan), "O": ("string", "not computed")}
        compressors = [codecs.ZstdCodec(level=3), codecs.Crc32cCodec()]
        for name, about in _about(self.cells):
            kind, absent = kinds[dtype[name].kind]
            group.create_array(
                name,
                shape=[*self.sizes.values()],
                chunks=[*self.chunks.values()],
                dtype=kind,
                fill_value=absent,
                compressors=compressors,
                dimension_names=[*self.sizes],
                attributes=about,
            )
        for name, one in self.variables.items():
            array = group.create_array(
                name,
                shape=one.shape,
                chunks=one.shape,
                dtype="float64",
                compressors=compressors,
                dimension_names=one.dims,
                attributes=one.attrs,
            )
            array[...] = one.values
        # By this attribute, xarray knows the axes that share a dimension.
        group.attrs["coordinates"] = " ".join(name for name, one in self.variables.items() if one.dims != (name,))

    def _metadata_restored(self) -> None:
        """Write the zarr.json of arrays again where it is missing or damaged: it follows from the sweep."""
        restored = []
        with tempfile.TemporaryDirectory() as partial:
            self._create(needed("zarr").open_group(partial, mode="w"))
            for name in [*(self.cells.dtype().names or ()), *self.variables]:
                fresh, file = Path(partial, name, "zarr.json"), Path(self.folder, name, "zarr.json")
                # Attributes are for readers.
                found, right = ((_document(one) or {}) | {"attributes": None} for one in (file, fresh))
                if found == right:
                    continue
                restored.append(f"{file} ({'damaged' if file.exists() else 'missing'})")
                file.parent.mkdir(exist_ok=True)
                written = file.with_name("zarr.json.partial")
                written.write_bytes(fresh.read_bytes())
                written.replace(file)
        if restored:
            warnings.warn(
                f"metadata of arrays were written again, and their chunks are kept: {'; '.join(restored)}",
                RuntimeWarning,
                stacklevel=4,
            )

    def _axes_restored(self) -> list[str]:
        group, damaged = needed("zarr").open_group(self.folder, mode="r+"), []
        for name, one in self.variables.items():
            state = _state(group[name], self.folder, (0,) * one.ndim)
            if state is not None:
                group[name][...] = one.values
                damaged += [state] if state else []
        return damaged


def _document(file: Path) -> dict[str, Any] | None:
    """Return the object in a file of JSON; None if it is missing or damaged."""
    try:
        found = json.loads(file.read_bytes())
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _state(array: Any, folder: str, index: tuple[int, ...]) -> str | None:
    """Return None if a chunk is there and undamaged, "" if it is missing, otherwise its file and the error."""
    file = Path(folder, array.path, array.metadata.encode_chunk_key(index))
    if not file.exists():
        return ""
    try:
        array.blocks[index]
    except OSError:
        raise
    except Exception as error:
        # A chunk of another length, or codecs that cannot decode it: what they raise depends on the damage.
        return f"{file} ({error})"
    return None


def _chunk(folder: str, cells: _Cells, index: tuple[int, ...], values: list[NDArray[np.float64]]) -> list[str]:
    """Compute and write a chunk, unless the store has it undamaged; return its damaged files."""
    if not Path(folder, "zarr.json").exists():
        raise FileNotFoundError(
            f"{folder}: this worker does not see the store; name a folder that client and all workers see"
        )
    group = needed("zarr").open_group(folder, mode="r+")
    names = cells.dtype().names or ()
    # A chunk that contains only fill values is written, too: it is complete.
    arrays = {name: group[name].with_config({"write_empty_chunks": True}) for name in names}
    states = [_state(array, folder, index) for array in arrays.values()]
    if any(state is not None for state in states):
        records = cells(*values)
        for name, array in arrays.items():
            array.blocks[index] = records[name]
    return [state for state in states if state]


def _local(tasks: Iterable[tuple[Any, ...]]) -> Iterator[list[str]]:
    return (_chunk(*task) for task in tasks)


def _distributed(client: Any, tasks: Iterable[tuple[Any, ...]]) -> Iterator[list[str]]:
    from distributed import as_completed

    futures = client.map(_chunk, *zip(*tasks, strict=True), pure=False)
    try:
        for finished in as_completed(futures):  # type: ignore[no-untyped-call]
            yield finished.result()
    finally:
        # Chunks that have begun end by themselves.
        if client.status == "running":
            client.cancel(futures)
