"""Study files in: TOML, then ``--set key=value``, then the kind of study the command wants."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from inercal.faces.studies.starting import DISTRIBUTIONS, PATHS, POSITIONS, UNKNOWN, of_sections
from inercal.foundation._toml import read_toml
from inercal.foundation.errors import StudyError
from inercal.foundation.keys import unheeded
from inercal.foundation.units import shown
from inercal.systems.aoa.system import SYSTEM as AOA
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS
from inercal.systems.selfcal.system import SYSTEM as SELFCAL
from inercal.systems.strapdown.system import SYSTEM as STRAPDOWN

# each kind of study brings models that take a tenth of a second to build: those of the others are not wanted
if TYPE_CHECKING:
    from inercal.systems.aoa.settings import AoaSettings
    from inercal.systems.imu.settings import ImuSettings
    from inercal.systems.selfcal.settings import SelfcalSettings
    from inercal.systems.strapdown.settings import StrapdownSettings

#: tables (a regular expression) that hold one of these keys: setting one takes the place of the others
_ONE_OF = (
    (r"positions", POSITIONS),
    (r"plan", PATHS),
    (r"rig\.errors\.\w+", DISTRIBUTIONS),
    (r"sensors\.\w+", ("axis", "angle")),
    (r"sensors\.\w+", ("calibration", "scale")),
    (r"sensors\.\w+", ("calibration", "bias")),
    (r"sensors\.\w+", ("channel", "scale")),
    (r"sensors\.\w+", ("channel", "bias")),
)

#: keys (a regular expression) that name a file
_FILES = (
    r"estimator\.prior|imu\.sections|motion\.file|positions\.file|rig\.errors\.\w+\.table"
    r"|sensors\.\w+\.calibration"
)


#: dotted key that a new study leaves open -> an example
_OPEN = {"site.latitude": "48.1 deg"}


def load_study(system: System, path: str | Path, overrides: Iterable[str] = ()) -> Any:
    """Settings of the study of a system, a TOML file; parameters and errors as of `load_imu_study`."""
    return system.read_study(_read(path, overrides, system), path)


def load_imu_study(path: str | Path, overrides: Iterable[str] = ()) -> ImuSettings:
    """Read the study of ``inercal calibrate imu``, a TOML file.

    ``overrides`` are keys to set over those of the file, ``"imu.static_start=50 s"``. A value that is TOML
    (``true``, ``"9.81 m/s^2"``) is read as such, any other as a text. Where a table holds one of several
    keys (``positions.grid``, ``plan``, ...), one that is set takes the place of the others. A file that is set
    is one of the working folder, not of the study's.

    Raises `StudyError`: file and key, what was found, what was expected.
    """
    settings: ImuSettings = load_study(IMU, path, overrides)
    return settings


def load_strapdown_study(path: str | Path, overrides: Iterable[str] = ()) -> StrapdownSettings:
    """Read the study of a strapdown unit: of its simulation and calibration.

    Parameters and errors as of `load_imu_study`.
    """
    settings: StrapdownSettings = load_study(STRAPDOWN, path, overrides)
    return settings


def load_selfcal_study(path: str | Path, overrides: Iterable[str] = ()) -> SelfcalSettings:
    """Read the study of a self-calibration: of its simulation, path design and estimation.

    Parameters and errors as of `load_imu_study`.
    """
    settings: SelfcalSettings = load_study(SELFCAL, path, overrides)
    return settings


def load_aoa_study(path: str | Path, overrides: Iterable[str] = ()) -> AoaSettings:
    """Read the study of ``inercal aoa`` and ``inercal simulate aoa``.

    Parameters and errors as of `load_imu_study`.
    """
    settings: AoaSettings = load_study(AOA, path, overrides)
    return settings


def files_of(path: Path, given: Mapping[str, Any], unread: str = "") -> tuple[Path, ...]:
    """The study, and the files that it names; ``given`` as in its settings, without those of the table ``unread``."""
    named = {key: name for key, name in _texts(given) if re.fullmatch(_FILES, key)}
    return (path, *(path.parent / name for key, name in named.items() if key.split(".")[0] != unread))


def files_named(system: System, path: Path, overrides: Iterable[str], unread: str = "") -> tuple[Path, ...]:
    """The study, and the files that it names with its overrides, as `files_of`, none of them read.

    Raises `StudyError` where the study itself cannot be read.
    """
    return files_of(path, _read(path, overrides, system), unread)


def _texts(table: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Dotted keys and values of all texts in a table, in their order; however deep it is nested."""
    left = list(table.items())[::-1]
    while left:
        name, entry = left.pop()
        if isinstance(entry, Mapping):
            left += [(f"{name}.{key}", value) for key, value in list(entry.items())[::-1]]
        elif isinstance(entry, str):
            yield name, entry


