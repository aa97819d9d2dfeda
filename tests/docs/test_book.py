"""The book is whole: it builds without a warning, holds every page, and needs no network to be read.

What is checked is the built HTML itself: pages, links and anchors, formulas, and everything a browser would load.
"""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import pytest

from inercal.cli.tree import COMMANDS
from inercal.foundation.findings import CODES
from inercal.foundation.instruments.terms import NOISE_TERMS, TERMS
from inercal.foundation.records.channels import _EXAMPLES
from inercal.systems.aoa import limits as aoa
from inercal.systems.aoa.paper import limits as paper
from inercal.systems.imu import limits as imu
from inercal.systems.selfcal import limits as selfcal
from inercal.systems.strapdown import limits as strapdown
from inercal.systems.turntable import limits as turntable

ROOT = Path(__file__).parents[2]
VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
#: elements whose text is not prose
LITERAL = {"code", "pre", "script", "style", "kbd", "samp", "svg"}
#: attributes by which a browser loads something, not merely offers a link to it
LOADS = {
    ("img", "src"),
    ("script", "src"),
    ("link", "href"),
    ("iframe", "src"),
    ("source", "src"),
    ("use", "href"),
}


class Page(HTMLParser):
    """Anchors, links, what is loaded, prose and formulas of one page of the book."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.prose = ""
        self.formulas: list[str] = []
        self._open: list[tuple[str, bool]] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.anchors |= {given["id"]} if given.get("id") else set()
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "link" and given.get("rel") in ("index", "search", "next", "prev", "canonical"):
            return
        self.loads += [value for name, value in attrs if (tag, name) in LOADS and value]
        if tag not in VOID:
            formula = "math" in (given.get("class") or "").split()
            if formula:
                self.formulas.append("")
            self._open.append((tag, formula))

    def handle_endtag(self, tag):
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data):
        if any(formula for _, formula in self._open):
            self.formulas[-1] += data
        elif not any(tag in LITERAL for tag, _ in self._open):
            self.prose += data


#: `python -m sphinx`, a third faster: trees of pages are no garbage before the end
SPHINX = "import gc, sys; gc.disable(); from sphinx.cmd.build import main; sys.exit(main(sys.argv[1:]))"


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    """The folder of the built book; a warning is an error."""
    out = tmp_path_factory.mktemp("book")
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            SPHINX,
            "-b",
            "html",
            "-W",
            "-q",
            "-d",
            out / "doctrees",
            ROOT / "docs",
            out / "html",
        ],
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return out / "html"


@pytest.fixture(scope="module")
def pages(book):
    """Every page of the book by its path, without its ending."""
    files = sorted(file for file in book.rglob("*.html") if "_static" not in file.parts)
    return {file.relative_to(book).with_suffix("").as_posix(): Page(file) for file in files}


@pytest.mark.slow
def test_every_page_is_in_the_book_and_can_be_reached_from_the_front(pages):
    written = {
        file.relative_to(ROOT / "docs").with_suffix("").as_posix()
        for file in ROOT.glob("docs/**/*.md")
        if file.parent.name != "paper"  # a journal sets it
    }
    assert written == pages.keys() - {"genindex", "py-modindex", "search"}
    reached, ahead = set(), ["index"]
    while ahead:
        name = ahead.pop()
        if name in reached or name not in pages:
            continue
        reached.add(name)
        ahead += [target for target, _ in targets(name, pages[name])]
    assert written <= reached


def targets(name, page):
    """Pages and anchors that a page links to within the book."""
    for link in page.links:
        if "://" in link or link.startswith("mailto:"):
            continue
        path, _, anchor = link.partition("#")
        whole = (Path("/") / name).parent.joinpath(unquote(path)).as_posix() if path else f"/{name}.html"
        parts: list[str] = []
        for part in whole.strip("/").split("/"):
            parts = parts[:-1] if part == ".." else [*parts, part]
        yield "/".join(parts).removesuffix(".html"), unquote(anchor)


@pytest.mark.slow
def test_every_link_and_anchor_leads_somewhere(book, pages):
    for name, page in pages.items():
        for target, anchor in targets(name, page):
            if target in pages:
                assert not anchor or anchor in pages[target].anchors, f"{name} links to {target}#{anchor}"
            else:
                assert (book / target).is_file(), f"{name} links to {target}"


@pytest.mark.slow
def test_nothing_is_loaded_from_a_network(book, pages):
    for name, page in pages.items():
        for load in (each for each in page.loads if not each.startswith("#")):
            assert not re.match(r"(\w+:)?//", load), f"{name} loads {load}"
            found = (book / name).parent / unquote(load.partition("?")[0])
            assert load.startswith("data:") or found.is_file(), f"{name} loads {load}, which is not there"
    for style in book.rglob("*.css"):
        for address in re.findall(
            r"url\(['\"]?([^'\")]+)|@import\s+['\"]([^'\"]+)", style.read_text("utf-8")
        ):
            assert not re.match(r"(https?:)?//", "".join(address)), f"{style.name} loads {address}"


@pytest.mark.slow
def test_every_formula_is_set(pages):
    assert len([1 for page in pages.values() for _ in page.formulas]) > 80
    for name, page in pages.items():
        assert "$" not in page.prose, f"{name}: {page.prose[page.prose.index('$') - 60 :][:120]!r}"
        for formula in page.formulas:
            assert re.fullmatch(r"\\[(\[].*\\[)\]]", formula.strip(), re.DOTALL), f"{name}: {formula!r}"
            assert formula.count("{") == formula.count("}"), f"{name}: {formula!r}"


@pytest.mark.slow
def test_the_reference_has_every_command_term_code_channel_and_limit(book):
    text = {
        page: (book / "reference" / f"{page}.html").read_text(encoding="utf-8")
        for page in ("commands", "results", "records", "limits")
    }
    wanted = {
        "commands": [f"<h2>{' '.join(words).strip()}<" for words in COMMANDS],
        "results": [f">{name}</span>" for name in [*TERMS, *NOISE_TERMS, *CODES]],
        "records": [f">{name}</span>" for name in _EXAMPLES if not re.fullmatch(r"a[34]", name)],
        "limits": [
            f">{name}</span>"
            for module in (aoa, paper, imu, selfcal, strapdown, turntable)
            for name in vars(module.LIMITS)
        ],
    }
    for page, names in wanted.items():
        assert [name for name in names if name not in text[page]] == [], page
    assert "&lt;!-- generated" not in "".join(text.values())
