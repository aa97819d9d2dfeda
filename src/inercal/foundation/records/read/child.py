"""Work on a file in a child process, under limits of time and memory.

The libraries that read binary formats may crash on a damaged file, or never end: this then ends a child, and the
error is one sentence. The child is a fork, at the cost of some milliseconds; where forking is not safe (Windows,
macOS, beside other threads) it is a new Python, at the cost of starting it. Arrays come back in a file in memory, and
are not copied on arrival. The limits keep accidents in; they are no cage for hostile code.
"""

from __future__ import annotations

import gc
import mmap
import os
import pickle
import select
import signal
import struct
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, TypeVar

from inercal.foundation.errors import InercalError, RecordError
from inercal.foundation.records.read import limits

T = TypeVar("T")

Tell = Callable[[int], None]
Work = Callable[[Tell], T]
"""Work in the child, which is handed the function to tell the bytes done to."""

_PATIENCE = 10
"""Times the limit of processor time that are waited for a child: the machine may be busy."""

_ALIGNED = 64
_NUMBER = struct.Struct("<Q")
_DONE = (1 << 64) - 1


@dataclass(frozen=True)
class _Ended:
    """The end of a child: its answer if it has one, else the exit code, of a signal negative; ``late``: out of time."""

    answer: memoryview | None
    code: int
    late: bool


def in_child(work: Work[T], path: Path, progress: Tell = lambda _: None) -> T:
    """The result of ``work`` on the file ``path``, or its exception.

    Parameters
    ----------
    work : callable
        A function of a module, or a `functools.partial` or method of one. Arguments, result and exception can be
        pickled.
    path : path
        The file, whose size sets the limits (`inercal.foundation.records.read.limits`).
    progress : callable
        Told the bytes done, in this process.

    Raises
    ------
    RecordError
        The child crashed, or took more time or memory than it may.
    """
    size = limits.size_of(path)
    ended = (_forked if _may_fork() else _spawned)(work, size, progress)
    if ended.answer is None:
        raise RecordError(path, _words(ended, size))
    result, error = _unpacked(ended.answer)
    if error is not None:
        raise error
    return result  # type: ignore[no-any-return]


def _may_fork() -> bool:
    """True where a fork is safe: a lock that another thread holds would never be free in it.

    Daemons, such as those of a progress bar or a notebook, hold none of those that readers take.
    """
    others = [each for each in threading.enumerate() if each is not threading.current_thread()]
    return hasattr(os, "fork") and sys.platform != "darwin" and all(each.daemon for each in others)


def _words(ended: _Ended, size: int) -> str:
    """A sentence on a child that has no answer."""
    time_is_up = ended.late or -ended.code in (getattr(signal, "SIGXCPU", 0), getattr(signal, "SIGKILL", 0))
    if time_is_up and ended.code:
        return (
            f"reading it was given up after {limits.seconds(size)} s of processor time or no memory was left, "
            "expected a file that is not damaged"
        )
    with suppress(ValueError):
        return f"crashed its reader ({signal.Signals(-ended.code).name}), expected a file that is not damaged"
    return f"crashed its reader (exit code {ended.code}), expected a file that is not damaged"


def _forked(work: Work[Any], size: int, progress: Tell) -> _Ended:
    """Work in a fork of this process."""
    with _memory() as answer:
        told, telling = os.pipe()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "ignore", DeprecationWarning
                )  # threads of libraries, which the fork lacks
                pid = os.fork()
        except OSError:
            os.close(told)
            os.close(telling)
            raise
        if pid == 0:
            code = 1
            try:
                os.close(told)
                _quiet()
                _answer(work, answer, telling, size)
                code = 0
            finally:
                os._exit(code)
        os.close(telling)
        code, done, late = 0, False, False
        try:
            deadline = time.monotonic() + _PATIENCE * limits.seconds(size)
            while not done and not late:
                late = not select.select([told], [], [], max(0.0, deadline - time.monotonic()))[0]
                piece = b"" if late else os.read(told, _NUMBER.size)
                if len(piece) < _NUMBER.size:
                    break
                (number,) = _NUMBER.unpack(piece)
                done = number == _DONE
                if not done:
                    progress(number)
        finally:
            os.close(told)
            if late or not done:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            with suppress(ChildProcessError):  # where nobody waits for children
                code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        return _Ended(_mapped(answer) if done else None, code, late)


