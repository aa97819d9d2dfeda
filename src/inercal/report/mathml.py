"""Equations set as MathML, from the plain text in which a model is stated.

The text mixes equations and words: ``y = S M f + b, f the specific force (+g up at rest)``. Letters, names with a
subscript, Greek letters and what stands beside an operator are mathematics; all else is words and stays as it is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape

from inercal.report.style import plain_unit

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "theta": "θ", "lambda": "λ", "omega": "ω",
    "phi": "φ", "pi": "π", "psi": "ψ", "sigma": "σ", "tau": "τ", "chi2": "χ²",
}  # fmt: skip

# fmt: off
_NOT_NAMES = frozenset((
    "a", "all", "an", "and", "are", "as", "at", "by", "each", "for", "from", "holds", "in", "is", "its", "less", "of",
    "on", "or", "over", "per", "that", "the", "then", "to", "twice", "where", "with",
))
# fmt: on
"""Words that stay words beside an operator."""

_FUNCTIONS = ("cos", "sin", "ln", "sqrt")
_OPERATORS = "=+-/^"
_THIN = "<mspace width='0.17em'/>"

_TOKEN = re.compile(
    r"(?P<unit>\[(?:deg|rad|m|s|g|ug|mg|Hz|degC)(?:/\w+(?:\^\d)?)?\])"
    r"|(?P<prose>[^\W\d_]+(?:(?:-[^\W\d_]{3,})+|'s\b))"
    r"|(?P<name>[^\W\d_]\w*(?:'(?!\w))?)"
    r"|(?P<number>\d+(?:\.\d+)?(?:e-?\d+)?)"
    r"|(?P<sign>[-+=/^()\[\]|])"
    r"|(?P<comma>,(?=\s))"
    r"|(?P<other>\S)"
)


@dataclass(frozen=True)
class _Token:
    """A piece of the text, where it lies, and the space before it."""

    kind: str
    text: str
    space: str


def clauses(text: str) -> list[str]:
    """The statements of a model as HTML, one for each clause that ends in a semicolon, its equations in MathML."""
    parts, depth, start = [], 0, 0
    for k, letter in enumerate(text):
        depth += (letter in "([") - (letter in ")]")
        if letter == ";" and depth <= 0:
            parts.append(text[start:k].strip())
            start = k + 1
    names = _named(_tokens(text))
    return [_clause(_tokens(part), names) for part in [*parts, text[start:].strip()] if part]


def _tokens(text: str) -> list[_Token]:
    """The pieces of a text."""
    tokens, end = [], 0
    for match in _TOKEN.finditer(text):
        tokens.append(_Token(match.lastgroup or "other", match.group(), text[end : match.start()]))
        end = match.end()
    return tokens


def _named(tokens: list[_Token]) -> frozenset[str]:
    """Words that somewhere stand beside an operator: they name quantities."""
    words = set()
    for k, token in enumerate(tokens):
        if token.kind != "name" or token.text.lower() in _NOT_NAMES:
            continue
        before, after = (tokens[k - 1] if k else None), (tokens[k + 1] if k + 1 < len(tokens) else None)
        left = before is not None and before.kind == "sign" and before.text in _OPERATORS
        right = after is not None and after.kind == "sign" and after.text in _OPERATORS
        if right and k + 2 < len(tokens):  # "slope -1/2": a sign, no difference
            right = not (tokens[k + 1].space and not tokens[k + 2].space)
        call = after is not None and after.text == "(" and not after.space
        if left or right or call:
            words.add(token.text)
    return frozenset(words)


def _is_symbol(token: _Token, names: frozenset[str]) -> bool:
    """True for a name that is mathematics wherever it stands."""
    text = token.text.rstrip("'")
    if token.kind != "name" or text.lower() in _NOT_NAMES - {"a"}:
        return False
    subscripted = "_" in text or bool(re.fullmatch(r"[A-Za-z]\d+", text))
    return subscripted or text in _GREEK or text in names or (len(text) == 1 and text not in "aI")


def _clause(tokens: list[_Token], names: frozenset[str]) -> str:
    """Words and equations of one clause as HTML."""
    html, k = "", 0
    while k < len(tokens):
        end = _run(tokens, k, names)
        if end > k:
            inside = _Row(tokens[k:end], names).whole()
            html += f"{tokens[k].space}<math>{inside}</math>"
            k = end
        else:
            html += escape(tokens[k].space + plain_unit(tokens[k].text))
            k += 1
    return html.strip()


def _run(tokens: list[_Token], start: int, names: frozenset[str]) -> int:
    """The end of the mathematics that begins at ``start``, or ``start`` where none begins."""
    k, last, symbols, depth = start, start, 0, 0
    while k < len(tokens):
        token = tokens[k]
        opens = token.text in ("(", "[") and token.kind == "sign"
        if opens:
            close = _closing(tokens, k)
            called = k > start and tokens[k - 1].kind == "name" and not token.space
            if close is None or not (called or _mathematical(tokens[k + 1 : close], names)):
                break
            k, last, symbols = close + 1, close + 1, symbols + 1
            continue
        if _is_symbol(token, names) or (token.text == "a" and _beside(tokens, k)):
            symbols, last = symbols + 1, k + 1
        elif token.kind == "number" or token.text in _FUNCTIONS:
            last = k + 1
        elif token.kind == "sign" and token.text == "|":
            depth, last = 1 - depth, k + 1
        elif token.kind != "sign" or token.text in (")", "]"):
            break
        k += 1
    if not symbols or depth:
        return start
    alone = tokens[start:last]
    of_number = (
        alone[1:]
        if alone[0].kind == "number"
        else alone
        if start and tokens[start - 1].kind == "number"
        else []
    )
    unit = len(of_number) == 1 and len(of_number[0].text) == 1
    return start if unit else last


def _beside(tokens: list[_Token], k: int) -> bool:
    """True where an operator or a bracket stands beside a token."""
    around = [tokens[j] for j in (k - 1, k + 1) if 0 <= j < len(tokens)]
    return any(each.kind == "sign" for each in around)


def _closing(tokens: list[_Token], start: int) -> int | None:
    """The bracket that closes the one at ``start``."""
    depth = 0
    for k in range(start, len(tokens)):
        if tokens[k].kind == "sign":
            depth += (tokens[k].text in "([") - (tokens[k].text in ")]")
            if depth == 0:
                return k
    return None


def _mathematical(tokens: list[_Token], names: frozenset[str]) -> bool:
    """True where nothing but mathematics stands between two brackets."""
    return bool(tokens) and all(
        token.kind in ("number", "sign", "comma")
        or _is_symbol(token, names)
        or token.text in ("a", *_FUNCTIONS)
        for token in tokens
    )


class _Row:
    """A run of mathematics, read from left to right."""

    def __init__(self, tokens: list[_Token], names: frozenset[str]) -> None:
        self.tokens, self.names, self.k = tokens, names, 0

    def whole(self) -> str:
        """All of it, as the content of ``math``."""
        done = ""
        while self.k < len(self.tokens):
            done += self._term() or self._sign()
        return done

    def _sign(self) -> str:
        """An operator, or whatever is left over, as it is."""
        text = self.tokens[self.k].text
        self.k += 1
        return f"<mo>{escape(text.replace('-', '−'))}</mo>"

    def _term(self) -> str:
        """Factors side by side; what stands before a slash is over what follows it."""
        factors: list[str] = []
        while self.k < len(self.tokens):
            token = self.tokens[self.k]
            if token.text == "/" and factors:
                self.k += 1
                over = self._factor()
                factors = [
                    f"<mfrac displaystyle='true'><mrow>{''.join(factors)}</mrow><mrow>{over}</mrow></mfrac>"
                ]
                continue
            factor = self._factor()
            if not factor:
                break
            factors.append((_THIN if factors else "") + factor)
        return "".join(factors)

    def _factor(self) -> str:
        """A symbol, a number or a bracket, with its power."""
        if self.k == len(self.tokens):
            return ""
        token = self.tokens[self.k]
        sub = ""
        if token.kind == "number":
            self.k += 1
            base = f"<mn>{token.text}</mn>"
        elif token.text in ("(", "[") and token.kind == "sign":
            base = self._bracket()
        elif token.text == "|" and self._closes():
            base = self._size()
        elif token.kind == "name":
            self.k += 1
            base, sub = _symbol(token.text)
        else:
            return ""
        power = self._power()
        if sub and power:
            base = f"<msubsup>{base}<mrow>{sub}</mrow><mrow>{power}</mrow></msubsup>"
        elif sub or power:
            tag = "msub" if sub else "msup"
            base = f"<{tag}>{base}<mrow>{sub or power}</mrow></{tag}>"
        called = (
            self.k < len(self.tokens) and self.tokens[self.k].text == "(" and not self.tokens[self.k].space
        )
        return base + (self._bracket() if called and token.kind == "name" else "")

    def _power(self) -> str:
        """The exponent after a circumflex: a number with or without its sign, or a symbol."""
        if self.k + 1 >= len(self.tokens) or self.tokens[self.k].text != "^":
            return ""
        self.k += 1
        minus = self.tokens[self.k].text == "-"
        self.k += minus
        if self.k == len(self.tokens):
            return ""
        token = self.tokens[self.k]
        self.k += 1
        base = _symbol(token.text)[0] if token.kind == "name" else f"<mn>{escape(token.text)}</mn>"
        return ("<mo>−</mo>" if minus else "") + base

    def _closes(self) -> bool:
        """True where a second bar follows."""
        return any(token.text == "|" for token in self.tokens[self.k + 1 :])

    def _size(self) -> str:
        """The expression between two bars."""
        end = next(j for j in range(self.k + 1, len(self.tokens)) if self.tokens[j].text == "|")
        inside = _Row(self.tokens[self.k + 1 : end], self.names).whole()
        self.k = end + 1
        return f"<mrow><mo>|</mo>{inside}<mo>|</mo></mrow>"

    def _bracket(self) -> str:
        """The content of brackets: a matrix, a row, words, or mathematics."""
        end = _closing(self.tokens, self.k)
        if end is None:
            return self._sign()
        square, inside = self.tokens[self.k].text == "[", self.tokens[self.k + 1 : end]
        self.k = end + 1
        if square:
            return _matrix(inside, self.names)
        if not _mathematical(inside, self.names):
            words = "".join(token.space + token.text for token in inside).strip()
            return f"<mrow><mo>(</mo><mtext>{escape(words)}</mtext><mo>)</mo></mrow>"
        return f"<mrow><mo>(</mo>{_Row(inside, self.names).whole()}<mo>)</mo></mrow>"


def _symbol(name: str) -> tuple[str, str]:
    """A name as its letter, with dashes, and its subscript: empty without one."""
    plain = name.rstrip("'")
    dashes = "′" * (len(name) - len(plain))
    letter, _, sub = plain.partition("_")
    if len(letter) > 3 and letter not in _GREEK:
        return f"<mtext>{escape(name)}</mtext>", ""
    numbered = re.fullmatch(r"([A-Za-z])(\d+)", letter)
    if numbered and letter not in _GREEK:
        letter, sub = numbered[1], numbered[2] + ("," + sub if sub else "")
    shown = _GREEK.get(letter, letter)
    base = f"<mi>{escape(shown)}{dashes}</mi>"
    below = " ".join(_GREEK.get(part, part) for part in sub.split("_"))
    return base, f"<mtext>{escape(below)}</mtext>" if sub else ""


def _matrix(inside: list[_Token], names: frozenset[str]) -> str:
    """Rows in brackets, or the numbers of one row, as a matrix."""
    rows, k = [], 0
    if any(token.text == "[" for token in inside):
        while k < len(inside):
            if inside[k].text == "[":
                end = _closing(inside, k) or len(inside) - 1
                rows.append(_cells(inside[k + 1 : end], names))
                k = end
            k += 1
    else:
        rows.append(_cells(inside, names))
    table = "".join(f"<mtr>{''.join(f'<mtd>{cell}</mtd>' for cell in each)}</mtr>" for each in rows)
    return f"<mtable class='matrix'>{table}</mtable>"


def _cells(tokens: list[_Token], names: frozenset[str]) -> list[str]:
    """The entries of a row, between commas or spaces."""
    cells: list[list[_Token]] = [[]]
    for token in tokens:
        if token.kind == "comma" or token.text == ",":
            cells.append([])
            continue
        if token.space and cells[-1] and not any(each.text == "," for each in tokens):
            cells.append([])
        cells[-1].append(token)
    return [_Row(cell, names).whole() for cell in cells if cell]
