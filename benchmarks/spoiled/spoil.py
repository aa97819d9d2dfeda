"""Accidents and lies: what is done to a whole file, with its structure known."""

import gzip
import io
import json
import re
import struct
import zipfile
import zlib

import numpy as np

#: numbers that a field may lie with
LIES = (0, 1, 2, 7, 8, 60, 61, 127, 128, 255, 256, 65535, 1 << 16, 1 << 20, (1 << 31) - 1, 1 << 31, (1 << 32) - 1,
        1 << 40, (1 << 63) - 1, 1 << 63, (1 << 64) - 1)  # fmt: skip

#: marks of the parts of a format, behind which its fields stand
MARKS = re.compile(
    rb"\x89HDF|OHDR|OCHK|TREE|SNOD|HEAP|GCOL|FRHP|FHDB|BTHD|BTLF|EAHD|FAHD|FADB|CDF|PAR1|TDSm|MCAP|MATLAB|"
    rb"\x0e\x00\x00\x00|\x0f\x00\x00\x00|\x06\x00\x00\x00|#ROSBAG|op=|conn=|SQLite|NUMPY|PK\x01\x02|PK\x03\x04|"
    rb"\x69\x12\x00\x00|acc_x|gyro_x|units|DIMENSION_LIST"
)

#: words that a text may have in the place of one of its own
TOKENS = ("", "nan", "inf", "-inf", "1e400", "-0", "0x10", "1_000", "1e5", "1.000", "1,5", "1.5", "--1", "+", ".", "1e",
          "9" * 400, "0" * 5000 + "1", "1" * 5000, '"', '"1"', "'", "#", "%", "\0", "\r", "\x1b[2J", "é", "١", "½",
          "t [s]", "acc_x [g]", "acc_x [mm/s^2]", "acc_x", "[", "]", "[[", "{", "}", "=", "true", "null", "[]", "{}",
          "2024-01-01", " ", "\t", ";", ",", "\n", "\n\n", "\r\n", "1e-400", "123456789012345678901")  # fmt: skip


def spoiled(rng, name, content):
    """The content of a file after one to three accidents, inside of its packing or outside."""
    for _ in range(rng.choice([1, 1, 2, 3])):
        content = _once(rng, name, content)
    return content


def _once(rng, name, content):
    inside = rng.random() < 0.5
    try:
        if name == "csv.gz" and inside:
            return gzip.compress(_text(rng, gzip.decompress(content)), mtime=0)
        if name.startswith("npz") and inside:
            return _archive(rng, content)
        if name == "mat v7" and inside:
            return _elements(rng, content)
        if name == "result, JSON" and inside:
            return _tree(rng, content)
    except Exception:  # spoiled before
        return _bytes(rng, content)
    if name.startswith(("csv,", "text", "result", "map", "yaml", "xml")) or name == "csv":
        return _text(rng, content) if rng.random() < 0.8 else _bytes(rng, content)
    return _bytes(rng, content)


def _bytes(rng, content):
    """A lie in a field, or a stretch of bytes lost, doubled, moved or overwritten."""
    if not content:
        return bytes(rng.integers(0, 256, 8, dtype=np.uint8))
    data, size = bytearray(content), len(content)
    at = int(rng.integers(0, size))
    if rng.random() < 0.6 and (marks := [match.start() for match in MARKS.finditer(content)]):
        at = min(size - 1, marks[int(rng.integers(0, len(marks)))] + int(rng.integers(0, 48)))
    length = int(rng.choice([1, 1, 2, 4, 8, 16, 100]))
    match rng.integers(0, 9):
        case 0 | 1 | 2:
            width, order = rng.choice([1, 2, 4, 8]), rng.choice(["<", ">"])
            lie = int(LIES[int(rng.integers(0, len(LIES)))])
            lie = (
                lie
                if rng.random() < 0.7
                else int.from_bytes(data[at : at + width], "little") + int(rng.integers(-2, 3))
            )
            letter = {1: "B", 2: "H", 4: "I", 8: "Q"}[int(width)]
            data[at : at + width] = struct.pack(f"{order}{letter}", lie % (1 << 8 * int(width)))
        case 3:
            data[at] ^= 1 << int(rng.integers(0, 8))
        case 4:
            del data[at : at + length]
        case 5:
            data[at:at] = (
                bytes(rng.integers(0, 256, length, dtype=np.uint8)) if rng.random() < 0.5 else bytes(length)
            )
        case 6:
            del data[at:]
        case 7:
            other = int(rng.integers(0, size))
            data[at : at + length] = content[other : other + length]
        case 8:
            data[at:at] = content[at : at + length]
    return bytes(data)


def _text(rng, content):
    """A word, a line or a mark that is another."""
    text = content.decode("latin-1")
    words = list(re.finditer(r"[^\s,;=\[\]{}:]+", text)) or [re.match("", text)]
    word = words[int(rng.integers(0, len(words)))]
    token = TOKENS[int(rng.integers(0, len(TOKENS)))]
    lines = text.split("\n")
    at = int(rng.integers(0, len(lines)))
    match rng.integers(0, 8):
        case 0 | 1 | 2:
            text = text[: word.start()] + token + text[word.end() :]
        case 3:
            text = text[: word.end()] + token + text[word.end() :]
        case 4:
            text = "\n".join(lines[:at] + lines[at + 1 :])
        case 5:
            text = "\n".join([*lines[:at], lines[at] * 2, *lines[at:]])
        case 6:
            text = text[: int(rng.integers(0, len(text) + 1))]
        case 7:
            old, new = ((",", ";"), (".", ","), ("\n", "\r"), ("\n", ""), (" ", ""), ("[", ""))[
                int(rng.integers(0, 6))
            ]
            text = text.replace(old, new, int(rng.choice([1, 1000000])))
    return text.encode("latin-1", "replace") if max(text, default="a") < "\u0100" else text.encode()


def _archive(rng, content):
    """A member of an archive spoiled, its checksum right again."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as old,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        names = old.namelist()
        chosen = names[int(rng.integers(0, len(names)))]
        for name in names:
            data = old.read(name)
            if name == chosen:
                data = _text(rng, data[:128]) + data[128:] if rng.random() < 0.5 else _bytes(rng, data)
            new.writestr(name, data)
    return buffer.getvalue()


def _elements(rng, content):
    """A compressed element of a MAT file spoiled inside."""
    places, at = [], 128
    while at + 8 < len(content):
        kind, size = struct.unpack_from("<II", content, at)
        if kind == 15:
            places.append((at, size))
        at += 8 + size
    at, size = places[int(rng.integers(0, len(places)))]
    packed = zlib.compress(_bytes(rng, zlib.decompress(content[at + 8 : at + 8 + size])))
    return content[:at] + struct.pack("<II", 15, len(packed)) + packed + content[at + 8 + size :]


def _tree(rng, content):
    """A value in a tree of JSON replaced, removed or wrapped."""
    tree = json.loads(content)
    node = tree
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            break
        key = keys[int(rng.integers(0, len(keys)))]
        if isinstance(node[key], dict | list) and rng.random() < 0.7:
            node = node[key]
            continue
        others = (None, True, -1, 1e300, "x", "\x1b]0;x\x07", [], {}, [[1]], int("9" * 400), [1] * 3)
        match rng.integers(0, 4):
            case 0:
                del node[key]
            case 1:
                for _ in range(int(rng.choice([1, 2000]))):
                    node[key] = [node[key]]
            case _:
                node[key] = others[int(rng.integers(0, len(others)))]
        break
    try:
        return json.dumps(tree).encode()
    except (ValueError, RecursionError):
        return b"[" * 100_000
