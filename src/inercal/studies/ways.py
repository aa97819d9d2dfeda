"""Keys of which a table of a study holds one: the ways to state positions, a path, a distribution."""

from typing import Final

POSITIONS: Final = ("grid", "plan", "list", "file")
PATHS: Final = ("turns", "path")
DISTRIBUTIONS: Final = ("uniform", "normal", "triangular", "two_point")