def _spawned(work: Work[Any], size: int, progress: Tell) -> _Ended:
    """Work in a new Python."""
    job = pickle.dumps(sys.path) + pickle.dumps((work, size))
    with tempfile.TemporaryDirectory(prefix="inercal-") as folder:
        name = Path(folder, "answer")
        command = [sys.executable, "-P", "-m", __name__, str(name)]
        package = str(Path(__file__).parents[4])
        before = os.environ.get("PYTHONPATH")  # an empty part would be the working folder, anybody's
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (package, before)))}
        import subprocess

        child = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        late: list[bool] = []

        def end() -> None:
            late.append(True)
            child.kill()

        assert child.stdin is not None
        assert child.stdout is not None
        timer = threading.Timer(_PATIENCE * limits.seconds(size), end)
        timer.daemon = True
        timer.start()
        done = False
        try:
            with suppress(OSError), child.stdin:
                child.stdin.write(job)
            while not done and len(piece := child.stdout.read(_NUMBER.size)) == _NUMBER.size:
                (number,) = _NUMBER.unpack(piece)
                done = number == _DONE
                if not done:
                    progress(number)
        finally:
            timer.cancel()
            if not done:
                child.kill()
            child.stdout.close()
            code = child.wait()
            timer.join()
        return _Ended(memoryview(bytearray(name.read_bytes())) if done else None, code, bool(late))


def _main() -> None:
    """The new Python: job on standard input, bytes done on standard output, answer in the file that is named."""
    sys.path[:] = pickle.load(sys.stdin.buffer)
    work, size = pickle.load(sys.stdin.buffer)
    telling = os.dup(1)
    with open(sys.argv[1], "wb", buffering=0) as answer:
        _answer(work, answer, telling, size)


def _quiet() -> None:
    """Leave signals and the terminal to the parent: what a library says as it crashes is nobody's."""
    for name, handler in (
        ("SIGINT", signal.SIG_IGN),
        ("SIGTERM", signal.SIG_DFL),
        ("SIGHUP", signal.SIG_DFL),
    ):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), handler)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    if "faulthandler" in sys.modules:
        sys.modules["faulthandler"].disable()


def _answer(work: Work[Any], answer: IO[bytes], telling: int, size: int) -> None:
    """Do the work under limits, and write its result or exception: sizes of the parts, then each part aligned."""
    gc.disable()  # the collector would touch, and so copy, all that the parent has
    _limit(size)
    buffers: list[pickle.PickleBuffer] = []
    try:
        result = work(lambda done: _tell(telling, done))
        head = pickle.dumps((result, None), protocol=5, buffer_callback=buffers.append)
    except Exception as error:
        if not isinstance(error, InercalError):
            error.add_note(traceback.format_exc())
        buffers = []
        head = _pickled(error)
    parts: list[memoryview] = [memoryview(head), *(buffer.raw() for buffer in buffers)]
    sizes = [len(parts), *(part.nbytes for part in parts)]
    parts.insert(0, memoryview(b"".join(map(_NUMBER.pack, sizes))))
    for part in parts:
        for rest in (part, memoryview(bytes(-part.nbytes % _ALIGNED))):
            left = rest
            while left.nbytes:
                left = left[answer.write(left) :]
    _tell(telling, _DONE)


def _pickled(error: Exception) -> bytes:
    """An exception as it is, or in words where it cannot be told otherwise."""
    try:
        head = pickle.dumps((None, error), protocol=5)
        pickle.loads(head)
    except Exception:
        head = pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")), protocol=5)
    return head


def _tell(telling: int, done: int) -> None:
    """Tell the parent a number."""
    os.write(telling, _NUMBER.pack(done))


def _limit(size: int) -> None:
    """Limit processor time and memory, where the system can."""
    try:
        import resource
    except ImportError:
        return
    soonest = limits.seconds(size)
    given = {resource.RLIMIT_CORE: (0, 0), resource.RLIMIT_CPU: (soonest, soonest + 2)}
    with suppress(OSError), open("/proc/self/statm", encoding="ascii") as file:
        most = int(file.read().split()[0]) * mmap.PAGESIZE + limits.memory(size)
        given[resource.RLIMIT_AS] = (most, most)
    for kind, (soft, hard) in given.items():
        ceiling = resource.getrlimit(kind)[1]
        if ceiling != resource.RLIM_INFINITY:
            soft, hard = min(soft, ceiling), min(hard, ceiling)
        resource.setrlimit(kind, (soft, hard))


def _memory() -> IO[bytes]:
    """A file without a name, in memory where the system has such."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("inercal"), "w+b", buffering=0)
    return tempfile.TemporaryFile(buffering=0)


def _mapped(answer: IO[bytes]) -> memoryview:
    """The content of a file, which may be written to without effect on the file."""
    return memoryview(
        mmap.mmap(answer.fileno(), 0, flags=mmap.MAP_PRIVATE, prot=mmap.PROT_READ | mmap.PROT_WRITE)
    )


def _unpacked(answer: memoryview) -> tuple[Any, Exception | None]:
    """Result and exception; arrays are views of the answer."""
    (count,) = _NUMBER.unpack_from(answer)
    sizes = [_NUMBER.unpack_from(answer, _NUMBER.size * place)[0] for place in range(1, count + 1)]
    begin, parts = _NUMBER.size * (count + 1), []
    for size in sizes:
        begin += -begin % _ALIGNED
        parts.append(answer[begin : begin + size])
        begin += size
    head, *buffers = parts
    return pickle.loads(head, buffers=buffers)  # type: ignore[no-any-return]


if __name__ == "__main__":
    _main()
