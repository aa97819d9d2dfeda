"""One of the two processes of `build.py`: compiles its half of the entries into an object.

python kernels/compile.py PART FOLDER
"""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import time
import typing
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from numba.core import types

from build import MOST_RETURNED, TABLE, Code, symbol
from inercal.foundation import _jit

_jit.cache_folder = lambda: None  # code from numba's cache has no LLVM to go on with

DTYPES = {
    "d": types.float64,
    "q": types.int64,
    "w": types.int32,
    "Q": types.uint64,
    "B": types.uint8,
    "?": types.boolean,
}
SCALARS = {"f": types.float64, "i": types.int64, "b": types.boolean}

PICKLED = re.compile(r"@\.const\.picklebuf[\w.]*")

FIRST = "inercal.systems.selfcal."
"""Rooms of the first process, which take as long as all others."""


def numba_types(signature: str, hints: list[Any]) -> tuple[types.Type, ...]:
    """Types of arguments as numba has them; a tuple that the annotation calls a NamedTuple is that one."""
    letters = iter(re.findall(r"[dqwQB?]\d[FA]?R?|.", signature))
    found = _until(letters, hints)
    return tuple(found)


def _until(letters: Any, hints: list[Any]) -> list[types.Type]:
    """Types up to a closing bracket, or the end."""
    found: list[types.Type] = []
    for letter in letters:
        if letter == ")":
            break
        hint = hints[len(found)] if len(found) < len(hints) else None
        found.append(_tuple(letters, hint) if letter == "(" else _one(letter))
    return found


def _one(letter: str) -> types.Type:
    """Type of a number or an array."""
    if letter in SCALARS:
        return SCALARS[letter]
    layout = next((each for each in "FA" if each in letter), "C")
    return types.Array(DTYPES[letter[0]], int(letter[1]), layout, readonly=letter.endswith("R"))


def _tuple(letters: Any, hint: Any) -> types.Type:
    """Type of a tuple."""
    named = hint if hasattr(hint, "_fields") else None
    if named is None and typing.get_origin(hint) is not tuple:  # a union: that of a tuple, if any
        hint = next((each for each in typing.get_args(hint) if typing.get_origin(each) is tuple), None)
    within = list(typing.get_type_hints(named).values()) if named else list(typing.get_args(hint))
    if len(within) == 2 and within[1] is Ellipsis:
        within = []
    members = _until(letters, within)
    if named is None:
        return types.Tuple(members)
    if len(set(members)) == 1:
        return types.NamedUniTuple(members[0], len(members), named)
    return types.NamedTuple(members, named)


def result_of(kind: types.Type) -> str:
    """Letters of what a kernel returns: numbers, or tuples of them."""
    if isinstance(kind, types.BaseTuple):
        return "(" + "".join(map(result_of, kind.types)) + ")"
    if isinstance(kind, types.NoneType):
        return "n"
    letters = {types.Float: "f", types.Boolean: "b", types.Integer: "i"}
    found = next((letter for of, letter in letters.items() if isinstance(kind, of)), "")
    if not found or (found != "b" and kind.bitwidth != 64):
        raise TypeError(
            f"a kernel that Python calls returns {kind}, expected numbers of 64 bits, or tuples of them"
        )
    return found


def without_exceptions(text: str) -> str:
    """LLVM without the exceptions that numba would make of a status, and the paths of files in them: the status says
    all that is needed."""
    return re.sub(
        r"^(?!@).*@\.const\.picklebuf.*$", lambda line: PICKLED.sub("null", line[0]), text, flags=re.MULTILINE
    )


def caller(name: str, native: str, arguments: list[str]) -> str:
    """LLVM of a function (words of the arguments, room for the result) that calls a kernel as numba does."""
    lines = [f"define i32 @{name}(ptr %words, ptr %result) {{", "  %exception = alloca ptr"]
    given = ["ptr %result", "ptr %exception"]
    for k, kind in enumerate(arguments):
        lines.append(f"  %p{k} = getelementptr i64, ptr %words, i64 {k}")
        if kind in ("i8", "i1", "i32"):
            lines += [f"  %w{k} = load i64, ptr %p{k}", f"  %a{k} = trunc i64 %w{k} to {kind}"]
        else:
            lines.append(f"  %a{k} = load {kind}, ptr %p{k}")
        given.append(f"{kind} %a{k}")
    lines += [f'  %status = call i32 @"{native}"({", ".join(given)})', "  ret i32 %status", "}"]
    declared = "".join(f", {kind}" for kind in arguments)
    return f'declare i32 @"{native}"(ptr, ptr{declared})\n' + "\n".join(lines) + "\n"


def compiled(name: str, signature: str) -> tuple[Code, Any]:
    """One signature, and its LLVM module, in which the caller alone can be seen."""
    module, function = name.rsplit(".", 1)
    dispatcher = getattr(importlib.import_module(module), function)
    hints = typing.get_type_hints(dispatcher.py_func)
    kinds = numba_types(signature, [hint for argument, hint in hints.items() if argument != "return"])
    dispatcher.compile(kinds)
    made = dispatcher.overloads[kinds]
    native = made.fndesc.llvm_func_name
    part = llvm.parse_assembly(without_exceptions(made.library.get_llvm_str()))
    code = part.get_function(native)
    arguments = [str(argument.type) for argument in code.arguments][2:]
    code.linkage = "linkonce_odr"  # seen until it is linked
    part.link_in(llvm.parse_assembly(caller(symbol(name, signature), native, arguments)))
    for each in (*part.functions, *part.global_variables):
        if not each.is_declaration and each.name != symbol(name, signature):
            each.linkage = "internal"
    result = result_of(made.signature.return_type)
    numbers = result.strip("()")
    if len(numbers) > MOST_RETURNED or ("b" in numbers and numbers != "b"):
        raise TypeError(
            f"{name} returns {result}, expected at most {MOST_RETURNED} numbers, and no bool among others"
        )
    arrays = len(re.findall(r"[dqwQB?]\d", signature))
    return Code(name, signature, result, len(arguments), arrays), part


def emitted(module: Any) -> bytes:
    """The object of a module, without what nobody calls."""
    target = llvm.Target.from_default_triple()
    machine = target.create_target_machine(
        cpu=os.environ["NUMBA_CPU_NAME"], features="", opt=3, reloc="pic", codemodel="default"
    )
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2)))
    return typing.cast(bytes, machine.emit_object(module))


def main(part: int, folder: Path) -> None:
    """Compile the half of the entries that is this process's."""
    table = json.loads(TABLE.read_text())
    names = [name for name in table if name.startswith(FIRST) == (part == 0)]
    rows, whole = [], None
    for k, name in enumerate(names):
        began = time.process_time()
        for signature in table[name]:
            row, module = compiled(name, signature)
            rows.append(row)
            if whole is None:
                whole = module
            else:
                whole.link_in(module)
        print(
            f"{k + 1:3} of {len(names)}{time.process_time() - began:6.1f} s  {name}",
            file=sys.stderr,
            flush=True,
        )
    (folder / f"part-{part}.o").write_bytes(emitted(whole))
    (folder / f"part-{part}.json").write_text(json.dumps(rows))


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]))
