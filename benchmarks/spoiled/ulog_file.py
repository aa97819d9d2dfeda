"""ULog files of PX4, written as its page on the format says."""

import struct


def part(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def log(topics):
    """A file of topics: (name, instance, fields, rows); fields are (type, name), rows are tuples of their values."""
    kinds = {"uint64_t": "Q", "float": "f", "double": "d", "float[3]": "3f", "uint8_t": "B"}
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000), part("B", bytes(40))]
    for name, fields in {name: fields for name, _, fields, _ in topics}.items():
        text = f"{name}:" + "".join(f"{kind} {field};" for kind, field in fields)
        out.append(part("F", text.encode()))
    for number, (name, instance, _, _) in enumerate(topics):
        out.append(part("A", struct.pack("<BH", instance, number) + name.encode()))
    for number, (_, _, fields, rows) in enumerate(topics):
        layout = "<H" + "".join(kinds[kind] for kind, _ in fields)
        out += [part("D", struct.pack(layout, number, *row)) for row in rows]
    return b"".join(out)
