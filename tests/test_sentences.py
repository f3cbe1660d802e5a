"""The documents are read by people whose language is another: no sentence is longer than forty words."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted(
    page
    for pattern in ("*.md", "docs/**/*.md", "docs/tutorial/*.py", "examples/**/*.md", "benchmarks/*.md")
    for page in ROOT.glob(pattern)
)
MOST_WORDS = 40
NO_PROSE = re.compile(
    r"^ *```.*?^ *```$|<!--.*?-->|\$\$.*?\$\$|^\s*\|.*?$|^#+ .*?$|!\[[^\]]*\]\([^)]*\)", re.M | re.S
)
"""Blocks of code, comments, formulas, tables, headings and pictures."""


def prose_of(page):
    """What a page says; of a notebook the text of its cells."""
    text = page.read_text(encoding="utf-8")
    if page.suffix == ".py":
        cells = re.findall(r"^# %% \[markdown\]\n((?:#.*\n)+)", text, re.M)
        text = "\n\n".join(re.sub(r"^# ?", "", cell, flags=re.M) for cell in cells)
    return text


def sentences(text):
    """Sentences of Markdown; what is code or a formula within one counts as a word, a link as its text."""
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", NO_PROSE.sub("", text)):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", paragraph)
        plain = re.sub(r"`[^`]*`|\$[^$]*\$", "code", plain)
        plain = re.sub(r"\b(e\.g|i\.e|al|eq|cf|vs)\.", r"\1", " ".join(plain.split()))
        yield from re.split(r"(?<=[.!?])[)\"*]*\s+", plain)


def too_long(text):
    """Sentences with more words than `MOST_WORDS`; signs alone are none."""
    return [
        sentence
        for sentence in sentences(text)
        if sum(bool(re.search(r"\w", word)) for word in sentence.split()) > MOST_WORDS
    ]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_sentences_are_short(page):
    assert too_long(prose_of(page)) == []


def test_a_long_sentence_is_found():
    long = "word " * MOST_WORDS + "word"
    assert too_long(f"# {long}\n\n- short.\n- {long}. Short.\n") == [f"- {long}."]
    assert (
        too_long(f"| {long} |\n\n```text\n{long}\n```\n\n`{long}` and [{long[:99]}](x) are. {long[:99]}.")
        == []
    )
