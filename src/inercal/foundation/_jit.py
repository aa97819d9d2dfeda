"""The one door to compiled kernels.

A kernel is plain Python. Those that Python calls are compiled when the wheel is built, or by `make kernels`, into
``_kernels``, a module of machine code that needs no compiler: `kernel` and its siblings put its functions in the
place of theirs, where all that it was made from is the same: the kernels, this file and, in a checkout, the build.
Where it is absent, numba compiles kernels as they are called (the extra `jit`), or they run as plain Python, which is
slow.

INERCAL_KERNELS chooses by hand: `compiled` takes nothing else, and refuses arguments of types that no machine code is
there for; `numba`; `python`.
"""

from __future__ import annotations

import functools
import hashlib
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import util
from pathlib import Path
from typing import Any, Literal, NamedTuple, NoReturn, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

PACKAGE = Path(__file__).resolve().parents[1]

CHOICE = "INERCAL_KERNELS"
"""Variable of the environment that says how kernels run: one of `WAYS`; the first that is there without it."""

WAYS = ("compiled", "numba", "python")

_HOW_TO = "`make kernels` compiles all in a checkout, a wheel holds them"


class Way(NamedTuple):
    """A way for kernels to run: ``how``, one of `WAYS`; the ``module`` of machine code; ``why`` there is none."""

    how: str
    module: Any = None
    why: str = ""


