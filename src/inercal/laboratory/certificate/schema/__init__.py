"""Schemas of DCC 3.2.1 and D-SI 2.1.0, with their licence, and the check of a certificate against them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from lxml import etree

if TYPE_CHECKING:
    from lxml.etree import XMLSchema, _Element

VERSION = "3.2.1"
"""The schema of certificates that this program writes and validates."""

_FOLDER = Path(__file__).parent


@cache
def _schema() -> XMLSchema:
    """The schema, from the files beside this module; no network is asked."""
    return etree.XMLSchema(etree.parse(_FOLDER / f"dcc_v{VERSION}.xsd", etree.XMLParser(no_network=True)))


def fault(root: _Element) -> str | None:
    """The first thing in which a certificate departs from the schema, in a sentence; None where it is valid."""
    schema = _schema()
    if schema.validate(root):
        return None
    first = schema.error_log[0]
    words = (
        " ".join(first.message.split()).replace("{https://ptb.de/dcc}", "").replace("{https://ptb.de/si}", "")
    )
    return f"line {first.line}: {words if len(words) < _LONGEST else f'{words[:_LONGEST]}...'}"


_LONGEST = 300
"""Characters of a message of the schema."""
