"""Where a campaign works, and where it keeps what is done: the options of every script, in the words of the commands.

Workers of a cluster that others run need this folder's parent in PYTHONPATH, for the simulators lie there.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from inercal import __version__
from inercal.cli.options import CheckpointOption, ClusterOption, WorkersOption, count_of
from inercal.foundation._files import write_text
from inercal.foundation.computing.cluster import place
from inercal.foundation.computing.executors import Executor, computed, divided
from inercal.foundation.errors import InercalError, InputError


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options ``--workers``, ``--cluster`` and ``--checkpoint``."""
    words = [option.__metadata__[0].help for option in (WorkersOption, ClusterOption, CheckpointOption)]
    parser.add_argument("--workers", type=int, metavar="N", help=words[0])
    parser.add_argument("--cluster", metavar="ADDRESS", help=words[1])
    parser.add_argument("--checkpoint", type=Path, metavar="FOLDER", help=words[2])


def place_of(options: argparse.Namespace) -> Executor:
    """The place that the options name; raises `InputError`."""
    return place(count_of(options.workers, options.cluster), options.cluster)


def in_words(main: Callable[[], None]) -> None:
    """A script, which ends in one sentence where its options or its place are at fault."""
    try:
        main()
    except InercalError as error:
        raise SystemExit(f"error: {error}") from error


def progress(done: int, total: int) -> None:
    """Say on standard error how many runs are done."""
    print(f"\r{done} of {total}", end="\n" if done == total else "", file=sys.stderr, flush=True)


def answers(
    work: Callable[[int], Any],
    count: int,
    options: argparse.Namespace,
    about: dict[str, Any],
    size: int | None = None,
    again: Callable[[Any], bool] = lambda answer: False,
) -> list[Any]:
    """``work(0)`` to ``work(count - 1)``, plain objects, in this order wherever the options have them computed.

    Finished chunks of ``size`` are kept in the folder of the options, which belongs to the campaign that ``about``
    names; one that is there is not done again, unless ``again`` of an answer in it is true.
    """
    executor, folder = place_of(options), options.checkpoint
    if folder is not None:
        _claim(folder, {**about, "inercal": __version__})
    done, missing = {}, []
    for chunk in divided(count, size):
        kept = None if folder is None else _kept(_path(folder, chunk), len(chunk))
        if kept is None or any(map(again, kept)):
            missing.append(chunk)
        else:
            done[chunk.start] = kept
    progress(sum(map(len, done.values())), count)
    for chunk, found in computed(executor, _Each(work), missing):
        if folder is not None:
            write_text(_path(folder, chunk), json.dumps(found))
        done[chunk.start] = found
        progress(sum(map(len, done.values())), count)
    return [answer for start in sorted(done) for answer in done[start]]


@dataclass(frozen=True)
class _Each:
    """Work on single numbers, for chunks of them."""

    work: Callable[[int], Any]

    def __call__(self, numbers: Iterable[int]) -> list[Any]:
        """The answers in the order of the numbers."""
        return [self.work(number) for number in numbers]

    def prepare(self) -> None:
        """Make ready what the work needs, where it says how."""
        if hasattr(self.work, "prepare"):
            self.work.prepare()


def _claim(folder: Path, about: dict[str, Any]) -> None:
    """Make the folder this campaign's, or see that it is."""
    path = folder / "campaign.json"
    folder.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        write_text(path, json.dumps(about))
    elif (found := path.read_text(encoding="utf-8")) != json.dumps(about):
        raise InputError(folder, f"is of another campaign, {found}, expected {json.dumps(about)}")


def _path(folder: Path, chunk: range) -> Path:
    """The file of a chunk."""
    return folder / f"runs-{chunk.start}-{chunk.stop - 1}.json"


def _kept(path: Path, size: int) -> list[Any] | None:
    """The answers of a chunk that was kept, None where there are none."""
    try:
        found = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, list) and len(found) == size else None
