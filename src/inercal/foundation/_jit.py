"""The one decorator for compiled kernels.

numba's own disk cache is keyed on the file that holds the kernel, not on the kernels it calls: after an
upgrade that changes only a callee, a cached caller would silently go on with the old numbers. So the
cache folder carries a hash over every source file of the package, and any change starts a fresh one.
"""

from __future__ import annotations

import functools
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, cast

import numba
import numba.core.config

F = TypeVar("F", bound=Callable[..., Any])

PACKAGE = Path(__file__).resolve().parents[1]


def source_hash(package: Path = PACKAGE) -> str:
    """SHA-256 over names and contents of all Python sources below ``package``."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def _user_caches() -> Iterator[Path]:
    """Places for the cache, best first: the user's cache folder, then a private temporary one."""
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    with suppress(RuntimeError):  # no home directory
        yield (Path(base) if base else Path.home() / ".cache") / "inercal"
    owner = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    with suppress(FileNotFoundError):  # no temporary folder either
        yield Path(tempfile.gettempdir()) / f"inercal-{owner}"


def _usable(folder: Path) -> bool:
    """Make the folder; true if it is ours and a file, as large as that of a kernel, can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        # In a shared temporary folder somebody else could have planted code under our name.
        if hasattr(os, "getuid") and folder.stat().st_uid != os.getuid():
            return False
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(1 << 20))
            return True
    except OSError:
        return False


@functools.cache
def cache_folder() -> Path | None:
    """Folder of the compiled kernels of exactly these sources, or None where nothing can be written."""
    key = source_hash()
    for base in _user_caches():
        if _usable(base) and _usable(base / key):
            return base / key
    return None


def kernel(function: F) -> F:
    """Compile a function with numba (nopython, no GIL, no fastmath), cached on disk where possible.

    It counts no references to arrays, which took up to a third of a filter's time. So it must not make an array (nor
    call functions of NumPy that do, such as ``np.median``), nor return one, alone or in a tuple, nor call a kernel that
    returns one: numba does not always notice, and memory is lost or freed too soon. Such a kernel is `allocating`.
    """
    return _compiled(function, "never", counting=False)


def allocating(function: F) -> F:
    """A kernel that makes arrays, or gets them from one that does, and counts the references to them."""
    return _compiled(function, "never", counting=True)


def inlined(function: F) -> F:
    """A kernel for one or two others, into which it is put: they compile sooner than with it beside them."""
    return _compiled(function, "always", counting=False)


def merged(function: F) -> F:
    """A kernel whose machine code becomes part of each caller's: for one that takes many arrays, since each costs seven
    words at a call."""
    return _compiled(function, "never", counting=False, forced=True)


def _compiled(function: F, inline: Literal["never", "always"], counting: bool, forced: bool = False) -> F:
    """The function as numba compiles it when it is first called."""
    folder = cache_folder()
    config = cast(Any, numba.core.config)
    before = config.CACHE_DIR
    config.CACHE_DIR = "" if folder is None else str(folder)
    try:
        options = {"nogil": True, "cache": folder is not None, "inline": inline, "_nrt": counting}
        if forced:
            options["forceinline"] = True
        return cast(F, cast(Any, numba.njit)(**options)(function))
    finally:
        config.CACHE_DIR = before


def compiled(kernel: F, *arguments: Any) -> F:
    """The machine code of a kernel for arguments of these types: calling it skips the look at their types, several
    microseconds for NamedTuples of arrays; the caller keeps to the types."""
    compile_for = getattr(kernel, "compile", None)  # none where compiling is turned off
    return kernel if compile_for is None else cast(F, compile_for(tuple(map(numba.typeof, arguments))))


@contextmanager
def compiling(name: str, say: Callable[[str], None]) -> Iterator[None]:
    """Surround the tiny first calls of a system's kernels; says so once when they must be compiled."""
    folder = cache_folder()
    done = None if folder is None else folder / f"{name}.compiled"
    if done is None or not done.exists():
        say("compiling kernels, once")
    yield
    if done is not None:
        with suppress(OSError):  # it would be said once more
            done.touch()
