"""Rejected terms in names and in prose, counted by file; `python -m tests.support.language` shrinks the exceptions."""

import ast
import io
import re
import sys
import tokenize
import tomllib
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests" / "data"
TERMS, EXCEPTIONS = DATA / "language.toml", DATA / "language_exceptions.toml"
CODE = ("firmware", "hal", "sim_backend", "tools", "glider")
NOT_READ = {"archive", "generated"}  # folders of docs: histories in the words of their time, and what code wrote
WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


@dataclass(frozen=True)
class Term:
    """A rejected term: what to use instead, its words in identifiers, its pattern in prose, contract spellings."""

    use: str
    identifier: frozenset[str]
    prose: re.Pattern | None
    contract: frozenset[str]


@cache
def terms() -> list[Term]:
    """Read the rejected terms."""
    found = []
    for entry in tomllib.loads(TERMS.read_text(encoding="utf-8"))["term"]:
        phrases = "|".join(re.escape(phrase) for phrase in entry["prose"])
        pattern = re.compile(rf"\b(?:{phrases})\b", re.IGNORECASE) if phrases else None
        found.append(Term(entry["use"], frozenset(entry["identifier"]), pattern, frozenset(entry.get("contract", ()))))
    return found


def words_of(name: str) -> set[str]:
    """Split an identifier into its words: `inflation_of`, `HEAT` and `HeatMap` all hold `inflation`."""
    return {word.lower() for word in WORD.findall(name)}


@cache
def rejected_in_name(name: str) -> tuple[str, ...]:
    """List the rejected words of an identifier, once for each term that has them."""
    words = words_of(name)
    return tuple(f"{word} (name)" for term in terms() if name not in term.contract for word in words & term.identifier)


def rejected_in_code(text: str) -> Counter[str]:
    """Count rejected terms in Python source by the word or phrase found.

    A string literal that is exactly a contract's key is not counted, nor a name that is one (a field of that key).
    """
    found: Counter[str] = Counter()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.NAME:
            found.update(rejected_in_name(token.string))
        elif token.type in (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", -1)):
            found.update(rejected_in_prose(_plain(token.string)))
    return found


def _plain(literal: str) -> str:
    """Return the value of a plain string literal, so that a contract's key is seen as itself; else the source.

    The expressions of an f-string are no prose.
    """
    if re.match(r"(?i)[rb]*f", literal):
        return re.sub(r"\{[^{}]*\}", "", literal)
    try:
        value = ast.literal_eval(literal)
    except (ValueError, SyntaxError):
        return literal
    return value if isinstance(value, str) else literal


def rejected_in_prose(text: str) -> Counter[str]:
    """Count rejected words and phrases in a docstring, comment, message or page; code in backticks is left out."""
    found: Counter[str] = Counter()
    bare = re.sub(r"`[^`]*`", "", text)
    for term in terms():
        if term.prose is not None and text not in term.contract:
            found.update(match.lower() for match in term.prose.findall(bare))
    return found


@cache
def count_tree() -> dict[str, dict[str, int]]:
    """Count rejected terms by file, relative to the tree, and by word: code, and pages of the documentation."""
    found = {}
    for path in [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]:
        text = re.sub(r"```.*?```|^ {4}[^\n]*$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        if not NOT_READ & set(path.relative_to(ROOT).parts) and (counts := rejected_in_prose(text)):
            found[str(path.relative_to(ROOT))] = dict(sorted(counts.items()))
    for path in sorted(path for folder in CODE for kind in ("*.py", "*.toml") for path in (ROOT / folder).rglob(kind)):
        text = path.read_text(encoding="utf-8")
        counts = rejected_in_code(text) if path.suffix == ".py" else rejected_in_prose(text)
        if counts and not any(part.is_symlink() for part in path.parents if part != ROOT and ROOT in part.parents):
            found[str(path.relative_to(ROOT))] = dict(sorted(counts.items()))
    return found


def exceptions() -> dict[str, dict[str, int]]:
    """Read the exceptions: file, word, how often it may still stand there."""
    return tomllib.loads(EXCEPTIONS.read_text(encoding="utf-8"))


def excess(counts: dict[str, dict[str, int]], allowed: dict[str, dict[str, int]]) -> list[str]:
    """List the words that stand more often in a file than the exceptions allow, each with its replacement."""
    uses = {f"{word} (name)": term.use for term in terms() for word in term.identifier}
    lines = []
    for path, words in counts.items():
        for word, count in words.items():
            most = allowed.get(path, {}).get(word, 0)
            if count > most:
                use = uses.get(word) or next(t.use for t in terms() if t.prose and t.prose.fullmatch(word))
                lines.append(f"{path}: {word} {count} times, {most} excepted: use {use}")
    return lines


def write_exceptions(counts: dict[str, dict[str, int]]) -> None:
    """Write the exceptions: what stands in the tree now."""
    lines = [
        "# Rejected terms that are left, by file. Written by `python -m tests.support.language`; it may only shrink.\n"
    ]
    for path, words in counts.items():
        entries = ", ".join(f'"{word}" = {count}' for word, count in words.items())
        lines.append(f'"{path}" = {{ {entries} }}\n')
    EXCEPTIONS.write_text("".join(lines), encoding="utf-8")


if __name__ == "__main__":
    now = count_tree()
    grown = excess(now, exceptions()) if EXCEPTIONS.exists() and "--grow" not in sys.argv else []
    if grown:
        sys.exit("\n".join(grown))
    write_exceptions(now)
    print(sum(sum(words.values()) for words in now.values()), "left in", len(now), "files")
