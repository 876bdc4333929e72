"""What docstrings and pages point to is there: files of docs/, and sections in them."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("firmware", "hal", "sim_backend", "tools", "tests")
SOURCES = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
NAMED = re.compile(r"(docs/)?\b([A-Z][A-Z-]+\.md)\b(?!\")(?:, ([A-Z][a-z ]+))?")  # in quotes: opened by its test


def sections(page: Path) -> set[str]:
    return {line.lstrip("#").strip() for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("##")}


def test_every_document_that_a_source_names_is_in_docs():
    wrong = []
    for path in SOURCES:
        for line in path.read_text(encoding="utf-8").splitlines():
            for folder, name, section in NAMED.findall(line):
                page = ROOT / (folder or "") / name
                if not page.is_file() or (section and not any(s.startswith(section.strip()) for s in sections(page))):
                    wrong.append(f"{path.relative_to(ROOT)}: {line.strip()}")
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_of_a_page_leads_somewhere(page):
    links = re.findall(r"\]\(([^)#\s]+)[)#]", page.read_text(encoding="utf-8"))
    assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []
