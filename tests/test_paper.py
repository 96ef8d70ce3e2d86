"""The paper about the package: the form that JOSS asks for, and no number that the docs lack."""

from __future__ import annotations

import re

import yaml

from tests.shown import ROOT

PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
_, HEADER, BODY = PAPER.split("---\n", 2)

_KEY = re.compile(r"(?<=@)[\w-]+")
_CITATION = re.compile(r"\[@[^\]]+\]")
_NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


def documented() -> str:
    """All that the documentation says."""
    pages = [ROOT / "README.md", ROOT / "experiments" / "README.md", *(ROOT / "docs").rglob("*.md")]
    return "\n".join(page.read_text(encoding="utf-8") for page in pages)


def test_header_and_sections_are_those_that_the_journal_asks_for() -> None:
    header = yaml.safe_load(HEADER)
    assert set(header) == {"title", "tags", "authors", "affiliations", "date", "bibliography"}
    assert (ROOT / "paper" / header["bibliography"]).is_file()
    known = {str(place["index"]) for place in header["affiliations"]}
    assert {str(author["affiliation"]) for author in header["authors"]} <= known
    assert re.findall(r"^# (.+)$", BODY, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    ]


def test_length_is_what_the_journal_asks_for() -> None:
    assert 750 <= len(PAPER.split()) <= 1750


def test_what_is_cited_is_in_the_bibliography_and_the_other_way_round() -> None:
    cited = {key for group in _CITATION.findall(BODY) for key in _KEY.findall(group)}
    entries = re.findall(r"^@\w+\{([\w-]+),$", BIBLIOGRAPHY, re.MULTILINE)
    assert len(entries) == BIBLIOGRAPHY.count("\n@"), "every entry begins as the pattern says"
    assert sorted(entries) == sorted(cited)


def test_every_figure_has_a_label_and_is_referred_to() -> None:
    figures = re.findall(r"^!\[.+\\label\{(fig:\w+)\}\]\((\S+)\)$", BODY, re.MULTILINE)
    assert len(figures) == BODY.count("![") >= 1
    assert {label for label, _ in figures} == set(re.findall(r"\\autoref\{(fig:\w+)\}", BODY))
    for _, target in figures:
        assert (ROOT / "paper" / target).is_file(), target


def test_every_number_is_in_the_documentation() -> None:
    known = set(_NUMBER.findall(documented()))
    prose = re.sub(r"\]\([^)]*\)|`[^`]*`", "", _CITATION.sub("", BODY))
    numbers = _NUMBER.findall(prose)
    assert len(numbers) > 10
    assert [number for number in numbers if number not in known] == []
