"""SciPy, loaded without parts of NumPy that nobody here asks for.

Its shared part runs ``from numpy import *``, which loads the compiler of Fortran wrappers, the tools of tests and the
like: two fifths of the time that `scipy.linalg` takes to load, a tenth of a short command.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

SHARED = "scipy._lib._array_api"

PARTS = ("ctypeslib", "f2py", "ma", "polynomial", "testing")
"""Modules of NumPy that are loaded when they are asked for, and there alone."""


class LeanSciPy(MetaPathFinder):
    """Finds the shared part of SciPy, and hides `PARTS` that are not loaded while it is."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """None for any other module."""
        found = PathFinder.find_spec(fullname, path) if fullname == SHARED else None
        if found is None or found.loader is None:
            return None
        load = found.loader.exec_module

        def exec_module(module: ModuleType) -> None:
            import numpy as np

            hidden = [name for name in PARTS if name not in vars(np)]
            for name in hidden:
                setattr(np, name, None)
            try:
                load(module)
            finally:
                for name in hidden:
                    if vars(np)[name] is None:  # not loaded meanwhile
                        delattr(np, name)

        found.loader.exec_module = exec_module  # type: ignore[method-assign]
        return found


def lean_scipy() -> None:
    """Let SciPy be loaded so in this process."""
    sys.meta_path.insert(0, LeanSciPy())
