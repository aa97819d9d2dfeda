"""Estimates as JSON and TOML: the contract of the JSON result, written atomically and read back."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from inercal.foundation._files import input_bytes, write_text
from inercal.foundation.addresses import without_secrets
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.dsi import stated
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.result import COVERAGE, Estimate
from inercal.foundation.units import shown


def to_json(estimate: Estimate) -> dict[str, Any]:
    """The estimate as plain objects, in the order of the contract; numbers that are not finite become None."""
    from inercal import __version__

    parameters = [
        {
            **{"name": p.name, "value": p.value, "u": p.u, "U": p.U, "k": p.k, "dof": p.dof, "unit": p.unit},
            **{"coverage_probability": COVERAGE, "long_name": _long_name(p.name), "unit_dsi": stated(p.unit)},
        }
        for p in estimate.parameters.values()
    ]
    whole = {
        "inercal": __version__,
        "command": estimate.command,
        "status": {"code": estimate.status.value, "message": estimate.message},
        "parameters": parameters,
        "covariance": {
            "names": list(estimate.names),
            "matrix": estimate.covariance,
            **({} if estimate.common is None else {"common": estimate.common}),
        },
        "findings": [finding.to_json() for finding in estimate.findings],
        "statistics": estimate.statistics,
        "budget": [
            {
                **{"source": b.source, "type": b.type, "u": b.u, "unit": b.unit, "share": b.share},
                **({"redrawn": True} if b.redrawn else {}),
            }
            for b in estimate.budget
        ],
        "model": estimate.model,
        "conditions": estimate.conditions,
        "traceability": estimate.traceability,
        "inputs": [{"path": s.path, "sha256": s.sha256} for s in estimate.inputs],
        "timing_s": estimate.timing,
        "provenance": estimate.provenance,
        "references": list(estimate.references),
        "result": estimate.result,
    }
    plain: dict[str, Any] = plain_objects(whole)
    return plain


def _long_name(name: str) -> str:
    """The name of a coefficient in words; empty where the terms do not know it."""
    found = term(name)
    return "" if found is None else found.name


def plain_objects(value: Any) -> Any:
    """Arrays, tuples and mappings as lists and dicts; numbers that are not finite as None.

    In texts, bytes that no encoding knew (as in file names) are written out: they could not be saved. Secrets of
    addresses are hidden.
    """
    match value:
        case Mapping():
            return {plain_objects(str(key)): plain_objects(item) for key, item in value.items()}
        case np.ndarray() | np.generic():
            return plain_objects(value.tolist())
        case list() | tuple():
            return [plain_objects(item) for item in value]
        case float() if not math.isfinite(value):
            return None
        case str():
            return without_secrets(value.encode("utf-8", "backslashreplace").decode("utf-8"))
        case _:
            return value


def from_json(data: Mapping[str, Any]) -> Estimate:
    """The inverse of `to_json`; raises KeyError, TypeError or ValueError where the contract is not met."""
    parameters = data["parameters"]
    covariance = data["covariance"]
    names = tuple(str(p["name"]) for p in parameters)
    if tuple(covariance["names"]) != names:
        raise ValueError("the covariance does not belong to the parameters")
    return Estimate(
        command=str(data["command"]),
        names=names,
        units=tuple(str(p["unit"]) for p in parameters),
        values=np.array([_number(p["value"]) for p in parameters]),
        covariance=_square(covariance["matrix"], len(names)),
        dof=np.array([math.inf if p.get("dof") is None else float(p["dof"]) for p in parameters]),
        status=Status(data["status"]["code"]),
        message=str(data["status"]["message"]),
        findings=tuple(Finding.from_json(finding) for finding in data.get("findings", ())),
        statistics={key: _number(value) for key, value in data.get("statistics", {}).items()},
        budget=tuple(
            BudgetItem(b["source"], b["type"], _number(b["u"]), b["unit"], b["share"], bool(b.get("redrawn")))
            for b in data.get("budget", ())
        ),
        model=data.get("model", ""),
        conditions=dict(data.get("conditions", {})),
        traceability=dict(data.get("traceability", {})),
        inputs=tuple(Source(s["path"], s["sha256"]) for s in data.get("inputs", ())),
        provenance=dict(data.get("provenance", {})),
        timing=dict(data.get("timing_s", {})),
        result=dict(data.get("result", {})),
        references=tuple(data.get("references", ())),
        common=None if "common" not in covariance else _square(covariance["common"], len(names)),
    )


def _square(rows: Any, size: int) -> Array:
    """A square matrix of that size; None is NaN."""
    return np.array(rows, dtype=float).reshape(size, size)


def _number(value: Any) -> float:
    """A float; None is NaN."""
    return math.nan if value is None else float(value)


def save(estimate: Estimate, path: str | Path) -> None:
    """Write the estimate to a ``.json`` or ``.toml`` file, whole or not at all; raises `InputError`."""
    data = to_json(estimate)
    match Path(path).suffix.lower():
        case ".json":
            write_text(path, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
        case ".toml":
            write_text(path, _toml(data))
        case other:
            raise InputError(path, f"found the suffix {other!r}, expected .json or .toml")


def load(path: str | Path) -> Estimate:
    """Read an estimate that `save` wrote; raises `InputError` in one sentence."""
    return parse(input_bytes(path, _EXPECTED), path)


_EXPECTED = "a calibration written by inercal (.json or .toml)"


def parse(content: bytes, path: str | Path) -> Estimate:
    """The estimate in the bytes of a file, TOML where ``path`` ends so; raises `InputError` as `load`."""
    try:
        text = content.decode()
    except UnicodeDecodeError as error:
        raise InputError(path, f"byte {error.start} is not UTF-8 text, expected {_EXPECTED}") from error
    try:
        if Path(path).suffix.lower() == ".toml":
            import tomllib

            data = plain_objects(tomllib.loads(text))
        else:
            data = json.loads(text)
        if not isinstance(data, Mapping):
            raise InputError(path, f"holds {shown(text.strip())}, expected {_EXPECTED}")
        return from_json(data)
    except KeyError as error:
        hint = "; `inercal convert --from` reads those of other tools"
        raise InputError(path, f"the key {error} is missing, expected {_EXPECTED}{hint}") from error
    except json.JSONDecodeError as error:
        raise InputError(path, f"not valid JSON: {error}, expected {_EXPECTED}") from error
    except (TypeError, AttributeError) as error:
        raise InputError(path, f"does not have the form of one, expected {_EXPECTED}") from error
    except (ValueError, OverflowError, RecursionError) as error:
        raise InputError(path, f"{str(error)[:120]}, expected {_EXPECTED}") from error


def _toml(table: Mapping[str, Any], path: tuple[str, ...] = ()) -> str:
    """A TOML document of nested tables; None is nan, lest lists get shorter and keys get lost."""
    plain = {k: v for k, v in table.items() if not isinstance(v, Mapping)}
    lines = [f"{_key(key)} = {_value(value)}" for key, value in plain.items()]
    if path and (lines or not table):
        lines.insert(0, f"\n[{'.'.join(map(_key, path))}]")
    inner = [_toml(v, (*path, k)) for k, v in table.items() if isinstance(v, Mapping)]
    return "\n".join([*lines, *(text.rstrip("\n") for text in inner)]) + "\n"


def _key(key: str) -> str:
    """A TOML key, quoted where it must be."""
    return key if key.replace("_", "").replace("-", "").isalnum() and key.isascii() else _value(key)


def _value(value: Any) -> str:
    """A TOML value on one line; a list of tables as inline tables."""
    match value:
        case Mapping():
            items = (f"{_key(key)} = {_value(item)}" for key, item in value.items())
            return "{ " + ", ".join(items) + " }"
        case list():
            return "[" + ", ".join(map(_value, value)) + "]"
        case None:
            return "nan"
        case bool():
            return "true" if value else "false"
        case str():
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case _:
            return repr(value)
