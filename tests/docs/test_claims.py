"""The README claims nothing that is not shown: each sentence is quoted on a page that names what shows it.

Phrases are compared as they are read: without links, emphasis and line ends. What is named is looked for in the
sources, and nothing is imported.
"""

import ast
import re
from functools import cache
from pathlib import Path

from rows import for_each

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "claims.md"
#: sections that say what to type, and what the project is for
NO_CLAIMS = {"Try it", "Goals and non-goals"}
#: sentences that claim nothing, by their first words: for whom it is, what to do, and links
SILENT = (
    "New here:",
    "For inertial-test engineers",
    "Lay the IMU on each",
    "Then",
    "Or, to look over",
    "says what it took for what",
    "And around it:",
    "Tutorials:",
    "How to:",
    "Design notes:",
    "CHANGES, CONTRIBUTING",
    "so that inercal is found",
)


def read(text: str) -> str:
    """Markdown as it is read: links by their words, no emphasis, white space folded."""
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return " ".join(re.sub(r"[*`]", "", text).split())


def sections(page: Path) -> dict[str, str]:
    """Heading -> text up to the next one; a comment in a block of commands is no heading."""
    parts = re.split(r"^#{1,2} (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def sentences(section: str) -> list[str]:
    """Sentences of prose and list items, and what is said behind commands; bold words before an item are its title."""
    comments = re.findall(r"^ {4}.* # (.+)$", section, re.MULTILINE)
    prose = re.sub(r"^```(?s:.*?)^```|^ {4}\S.*$|^!\[.*$", "\n", section, flags=re.MULTILINE)
    prose = re.sub(r"^- (\*\*.*?\*\*)?", "\n\n", prose, flags=re.MULTILINE)
    each = re.split(r"\n\s*\n|(?<=[.?!])\s+(?=[A-Z`(\[])", prose)
    return [said for said in map(read, [*each, *comments]) if said]


def rows(section: str) -> list[tuple[list[str], str]]:
    """Phrases and evidence of each row of a table."""
    cells = re.findall(r"^\| (“.+?) \| (.+?) \|", section, re.MULTILINE)
    return [([read(phrase) for phrase in re.findall("“(.+?)”", said)], shown) for said, shown in cells]


README = sections(ROOT / "README.md")
CLAIMS = {heading: rows(text) for heading, text in sections(PAGE).items()}
QUOTED = {heading: [phrase for phrases, _ in of for phrase in phrases] for heading, of in CLAIMS.items()}
WITH_CLAIMS = [heading for heading in README if heading not in NO_CLAIMS]


@cache
def names_in(path: str) -> set[str]:
    """Tests of a file as pytest names them."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    found = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    for group in tree.body:
        if isinstance(group, ast.ClassDef):
            found |= {
                f"{group.name}::{node.name}" for node in group.body if isinstance(node, ast.FunctionDef)
            }
    return found


def test_every_section_of_claims_is_one_of_the_readme():
    assert [heading for heading, of in CLAIMS.items() if of] == WITH_CLAIMS


@for_each("heading", WITH_CLAIMS)
def test_what_is_quoted_stands_in_the_readme(heading):
    text = read(README[heading])
    assert [phrase for phrase in QUOTED[heading] if phrase not in text] == []


@for_each("heading", WITH_CLAIMS)
def test_no_sentence_is_left_out(heading):
    left = [
        said for said in sentences(README[heading]) if not any(phrase in said for phrase in QUOTED[heading])
    ]
    assert [said for said in left if not said.startswith(SILENT)] == []


def test_sentences_that_claim_nothing_are_still_there():
    every = [said for heading in WITH_CLAIMS for said in sentences(README[heading])]
    assert [start for start in SILENT if not any(said.startswith(start) for said in every)] == []


@for_each("heading", WITH_CLAIMS)
def test_what_is_named_exists(heading):
    for phrases, shown in CLAIMS[heading]:
        tests = re.findall(r"`(tests/[\w/]+\.py)::([\w:]+)`", shown)
        benchmarks = re.findall(r"`(benchmarks/\w+\.py)`", shown)
        pages = re.findall(r"\]\(([\w/-]+\.md)\)", shown)
        assert tests or benchmarks or pages, f"nothing shows {phrases}"
        assert len(tests) + len(benchmarks) == shown.count("`") // 2, shown
        for path, name in tests:
            assert name in names_in(path), f"{path} has no {name}"
        for path in [*(ROOT / each for each in benchmarks), *(PAGE.parent / each for each in pages)]:
            assert path.is_file(), f"there is no {path}"


def test_sentences_are_told_apart():
    """The reading itself: links, titles of items, comments behind commands, blocks of code."""
    text = """
![A picture. Of it](a.svg)

It is [well
known](page.md) that `x` works. And this. `y` too (see
below).

    run x                # what it does
    run y

- **Fast.** One. Two: three.

```python
z = 1  # no claim
```
"""
    assert sentences(text) == [
        "It is well known that x works.",
        "And this.",
        "y too (see below).",
        "One.",
        "Two: three.",
        "what it does",
    ]
