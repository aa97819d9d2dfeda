"""The format of a file whose ending tells none: by its first bytes, else it is text, or refused with a way out."""

from __future__ import annotations

import json
import re
import zipfile
from collections import Counter
from pathlib import Path

from inercal.foundation.errors import RecordError

_HEAD = 1 << 16
"""Bytes that are looked at."""

_BEGINNINGS = (
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"MATLAB ", "mat"),
    (b"CDF", "netcdf"),
    (b"PAR1", "parquet"),
    (b"TDSm", "tdms"),
    (b"ULog\x01\x12\x35", "ulog"),
    (b"\xa3\x95\x80\x80", "dataflash"),
    (b"#ROSBAG V2.0", "bags"),
    (b"\x89MCAP0", "bags"),
    (b"SQLite format 3\0", "bags"),
    (b"\x1f\x8b", "text"),
    (b"\xff\xfe", "text"),
    (b"\xfe\xff", "text"),
)
_REFUSED = (
    (b"%PDF", "is a PDF document: export its table as CSV, or type it in one"),
    (b"\xd0\xcf\x11\xe0", "is an old Office document: save it as .xlsx, or its table as CSV"),
)
_ZIP = b"PK\x03\x04"
#: a member of an archive, or the end of its name -> what the file is
_DOCUMENTS = {"word/document.xml": "a Word document", "ppt/presentation.xml": "a presentation"}


def format_by_content(path: Path) -> str:
    """The name of the module that reads a file; raises `RecordError` with what the file is, and the way out."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error
    for beginning, module in _BEGINNINGS:
        if head.startswith(beginning):
            return module
    for beginning, sentence in _REFUSED:
        if head.startswith(beginning):
            raise RecordError(path, sentence)
    if head.startswith(_ZIP):
        return _of_archive(path)
    if _is_one_document(head):
        return "json_arrays"
    if (zero := head.find(0)) >= 0:
        raise RecordError(path, binary(zero))
    return "text"


_BEGINS_JSON = re.compile(rb"""\{\s*["}]|\[\s*(?:["\[{\]tfn]|-?\d[\d.eE+-]*\s*[,\]])""")
"""A value of JSON, unlike a stamp in brackets."""


def _is_one_document(head: bytes) -> bool:
    """True for a text that is one value of JSON, not a value each line; ``head`` are its first bytes."""
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not _BEGINS_JSON.match(text):
        return False
    first, _, rest = text.partition(b"\n")
    try:
        value = json.loads(first)
    except (ValueError, RecursionError):
        return first.strip() in (b"{", b"[") or len(rest.strip()) == 0 or b"[" in first
    return not rest.strip() or not isinstance(value, dict)


def is_json(path: Path) -> bool:
    """True for a file that is one document of JSON, whatever its ending."""
    try:
        with path.open("rb") as file:
            begins = file.read(64).removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")
        return begins and _is_one_document(_head(path))
    except OSError:
        return False


def _head(path: Path) -> bytes:
    """The first bytes of a file."""
    with path.open("rb") as file:
        return file.read(_HEAD)


def binary(zero: int) -> str:
    """The sentence on a binary file of no known format, whose first zero byte stands at ``zero``; -1: there is none."""
    where = f" (zero byte at {zero})" if zero >= 0 else ""
    return (
        f"is binary{where}, of no known format. If your logger can write CSV, use that; else say its frames in a map: "
        '[file] sync = "AA 55", binary = [...], fields = [...]'
    )


def _of_archive(path: Path) -> str:
    """The module for a ZIP archive: spreadsheets and NPZ are such; raises `RecordError` for any other."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if not name.endswith("/")]
    except zipfile.BadZipFile as error:
        raise RecordError(path, f"is a damaged ZIP archive ({error})") from error
    if "xl/workbook.xml" in names or {"content.xml", "mimetype"} <= set(names):
        return "sheets"
    if names and all(name.endswith(".npy") for name in names):
        return "npz"
    for member, document in _DOCUMENTS.items():
        if member in names:
            raise RecordError(path, f"is {document}: export its table as CSV")
    endings = Counter(Path(name).suffix.lower() or "plain" for name in names)
    held = " and ".join(
        f"{count} {ending[1:].upper()[:9]} file{'s' * (count > 1)}"
        if ending != "plain"
        else f"{count} others"
        for ending, count in endings.most_common(3)
    )
    raise RecordError(
        path, f"is a ZIP archive that holds {held or 'nothing'}: unpack it, and give those files"
    )
