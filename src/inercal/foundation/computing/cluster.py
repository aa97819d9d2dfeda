"""Chunks of work on a cluster of dask.distributed: many machines behind the seam of
`inercal.foundation.computing.executors`.

A scheduler that somebody else runs, or one of this machine. Workers must have the program of this process; what the
work needs (modules, kernels) is made ready on each before it is given a chunk. A worker that is lost is no loss: its
chunks go to another.
"""

from __future__ import annotations

import logging
import os
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from inercal.foundation.addresses import shown_address
from inercal.foundation.computing.executors import Executor, Processes, Serial
from inercal.foundation.errors import InercalError, InputError, MissingExtraError
from inercal.foundation.inputs import program

T = TypeVar("T")

LOCAL = "local"
"""Address of a cluster that is started here, and ended with the work."""


class ChunkLostError(InercalError, BrokenExecutor):
    """A ``chunk`` that ended several workers one after the other."""

    def __init__(self, chunk: range) -> None:
        self.chunk = chunk
        super().__init__(chunk)

    def __str__(self) -> str:
        """Say it in one sentence."""
        return f"the work from {self.chunk.start} to {self.chunk.stop - 1} ended every worker that took it"


_AGAIN = 5
"""Times that a chunk is done again whose answer was lost on the way."""

_PATIENCE = 15.0
"""Time [s] within which a scheduler must answer and a worker must be there."""


@dataclass(frozen=True)
class Cluster:
    """Workers of dask.distributed at ``address``: ``tcp://host:8786``, a scheduler file, or ``local``.

    ``workers`` are the processes of a local cluster, one for each processor if None.
    """

    address: str = field(repr=False)
    workers: int | None = None

    @property
    def where(self) -> str:
        """The address as it may be shown."""
        return shown_address(self.address)

    def map(
        self, work: Callable[[Iterable[int]], T], chunks: Sequence[range]
    ) -> Generator[tuple[range, T], None, None]:
        """Yield the chunks as they are finished.

        Work may have a method ``prepare``: it is called on every worker, also on one that comes later, before any
        chunk. Raises `InputError` without a scheduler or where a worker has another program or cannot begin,
        `InercalError` where the scheduler is lost, `ChunkLostError` where a chunk ended several workers one after the
        other.
        """
        with _client(self) as client:
            distributed = _distributed()
            _same_program(client, self.where)
            name = _brought(client, work, self.where)

            def submitted(chunk: range) -> Any:
                return client.submit(_done, name, chunk, pure=False)

            # Not by Client.get_executor: where an answer is lost on the way, its futures are never done.
            futures = {submitted(chunk): (chunk, 0) for chunk in chunks}
            finished = distributed.as_completed(list(futures))
            try:
                for future in finished:
                    chunk, times = futures.pop(future)
                    try:
                        answer: T = future.result()
                    except distributed.KilledWorker as error:
                        raise ChunkLostError(chunk) from error
                    except (distributed.comm.CommClosedError, CancelledError, TimeoutError) as error:
                        # the answer went with its worker, or everything with the scheduler
                        if client.status != "running" or times == _AGAIN:
                            raise _lost(self.where) from error
                        again = submitted(chunk)
                        futures[again] = chunk, times + 1
                        finished.add(again)
                        continue
                    yield chunk, answer
                    future.release()
            finally:
                with suppress(Exception):  # the scheduler may be gone
                    client.cancel(list(futures), force=True)
                    client.unregister_worker_plugin(name)
        if futures:
            raise _lost(self.where)


def place(workers: int, cluster: str | None = None) -> Executor:
    """The place to work in: this process, so many processes, or a cluster at an address; raises `InputError`."""
    if workers < 1:
        raise InputError("workers", f"found {workers}, expected 1 or more")
    if cluster is not None:
        return Cluster(cluster, workers)
    return Serial() if workers == 1 else Processes(workers)


