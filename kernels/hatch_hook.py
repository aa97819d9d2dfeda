"""Hook of the build: a wheel holds the compiled kernels. An editable install and a source archive need none."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLAIN = os.environ.get("INERCAL_KERNELS") == "python"


class Kernels(BuildHookInterface):  # type: ignore[type-arg]
    """Compiles the kernels, and puts them into the wheel."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """What compiling needs; an editable install, which asks under its own name, does without."""
        if PLAIN or self.target_name != "wheel" or "get_requires_for_build_editable" in sys.argv:
            return []
        project = tomllib.loads(Path(self.root, "pyproject.toml").read_text(encoding="utf-8"))
        return list(project["dependency-groups"]["kernels"])

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Raises RuntimeError where kernels cannot be compiled, but for a wheel of plain Python that was asked for."""
        if PLAIN or self.target_name != "wheel" or version == "editable":
            return
        command = [sys.executable, str(Path(self.root, "kernels", "build.py")), "--tell"]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(
                "the kernels were not compiled, which needs the group `kernels` of pyproject.toml and a C compiler; "
                "INERCAL_KERNELS=python makes a wheel without them, slow"
            )
        module = Path(done.stdout.strip())
        build_data["pure_python"] = False
        build_data["tag"] = "cp311-abi3-" + sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["force_include"][str(module)] = f"inercal/{module.name}"
