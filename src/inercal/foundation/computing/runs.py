"""Monte Carlo: many runs of one task, each with a random stream of its own.

Run number ``i`` of a campaign draws from a stream that depends on the campaign's seed and on ``i`` alone.
So the answer has the same digits for any executor, any number of workers, any size and order of chunks,
and with or without an interruption in between; and any single run can be repeated by hand::

    result = run(task, runs=1000, seed=7, executor=Threads(2))
    again = task(generator(7, 123))  # the same numbers as result[...][123]
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import pickle
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor as Pool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal import __version__
from inercal.foundation._files import write_bytes
from inercal.foundation.computing.executors import Executor, computed, divided
from inercal.foundation.errors import InercalError, InputError

Task: TypeAlias = Callable[[np.random.Generator], Mapping[str, ArrayLike]]
"""One run: draws from the generator, returns named arrays whose shapes are the same in every run."""

Sample: TypeAlias = dict[str, NDArray[np.float64]]
"""Named arrays; those of many runs are stacked along a leading axis, ``(runs, ...)``."""


class RunError(InercalError):
    """A run failed. ``task(generator(seed, run))`` repeats it.

    Attributes
    ----------
    run, seed : int
        Number of the run and seed of its campaign.
    cause : str
        The failure. The ``__cause__`` is the exception itself, or its traceback from another process.
    """

    def __init__(self, run: int, seed: int, cause: str) -> None:
        """Keep all three as ``args``, so that the exception can be pickled."""
        super().__init__(run, seed, cause)
        self.run, self.seed, self.cause = run, seed, cause

    def __str__(self) -> str:
        """Say it in one sentence."""
        return f"run {self.run} of seed {self.seed} failed: {self.cause}"


def generator(seed: int, run: int) -> np.random.Generator:
    """The random stream of one ``run`` (from 0) of a campaign of that ``seed`` (not negative).

    PCG64 on ``SeedSequence(seed, spawn_key=(run,))``: what ``SeedSequence(seed).spawn`` gives its child number ``run``.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(run,))))