def _done(name: str, chunk: range) -> Any:
    """A chunk of the work of that name, done on a worker."""
    return _distributed().get_worker().plugins[name].work(chunk)


def _lost(address: str) -> InercalError:
    """The sentence for a scheduler that is gone."""
    return InercalError(
        f"{address}: the scheduler was lost; what was finished is kept, and the same command goes on from there"
    )


def _distributed() -> Any:
    """The package; raises `MissingExtraError` without it."""
    try:
        return import_module("distributed")
    except ImportError as error:
        raise MissingExtraError("a cluster", "cluster") from error


@contextmanager
def _client(cluster: Cluster) -> Iterator[Any]:
    """A client of the cluster, which is closed at the end; raises `InputError`."""
    distributed = _distributed()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # one sentence says what matters
    if cluster.address == LOCAL:
        made = distributed.LocalCluster(
            n_workers=cluster.workers or os.cpu_count() or 1,
            threads_per_worker=1,
            # Its server of pages would take port 8787, or warn that another has it.
            scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
            silence_logs=50,
        )
        with made, distributed.Client(made) as client:
            yield client
        return
    address, where = cluster.address, cluster.where
    given: dict[str, Any] = {"address" if "://" in address else "scheduler_file": address}
    if "scheduler_file" in given and not Path(address).is_file():
        raise InputError(
            "--cluster", f"found {where!r}, expected {LOCAL!r}, an address such as tcp://host:8786, or a file"
        )
    try:
        client = distributed.Client(**given, timeout=_PATIENCE)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            "--cluster", f"{where}: no scheduler answers ({type(error).__name__}), expected one at work there"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=_PATIENCE)
        except TimeoutError as error:
            raise InputError("--cluster", f"{where}: found no worker, expected one at work there") from error
        yield client


def _same_program(client: Any, address: str) -> None:
    """Refuse workers that have another inercal, Python or NumPy; raises `InputError`."""
    found = client.run(_versions, on_error="return")
    ours = _versions()
    for worker, theirs in found.items():
        if theirs == ours:
            continue
        what = "no inercal" if isinstance(theirs, Exception) else "another program"
        told = f" ({', '.join(f'{k} {v}' for k, v in theirs.items())})" if isinstance(theirs, dict) else ""
        raise InputError(
            "--cluster",
            f"{address}: the worker {worker} has {what}{told}, expected that of this process "
            f"({', '.join(f'{k} {v}' for k, v in ours.items())})",
        )


def _versions() -> dict[str, str]:
    """Versions that must be the same for the same digits."""
    import platform

    import numpy as np

    from inercal import __version__

    return {
        "inercal": f"{__version__} {program()[:12]}",
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _brought(client: Any, work: Any, address: str) -> str:
    """Bring work to every worker, and to those that come later; the name by which they know it.

    Raises `InputError` where a worker cannot load or prepare it.
    """
    name = f"inercal-{uuid.uuid4().hex}"

    class Work(_distributed().WorkerPlugin):  # type: ignore[misc]
        def __init__(self) -> None:
            self.name, self.work = name, work

        def setup(self, worker: Any) -> None:
            if hasattr(self.work, "prepare"):
                self.work.prepare()

    times = 0
    while True:
        try:
            client.register_plugin(Work())
            return name
        except Exception as error:  # what a worker raises comes in many classes
            with suppress(Exception):
                client.unregister_worker_plugin(name)
            if isinstance(error, InercalError):
                raise
            times += 1
            lost = isinstance(error, _distributed().comm.CommClosedError)  # a worker, meanwhile
            if not lost or times > _AGAIN or client.status != "running":
                raise _unable(error, client, address) from error


def _unable(error: Exception, client: Any, address: str) -> InercalError:
    """The sentence for work that cannot be brought to the workers."""
    if client.status != "running":
        return _lost(address)
    return InputError(
        "--cluster",
        f"{address}: a worker cannot begin ({' '.join(str(error).split())}), expected the modules of the work "
        "in its PYTHONPATH",
    )