def _read(path: str | Path, overrides: Iterable[str], system: System) -> dict[str, Any]:
    """The file with the overrides put in; refused where it is a study of another system.

    A table of sections is the study that names it, and nothing else but the site to fill in.
    """
    table = system.sections is not None and Path(path).suffix.lower() == ".csv"
    data = of_sections(Path(path).name) if table else read_toml(path, StudyError)
    if is_map(data):
        raise StudyError(path, "found a column map, which goes behind --map, expected a study")
    rig = data.get("rig")
    kind = rig.get("kind") if isinstance(rig, dict) else None
    other = next((each for each in SYSTEMS.values() if kind in each.rigs), system)
    expected = f"expected one {system.of}"
    if other is not system:
        raise StudyError(path, f"rig.kind: found {kind!r}, a study for `inercal {other.command}`, {expected}")
    own = [each for each in SYSTEMS.values() if each.table in data]
    if rig is None and own and system not in own:
        raise StudyError(
            path,
            f"found a study for `inercal {own[0].command}`, {expected}, with a table [{system.table or 'rig'}]",
        )
    if len(own) > 1:
        names = " and ".join(f"[{each.table}]" for each in own)
        raise StudyError(path, f"found the tables {names}, expected one of them: they tell the kind of study")
    for override in sorted(overrides, key=lambda each: not each.startswith("motion.kind")):  # it makes room
        put(data, override, Path(path).parent)
    _refuse_unfilled(data, path)
    return data


def is_map(data: Mapping[str, Any]) -> bool:
    """True for a column map in the place of a study."""
    of_study = {"site", "rig", *(system.table for system in SYSTEMS.values())}
    return bool(data.keys() & {"columns", "file"}) and not data.keys() & of_study


def _refuse_unfilled(data: Mapping[str, Any], path: str | Path) -> None:
    """Refuse a study with keys that are still to be filled in, naming all of them."""
    keys = [key for key, value in _texts(data) if value.strip() == UNKNOWN]
    if not keys:
        return
    names = keys[0] if len(keys) == 1 else f"{', '.join(keys[:-1])} and {keys[-1]}"
    example = next((f'{key}="{_OPEN[key]}"' for key in keys if key in _OPEN), f"{keys[0]}=VALUE")
    such = "their values" if len(keys) > 1 else "its value"
    raise StudyError(
        path, f'fill in {names}: found "{UNKNOWN}", expected {such} in the file, or as --set {example}'
    )


def unfilled(data: Mapping[str, Any], value: str) -> dict[str, Any]:
    """The study with ``value`` in every place still to be filled in."""
    return {
        name: {key: value if each == UNKNOWN else each for key, each in table.items()}
        if isinstance(table, Mapping)
        else table
        for name, table in data.items()
    }


def put(data: dict[str, Any], override: str, folder: Path) -> None:
    """Set one key of the freshly parsed ``data``, of a study in ``folder``, by its dotted name.

    Raises `StudyError` for no key and value, or a key inside a value that is no table.
    """
    where = f"--set {shown(override)}"
    name, equals, text = override.partition("=")
    keys = [key.strip() for key in name.split(".")]
    if not (equals and all(keys)):
        raise StudyError(where, "found no key and value, expected key=value such as imu.static_start=50 s")
    table = data
    for depth, key in enumerate(keys[:-1], start=1):
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise StudyError(where, f"{'.'.join(keys[:depth])} is no table, expected the key of a value")
        _make_room(table, ".".join(keys[:depth]), keys[depth])
    if keys == ["site", "gravity"] and table.get("latitude") == UNKNOWN:
        del table[
            "latitude"
        ]  # where the latitude is needed for earth rate too, it is missed with that reason
    value = _value(text.strip())
    if keys == ["motion", "kind"]:
        for other in _of_other_motions(value):
            table.pop(other, None)
    is_file = re.fullmatch(_FILES, ".".join(keys)) and isinstance(value, str)
    # typed on a command line, and so beside where one is; what a study names lies beside the study
    table[keys[-1]] = os.path.relpath(value, folder) if is_file and value else value


def _make_room(table: dict[str, Any], name: str, key: str) -> None:
    """Take out of the table of that name what cannot stand beside the key."""
    for names, keys in _ONE_OF:
        if key in keys and re.fullmatch(names, name):
            for other in keys:
                if other != key:
                    table.pop(other, None)


def _of_other_motions(kind: object) -> Iterable[str]:
    """Keys of a motion that belong to other kinds alone."""
    from inercal.systems.aoa.motion import MotionKind, MotionPlan

    return unheeded(MotionPlan, str(kind)) if kind in get_args(MotionKind) else ()


def _value(text: str) -> Any:
    """A TOML value, or else the text itself."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if len(parsed) == 1 else text