def source_hash(package: Path = PACKAGE) -> str:
    """SHA-256 over names and contents of all Python sources below ``package``."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def way() -> Way:
    """The way in which kernels run in this process.

    Raises `InputError` where INERCAL_KERNELS asks for what is not there.
    """
    asked = os.environ.get(CHOICE, "")
    if asked not in ("", *WAYS):
        _refuse(f"found {asked!r}, expected one of {', '.join(WAYS)}")
    why = ""
    if asked in ("", "compiled"):
        module, why = _machine_code()
        if module is not None:
            return Way("compiled", module)
        if asked:
            _refuse(f"found {asked}, but {why}: {_HOW_TO}")
    has_numba = util.find_spec("numba") is not None
    if asked == "numba" and not has_numba:
        _refuse("found numba, which is not installed: it is the extra `jit`")
    return Way(asked or ("numba" if has_numba else "python"), None, why)


def _refuse(text: str) -> NoReturn:
    from inercal.foundation.errors import InputError

    raise InputError(CHOICE, text)


def digest(folder: Path, files: str) -> str:
    """SHA-256 over the contents of ``files``, paths in a ``folder`` with a space or line feed between."""
    found = hashlib.sha256()
    for file in files.split():
        found.update((folder / file).read_bytes() + b"\0")
    return found.hexdigest()


def _machine_code() -> tuple[Any, str]:
    """``_kernels``; or None, and why. It tells once that it is not used where the sources have changed."""
    try:
        from inercal import _kernels
    except ImportError:
        return None, "kernels are not compiled"
    module: Any = _kernels
    build = PACKAGE.parents[1] / "kernels"  # of a checkout: its table says what Python calls
    with suppress(OSError, AttributeError):  # a module of an older build says less of itself
        same = digest(PACKAGE, module.FILES) == module.SOURCES
        if same and (
            not (build / "signatures.json").exists() or digest(build, module.BUILD_FILES) == module.BUILD
        ):
            return module, ""
    why = "kernels have changed since they were compiled"
    if not os.environ.get(CHOICE):
        warnings.warn(f"{why}: what was compiled is not used; {_HOW_TO}", RuntimeWarning, stacklevel=2)
    return None, why


def kernel(function: F) -> F:
    """A kernel, compiled without the GIL (nopython, no fastmath).

    It counts no references to arrays, which took up to a third of a filter's time. So it must not make an array (nor
    call functions of NumPy that do, such as ``np.median``), nor return one, alone or in a tuple, nor call a kernel that
    returns one: numba does not always notice, and memory is lost or freed too soon. Such a kernel is `allocating`.
    What Python calls fills arrays that it is given, and returns numbers or tuples of them.
    """
    return _taken(function, "never", counting=False)


def allocating(function: F) -> F:
    """A kernel that makes arrays, or gets them from one that does, and counts the references to them."""
    return _taken(function, "never", counting=True)


def inlined(function: F) -> F:
    """A kernel for one or two others, into which it is put: they compile sooner than with it beside them."""
    return _taken(function, "always", counting=False)


def merged(function: F) -> F:
    """A kernel whose machine code becomes part of each caller's: for one that takes many arrays, since each costs seven
    words at a call."""
    return _taken(function, "never", counting=False, forced=True)


def plain(kernel: Any) -> Any:
    """A kernel as plain Python, which may be given arrays for numbers."""
    return getattr(kernel, "py_func", getattr(kernel, "__wrapped__", kernel))


def _taken(function: F, inline: Literal["never", "always"], counting: bool, forced: bool = False) -> F:
    """The function as it runs in this process."""
    how, module, _ = way()
    if how == "numba":
        return _jitted(function, inline, counting, forced)
    code = module.ALL.get(f"{function.__module__}.{function.__name__}") if module else None
    return function if code is None else _entry(function, code, module.Unfit)


def _entry(function: F, code: Callable[..., Any], unfit: type[Exception]) -> F:
    """Machine code, beside the plain function for arguments of other types; a NamedTuple comes back as one."""
    named = function.__globals__.get(str(function.__annotations__.get("return")))
    named = named if hasattr(named, "_fields") else None

    @functools.wraps(function)
    def entry(*arguments: Any) -> Any:
        try:
            return code(*arguments) if named is None else named(*code(*arguments))
        except unfit:
            _say_unfit(f"{function.__module__}.{function.__name__}", types_of(arguments))
        return function(*arguments)

    entry.machine_code = code  # type: ignore[attr-defined]
    return cast(F, entry)


def _say_unfit(name: str, types: str) -> None:
    """Warn that a call is slow, or refuse it where nothing but machine code is asked for."""
    text = f"{name} is not compiled for arguments of the types {types}"
    if os.environ.get(CHOICE):
        raise TypeError(text)
    warnings.warn(f"{text}: it runs as plain Python, slowly", RuntimeWarning, stacklevel=3)


def types_of(arguments: tuple[Any, ...]) -> str:
    """Types of arguments as machine code is looked up by them, one after the other.

    f, i and b are a float, an integer and a bool; ``(ff)`` is a tuple. Of an array: the letter of its items (d float64,
    q int64, w int32, Q uint64, B uint8, ? bool, x any other), its number of axes, F or A where it is not contiguous in
    rows but in columns, or not at all, and R where it cannot be written.
    """
    import numpy as np

    letters = {"f8": "d", "i8": "q", "i4": "w", "u8": "Q", "u1": "B", "b1": "?"}

    def one(value: Any) -> str:
        if isinstance(value, tuple):
            return f"({types_of(value)})"
        if isinstance(value, np.ndarray):
            flags = value.flags
            letter = letters.get(value.dtype.str[1:], "x") if value.dtype.isnative else "x"
            layout = "" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
            return f"{letter}{value.ndim}{layout}{'' if flags.writeable else 'R'}"
        if isinstance(value, bool | np.bool_):
            return "b"
        return "i" if isinstance(value, int | np.integer) else "f"

    return "".join(map(one, arguments))


def _user_caches() -> Iterator[Path]:
    """Places for numba's cache, best first: the user's cache folder, then a private temporary one."""
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
    """Folder of what numba compiled of exactly these sources, or None where nothing can be written.

    numba's own cache is keyed on the file that holds the kernel, not on the kernels it calls: a cached caller would go
    on with the old numbers. So the folder carries a hash over every source file of the package.
    """
    key = source_hash()
    for base in _user_caches():
        if _usable(base) and _usable(base / key):
            return base / key
    return None


def _jitted(function: F, inline: Literal["never", "always"], counting: bool, forced: bool) -> F:
    """The function as numba compiles it when it is first called, cached on disk where possible."""
    import numba
    import numba.core.config

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
    if way().how == "numba":
        import numba

        return cast(F, cast(Any, kernel).compile(tuple(map(numba.typeof, arguments))))
    return cast(F, getattr(kernel, "machine_code", kernel))


@contextmanager
def compiling(name: str, say: Callable[[str], None]) -> Iterator[None]:
    """Surround the tiny first calls of a system's kernels; says so once when they must be compiled, or are slow."""
    how, _, why = way()
    folder = cache_folder() if how == "numba" else None
    done = None if folder is None else folder / f"{name}.compiled"
    first = f"{why}: " if why else ""
    if how == "python":
        say(f"{first}kernels run as plain Python, minutes in place of a second; {_HOW_TO}")
    elif how == "numba" and (done is None or not done.exists()):
        say(f"{first}compiling those of this command takes 5 to 40 s, once; {_HOW_TO}")
    yield
    if done is not None:
        with suppress(OSError):  # it would be said once more
            done.touch()
