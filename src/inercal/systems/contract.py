"""The contract of a system: one frozen record of what it offers, by which the rest of the program knows it.

A record lies in ``<system>/system.py``, and `inercal.systems.listed` has all of them. Its functions import what they
need when they are called, so that a command loads one system and no other.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from inercal.faces.python.result import Result
    from inercal.faces.python.study import Study
    from inercal.faces.stream.estimators import Make, Say, SayFinding
    from inercal.faces.validate.case import Case
    from inercal.foundation._toml import Strict
    from inercal.foundation.arrays import Array
    from inercal.foundation.designs.foresight import Foresight
    from inercal.foundation.findings import Finding
    from inercal.foundation.records.record import Record
    from inercal.foundation.results.result import Estimate

Channels = Collection[str]
"""Names of the channels of a recording."""


@dataclass(frozen=True)
class OfferedDesign:
    """A design of a test by a study: ``find`` it, and what to ``prepare`` before (kernels that are compiled)."""

    find: Callable[[Study], Result]
    prepare: Callable[[Study], None] = lambda study: None


@dataclass(frozen=True)
class OfferedPlan:
    """The plan of a test in lines of text, and in the study: that of one ``design``.

    ``ending`` is that of the file of a plan that the design finds, empty where it finds none; a line ``says`` such as.
    ``rows`` are the lines of a plan, as words. They go into the study at ``key``, in the place of the keys ``others``;
    or, where there is no key, ``keys`` of the lines and the study as given are what is set. ``named`` are plans by
    their name. A key that is set to None is taken out.
    """

    design: str
    ending: str
    says: str
    rows: Callable[[Any], Sequence[Sequence[str]]]
    key: str = ""
    others: tuple[str, ...] = ()
    keys: Callable[[Sequence[Sequence[str]], Mapping[str, Any]], Mapping[str, Any]] = lambda rows, given: {}
    named: Callable[[], Mapping[str, Mapping[str, Any]]] = dict


@dataclass(frozen=True, kw_only=True)
class System:
    """All that the faces need to know of one system. What is None or empty, it does not offer."""

    kind: str
    """Kind of its studies: "selfcal"."""
    command: str
    """Command that calibrates: "calibrate imu"."""
    title: str
    """The instrument, in words."""
    of: str
    """Words that follow "study" and say of what it is."""

    # studies
    read_study: Callable[[Mapping[str, Any], str | Path], Any]
    """Settings of a parsed study and its path. Raises `StudyError`."""
    study_file: Callable[[], type[Strict]]
    """Model of a study file, of which the JSON Schema is made."""
    new_study: Callable[[Channels], dict[str, Any]]
    """Keys in force of a new study for a recording with these channels."""
    first: str
    """Command to begin with where there is no recording, of ``{study}`` and ``{files}``."""
    sections: Callable[[Sequence[Record]], tuple[str, tuple[Finding, ...]] | None] | None = None
    """Table of sections beside a new study, as text, and what is asked about it; None for records without sections."""
    rigs: tuple[str, ...] = ()
    """Values of ``rig.kind`` that tell the kind of a study."""
    table: str = ""
    """Table that tells the kind of a study without a rig."""
    unread: str = ""
    """Table whose files are read by a simulation alone."""
    unsimulated: str = ""
    """Table whose files a simulation does not read."""

    # recordings
    tells: Callable[[Channels], bool] = lambda channels: False
    """True where canonical channels tell that a recording is for this system."""
    complete: Callable[[Channels], bool] = lambda channels: False
    """True where canonical channels need no map."""
    guess: Mapping[str, Any] = field(default_factory=dict)
    """Options of `inercal.foundation.records.recognise.map_text.guess_map`."""
    counted: Callable[[Any], bool] = lambda settings: False
    """True of settings for which rows of a file need no times."""

    # verbs
    calibrate: Callable[[Sequence[Record], Study, bool, Say], Result]
    """Result of records by a study; whether other estimators are compared; takes the progress in words."""
    prepare: Callable[[Study, bool], None] | None = None
    """Loads, or compiles, the kernels of ``calibrate``."""
    compares: bool = False
    """True where ``calibrate`` compares estimators."""
    simulate: Callable[[Study, np.random.Generator], Record]
    """A recording of the test that a study plans."""
    designs: Mapping[str, OfferedDesign] = field(default_factory=dict)
    """Designs by their name, the first that of a study that names none."""
    sensitivity: Callable[[Study], Result] | None = None
    """Errors that matter for what the instrument should read."""
    runs: Callable[[str | Path, Study, Callable[[Path], Record], bool, Say], Result] | None = None
    """Result of a table of runs, of which a function reads each."""
    stream: Callable[[Any, float, Say, SayFinding], Make] | None = None
    """Estimator of settings on a stream, with a line each so many seconds, 0 for each row."""
    streams: str = ""
    """Quantities that a stream measures, in words."""
    loaded: Callable[[Estimate], Result] | None = None
    """A saved estimate as its command shows it, where that differs from any other."""

    converts: bool = False
    """True where other tools have the coefficients as well."""

    # before a test
    foresight: Callable[[Any], Foresight] | None = None
    """Uncertainties that the plan of settings makes expect."""
    verticals: Callable[[Any], Array] | None = None
    """Directions (r, 3) of the vertical on the instrument at each stop of the plan."""
    plan: OfferedPlan | None = None
    """The plan in lines of text."""

    # validation
    cases: Callable[[], Sequence[Case]] = tuple
    """Published and closed-form cases."""
    shows: str = ""
    """The subject of the cases."""
