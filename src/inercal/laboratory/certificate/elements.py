"""XML of certificates: elements of DCC and D-SI, and files read as such, within bounds on their size and nesting.

Texts, numbers to the last digit, quantities with expanded uncertainty.
"""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

from lxml import etree

from inercal.foundation._files import input_bytes
from inercal.foundation.errors import InputError
from inercal.foundation.instruments.dsi import as_written, dsi, is_coherent

if TYPE_CHECKING:
    from lxml.etree import _Element


DCC = "https://ptb.de/dcc"
SI = "https://ptb.de/si"
XSI = "http://www.w3.org/2001/XMLSchema-instance"
NAMESPACES = {"dcc": DCC, "si": SI}


def dcc(name: str, *children: _Element | str | None, ref_type: str | None = None) -> _Element:
    """An element of DCC; children that are None are left out, texts are freed of characters that XML cannot hold."""
    return _element(f"{{{DCC}}}{name}", children, ref_type)


def si(name: str, *children: _Element | str | None) -> _Element:
    """An element of D-SI."""
    return _element(f"{{{SI}}}{name}", children, None)


def _element(tag: str, children: Sequence[_Element | str | None], ref_type: str | None) -> _Element:
    """An element with its text, or with its children in order."""
    made = etree.Element(tag, nsmap=NAMESPACES)
    if ref_type is not None:
        made.set("refType", ref_type)
    for child in children:
        if isinstance(child, str):
            made.text = plain(child)
        elif child is not None:
            made.append(child)
    return made


def plain(text: str) -> str:
    """A text on one line, with ? for what XML cannot hold."""
    return " ".join(re.sub("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]", "?", text).split())


def words(name: str, text: str) -> _Element:
    """An element that holds a text of one language, English."""
    content = dcc("content", text)
    content.set("lang", "en")
    return dcc(name, content)


def optional(name: str, text: str) -> _Element | None:
    """An element with a text; None where that is empty."""
    return dcc(name, text) if plain(text) else None


def number(value: float) -> str:
    """The shortest text that is the same number again."""
    return repr(value + 0.0)


def factor(k: float) -> str:
    """A coverage factor, which D-SI writes without an exponent, and 1 at least."""
    if not k >= 1.0:
        raise InputError("certificate", f"found the coverage factor {k:g}, expected 1 or more")
    return format(Decimal(repr(k)), "f")


def real(
    value: float, unit: str, expanded: tuple[float, float, float] | None = None, label: str = ""
) -> _Element:
    """A number of D-SI; ``expanded`` is U, k and the coverage probability."""
    unc = None
    if expanded is not None:
        U, k, probability = expanded
        unc = si(
            "expandedUnc",
            si("uncertainty", number(U)),
            si("coverageFactor", factor(k)),
            si("coverageProbability", number(probability)),
        )
    named = si("label", label) if label else None
    return si("real", named, si("value", number(value)), si("unit", unit), unc)


def of_result(
    value: float, unit: str, expanded: tuple[float, float, float] | None = None, label: str = ""
) -> _Element:
    """A number of a result in SI; where its ``unit`` is no SI unit, in that one too."""
    own = real(value, as_written(unit), expanded, label)
    if is_coherent(unit):
        return own
    text, size = dsi(unit)
    in_si = None if expanded is None else (expanded[0] * size, *expanded[1:])
    return si("hybrid", real(value * size, text, in_si, label), own)


def file(name: str, mime: str, content: bytes, ref_type: str) -> _Element:
    """A file inside the certificate."""
    return dcc(
        "byteData",
        dcc("fileName", name),
        dcc("mimeType", mime),
        dcc("dataBase64", base64.b64encode(content).decode()),
        ref_type=ref_type,
    )


LARGEST = 32 * 2**20
"""Bytes of the largest certificate that is read."""

_DEEPEST = 64
_MOST = 200_000
"""Elements of a certificate, and how deep they may lie."""


class _UnfitError(Exception):
    """A file that is unfit to be read, and why."""


def parsed(path: str | Path) -> _Element:
    """The root of an XML file; raises `InputError` in one sentence."""
    with suppress(OSError, ValueError):  # which reading it tells
        size = os.stat(path).st_size
        if size > LARGEST:
            raise InputError(path, f"has {size} bytes, expected {LARGEST} at most of a certificate")
    return tree_of(input_bytes(path, "a digital calibration certificate (.xml)"), path)


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
