"""XML of strangers, parsed without risk: no document type, no entities, nothing fetched, bounded in size and depth."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

from lxml import etree

from inercal.foundation._files import read_bytes
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from lxml.etree import _Element

LARGEST = 32 * 2**20
"""Bytes of the largest certificate that is read."""

_DEEPEST = 64
_MOST = 200_000
"""Elements of a certificate, and how deep they may lie."""


class _UnfitError(Exception):
    """A file that is unfit to be read, and why."""


def parsed(path: str | Path) -> _Element:
    """The root of an XML file; raises `InputError` in one sentence."""
    expected = "expected a digital calibration certificate (.xml)"
    try:
        size = os.stat(path).st_size
        if size > LARGEST:
            raise InputError(path, f"has {size} bytes, expected {LARGEST} at most of a certificate")
        data = read_bytes(path)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror}), {expected}") from error
    except ValueError as error:  # a NUL in the path
        raise InputError(repr(str(path)), f"{error}, {expected}") from error
    return tree_of(data, path)


def tree_of(data: bytes, path: str | Path) -> _Element:
    """The root of XML in bytes; raises `InputError` in one sentence."""
    try:
        _gate(data)
        parser = etree.XMLParser(
            resolve_entities=False, no_network=True, load_dtd=False, remove_pis=True, huge_tree=True
        )
        return etree.fromstring(data, parser)
    except _UnfitError as refused:
        raise InputError(path, str(refused)) from refused
    except (expat.ExpatError, etree.XMLSyntaxError, ValueError) as error:
        said = " ".join(str(error).split())[:120]
        raise InputError(
            path, f"is no whole XML ({said}), expected a digital calibration certificate"
        ) from error


def _gate(data: bytes) -> None:
    """Look the file through before a tree is made of it, and stop at the first thing that no certificate has."""
    gate = expat.ParserCreate()
    depth = count = 0

    def refuse(*_: object) -> None:
        raise _UnfitError("declares a document type or entities, expected none in a certificate")

    def begin(name: str, attributes: object) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > _DEEPEST:
            raise _UnfitError(f"has elements more than {_DEEPEST} deep, expected a certificate")
        if count > _MOST:
            raise _UnfitError(f"has more than {_MOST} elements, expected a certificate")

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    gate.StartDoctypeDeclHandler = refuse
    gate.EntityDeclHandler = refuse
    gate.StartElementHandler = begin
    gate.EndElementHandler = end
    gate.Parse(data, True)
