"""Compiles the kernels that Python calls into a module of machine code, `_kernels`, of the stable ABI of Python 3.11.

    python kernels/build.py             # build/kernels/HASH/_kernels.*, unless it is there
    python kernels/build.py --in-place  # and a copy beside the package, where a checkout finds it

numba types and optimises each entry of `signatures.json`; what it gives as LLVM is emitted as objects by two processes
at once, and linked by the platform's compiler with `caller.c` (Python's side) and `runtime.c` (what numba's code asks
of its runtime). numba's internals are used here alone, hence its pin.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.metadata
import io
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from entries import SOURCE, Sources, digest

HERE = Path(__file__).parent
ROOT = HERE.parent
PACKAGE = SOURCE / "inercal"
TABLE = HERE / "signatures.json"
FILES = ["build.py", "caller.c", "compile.py", "entries.py", "runtime.c", TABLE.name]
"""What makes machine code of sources: in a checkout it must still be the same for that to be used."""

#: processors that the code runs on -> LLVM's name: the oldest of each kind, since a wheel is for all
PROCESSORS = {"x86_64": "x86-64", "amd64": "x86-64", "arm64": "generic", "aarch64": "generic"}

MOST_RETURNED = 16
"""Numbers that a kernel returns at most."""


class Code(NamedTuple):
    """One signature of an entry: its ``name``, types of ``arguments`` and ``result``, 64-bit ``words`` of its
    arguments, and ``arrays`` among them."""

    name: str
    arguments: str
    result: str
    words: int
    arrays: int


def built() -> Path:
    """The module, in a folder of `build` that is named by a hash of all that it depends on; compiled if not there."""
    sources = Sources()
    table = json.loads(TABLE.read_text())
    names = [".".join(name) for name in sources.entries]
    if sorted(table) != names or not all(table.values()):
        wrong = {*table} ^ {*names} or {name for name in table if not table[name]}
        raise SystemExit(
            f"{TABLE.name}: found other entries than the sources have: {', '.join(sorted(wrong))}"
        )
    files = sources.rests_on()
    of_sources = digest(PACKAGE, files)
    compiler = f"{importlib.metadata.version('numba')} {platform.system()} {_processor()}"
    parts = _once(
        _key(of_sources, compiler, TABLE, HERE / "compile.py"), lambda folder: _compile(folder, len(table))
    )
    whole = _key(parts.name, digest(HERE, FILES))
    (module,) = _once(whole, lambda folder: _link(folder, parts, files, of_sources)).iterdir()
    return module


def _once(key: str, fill: Callable[[Path], None]) -> Path:
    """The folder of this key, filled if it is not there: whole, or not at all."""
    folder = ROOT / "build" / "kernels" / key
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix="making-") as made:
            inner = Path(made, key)
            inner.mkdir()
            fill(inner)
            with contextlib.suppress(OSError):  # another process was faster
                inner.rename(folder)
    return folder


def _key(*given: str | Path) -> str:
    """Short hash of texts and files."""
    found = hashlib.sha256()
    for each in given:
        found.update(each.encode() if isinstance(each, str) else each.read_bytes())
    return found.hexdigest()[:16]


def _processor() -> str:
    """LLVM's name of the processor to compile for."""
    return PROCESSORS.get(platform.machine().lower(), "generic")


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _compile(folder: Path, count: int) -> None:
    """Objects in ``folder``, by two processes, and what is in them."""
    _say(f"compiling {count} kernels, once: about a minute on two processors")
    began = time.perf_counter()
    parts = [
        subprocess.Popen([sys.executable, str(HERE / "compile.py"), part, str(folder)], env=environment())
        for part in ("0", "1")
    ]
    codes = [part.wait() for part in parts]
    if any(codes):
        raise SystemExit("the kernels were not compiled")
    _say(f"compiled in {time.perf_counter() - began:.0f} s")


def environment() -> dict[str, str]:
    """Of the processes that compile."""
    # pip lets its isolated build find numba by a path of its own
    paths = [str(SOURCE), str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {
        "INERCAL_KERNELS": "numba",
        "NUMBA_CPU_NAME": _processor(),
        "NUMBA_CPU_FEATURES": "",
        "PYTHONPATH": os.pathsep.join(paths),
        "PYTHONHASHSEED": "0",  # the same code from the same sources
    }


def _link(folder: Path, parts: Path, files: list[str], of_sources: str) -> None:
    """The module, from the objects and the C files; tried once."""
    from setuptools import Distribution, Extension

    rows = sorted(Code(*row) for path in parts.glob("*.json") for row in json.loads(path.read_text()))
    most_words, most_arrays = max(row.words for row in rows), max(row.arrays for row in rows)
    symbols = [symbol(row.name, row.arguments) for row in rows]
    lines = [
        *[f"int32_t {name}(const int64_t *, void *);" for name in symbols],
        f"enum {{ COUNT = {len(rows)}, WORDS = {most_words}, ARRAYS = {max(most_arrays, 1)} }};",
        f"enum {{ RETURNED = {MOST_RETURNED} }};",
        "static const Entry ENTRIES[] = {",
        *[
            f'  {{"{row.name}", "{row.arguments}", "{row.result}", {name}}},'
            for row, name in zip(rows, symbols, strict=True)
        ],
        "};",
        f'static const char SOURCES[] = "{of_sources}";',
        "static const char FILES[] =",
        *[f'  "{file}\\n"' for file in files],
        ";",
        f'static const char BUILD[] = "{digest(HERE, FILES)}";',
        f'static const char BUILD_FILES[] = "{" ".join(FILES)}";',
    ]
    work = folder.parent
    (work / "entries.inc").write_text("\n".join(lines) + "\n")
    windows = sys.platform == "win32"
    extension = Extension(
        "_kernels",
        [str(HERE / "caller.c"), str(HERE / "runtime.c")],
        include_dirs=[str(work)],
        extra_objects=[str(path) for path in sorted(parts.glob("*.o"))],
        extra_compile_args=[] if windows else ["-O2", "-fvisibility=hidden", "-g0"],
        extra_link_args=["-s"] if sys.platform == "linux" else [],
        libraries=[] if windows else ["m"],
        py_limited_api=True,
    )
    command: Any = Distribution({"ext_modules": [extension]}).get_command_obj("build_ext")
    command.build_lib, command.build_temp = str(work / "made"), str(work / "temporary")
    command.ensure_finalized()
    with contextlib.redirect_stdout(io.StringIO()):
        command.run()
    (module,) = map(Path, command.get_outputs())
    subprocess.run([sys.executable, "-c", "import _kernels"], cwd=module.parent, check=True)
    module.rename(folder / module.name)


def symbol(name: str, signature: str) -> str:
    """Name by which the linker knows the code of a signature."""
    return "kernel_" + hashlib.sha256(f"{name} {signature}".encode()).hexdigest()[:16]


def main() -> None:
    """Build, and copy where asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--in-place", action="store_true", help="copy it into the package")
    parser.add_argument("--tell", action="store_true", help="print where it is")
    given, module = parser.parse_args(), built()
    if given.tell:
        print(module)
    if given.in_place:
        beside = PACKAGE / f".{module.name}.{os.getpid()}"
        shutil.copyfile(module, beside)
        beside.replace(PACKAGE / module.name)


if __name__ == "__main__":
    main()