def run(
    task: Task,
    *,
    runs: int,
    seed: int,
    executor: Executor | Pool | None = None,
    chunk: int | None = None,
    folder: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Sample:
    """Repeat a task, each time with a random stream of its own, and stack what it returns: (runs, ...) float64 by name.

    Parameters
    ----------
    task : callable
        ``task(rng)`` returns a mapping of names to numbers or arrays of fixed shape.
    seed : int
        Seed of the campaign, not negative. With `runs` it settles every digit of the answer.
    executor : Executor, optional
        `Serial` (the default), `Threads`, `Processes`, anything else with their ``map``, or a
        `concurrent.futures.Executor`, which stays open.
    chunk : int, optional
        Runs handed to a worker at a time, and kept as one file; by default some 64 chunks are made.
    folder : path, optional
        Keep finished chunks here. The same call picks them up again, also after a kill; a damaged file is
        computed anew. A manifest tells campaigns apart by the task's name and pickled content, but cannot
        see that the code behind the name has changed.
    progress : callable, optional
        Called in this thread as ``progress(done, runs)``: at the start, then after every chunk.

    Raises
    ------
    RunError
        A run raised an exception, or returned other names or shapes than the first.
    InputError
        The folder holds a different campaign.

    Examples
    --------
    >>> def mean_of_ten(rng):
    ...     return {"mean": rng.standard_normal(10).mean()}
    >>> run(mean_of_ten, runs=400, seed=1)["mean"].shape
    (400,)
    """
    if runs < 1 or (chunk is not None and chunk < 1) or seed < 0:
        raise InputError("run", f"got runs={runs}, chunk={chunk}, seed={seed}, expected 1, 1, 0 or more")
    chunks = divided(runs, chunk)
    done: dict[int, Sample] = {}  # by the number of the chunk's first run
    if folder is not None:
        folder = Path(folder)
        _open(folder, _manifest(task, seed, runs, len(chunks[0])))
        done = {c.start: kept for c in chunks if (kept := _kept(folder, c)) is not None}

    missing = [c for c in chunks if c.start not in done]
    count = runs - sum(map(len, missing))
    if progress:
        progress(count, runs)
    for c, sample in computed(executor, _Runs(task, seed), missing):
        if folder is not None:
            _keep(folder, c, sample)
        done[c.start] = sample
        count += len(c)
        if progress:
            progress(count, runs)
    return _join(done, seed)


@dataclass(frozen=True)
class _Runs:
    """The runs of a campaign by their numbers."""

    task: Task
    seed: int

    def __call__(self, numbers: Iterable[int]) -> Sample:
        """Do the runs with these numbers."""
        done: dict[int, Sample] = {}
        for number in numbers:
            try:
                returned = self.task(generator(self.seed, number))
                done[number] = {
                    k: np.asarray(value, dtype=np.float64)[np.newaxis] for k, value in returned.items()
                }
            except Exception as error:
                raise RunError(number, self.seed, f"{type(error).__name__}: {error}") from error
        return _join(done, self.seed)

    def prepare(self) -> None:
        """Make ready what the task needs, where it says how."""
        if hasattr(self.task, "prepare"):
            self.task.prepare()


def _join(parts: Mapping[int, Sample], seed: int) -> Sample:
    """Join samples along the runs; each is filed under the number of its first run."""
    order = sorted(parts)
    shapes = {number: {name: a.shape[1:] for name, a in parts[number].items()} for number in order}
    for number in order:
        if shapes[number] != shapes[order[0]]:
            raise RunError(
                number, seed, f"returned {shapes[number]}, expected {shapes[order[0]]} as in run {order[0]}"
            )
    return {name: np.concatenate([parts[number][name] for number in order]) for name in parts[order[0]]}


def _manifest(task: Task, seed: int, runs: int, chunk: int) -> dict[str, str | int]:
    """Identity of a campaign in its files."""
    named = task.func if isinstance(task, partial) else task
    name = f"{named.__module__}.{getattr(named, '__qualname__', type(named).__qualname__)}"
    try:
        content = hashlib.sha256(pickle.dumps(task, protocol=5)).hexdigest()
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            name, f"cannot be kept in a folder, expected a function of a module ({error})"
        ) from error
    return {
        "task": name,
        "content": content,
        "seed": seed,
        "runs": runs,
        "chunk": chunk,
        "numpy": np.__version__,
        "inercal": __version__,
    }


def _open(folder: Path, manifest: dict[str, str | int]) -> None:
    """Claim an empty folder for the campaign, or make sure that it is this campaign's."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "manifest.json"
    if not path.exists():
        if any(folder.glob("chunk-*.npz")):
            raise InputError(path, "is missing beside finished chunks, expected an empty folder")
        write_bytes(path, json.dumps(manifest, indent=2).encode())
        return
    try:
        stored = dict(json.loads(path.read_bytes()))
    except (ValueError, TypeError) as error:
        raise InputError(path, f"cannot be read ({error}), expected the manifest of a campaign") from error
    differing = [key for key in manifest if stored.get(key) != manifest[key]]
    if differing:
        got, expected = ({key: d.get(key) for key in differing} for d in (stored, manifest))
        raise InputError(path, f"belongs to another campaign, with {got}, expected {expected}")


def _chunk_path(folder: Path, chunk: range) -> Path:
    """Name the file of a chunk."""
    return folder / f"chunk-{chunk.start:09d}.npz"


def _keep(folder: Path, chunk: range, sample: Sample) -> None:
    """Write a finished chunk."""
    data = io.BytesIO()
    arrays: dict[str, Any] = dict(sample)  # allow_pickle would be an array of its own with NumPy 2.0
    np.savez(data, **arrays)
    write_bytes(_chunk_path(folder, chunk), data.getvalue())


def _kept(folder: Path, chunk: range) -> Sample | None:
    """Read a finished chunk, or return None if there is none that can be trusted."""
    try:
        with np.load(io.BytesIO(_chunk_path(folder, chunk).read_bytes())) as arrays:
            sample = {name: np.asarray(arrays[name], dtype=np.float64) for name in arrays}
    except Exception:  # the ways in which a damaged zip archive fails to read are many
        return None
    return sample if all(len(a) == len(chunk) for a in sample.values()) else None
