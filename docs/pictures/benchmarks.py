"""Puts one run of the benchmarks into the book: its picture into this folder, its tables into the page on benchmarks.

    python docs/pictures/benchmarks.py build/bench

The pictures of measured times are not drawn anew by the tests, which would find other times.
"""

import re
import sys
from pathlib import Path

HERE, RUN = Path(__file__).parent, Path(sys.argv[1])
PAGE = HERE.parent / "design" / "benchmarks.md"

tables = (RUN / "results.md").read_text(encoding="utf-8").partition("\n")[2].strip()
page = PAGE.read_text(encoding="utf-8")
parts = re.split(r"(<!-- (?:begin|end) of the run -->\n)", page)
parts[2] = f"\n{tables.replace('## ', '### ')}\n\n"
PAGE.write_text("".join(parts), encoding="utf-8")
(HERE / "benchmarks-cost.svg").write_text((RUN / "cost.svg").read_text(encoding="utf-8"), encoding="utf-8")
