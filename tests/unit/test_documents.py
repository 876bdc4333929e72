"""What docstrings, scripts and pages point to is there: files of docs/, and sections in them."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
NAMED = re.compile(r"(?<![\w/])docs/[\w/-]+\.[a-z]+(?:, ([A-Z][a-z ]+))?")
SOURCES = {".py", ".toml", ".html", ".service", ".sh", ".md", ".yml", ".cff", ""}


def sections(page: Path) -> set[str]:
    return {line.lstrip("#").strip() for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("##")}


def tracked() -> list[Path]:
    """Files of the repository, without archives of pages that keep the names of their time."""
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    paths = [ROOT / name for name in names if name and not name.startswith(("docs/archive/", "glider/"))]
    return [path for path in paths if path.suffix in SOURCES and path.is_file() and not path.is_symlink()]


def test_every_page_of_docs_that_a_file_names_exists_with_its_section():
    wrong = []
    for path in tracked():
        for line in path.read_text(encoding="utf-8").splitlines():
            for match in NAMED.finditer(line):
                page = ROOT / match[0].partition(",")[0]
                section = match[1] and match[1].strip()
                generated = page.parent.name == "generated"
                if not generated and (not page.is_file() or (section and not _has_section(page, section))):
                    wrong.append(f"{path.relative_to(ROOT)}: {line.strip()}")
    assert wrong == []


def _has_section(page: Path, named: str) -> bool:
    """Whether a section of the page begins as the words named, or the words as a section."""
    return any(s.startswith(named) or named.startswith(s) for s in sections(page))


def test_pages_under_their_former_names_are_named_nowhere():
    former = re.compile(r"docs/[A-Z][A-Z-]+\.(?:md|txt)\b")
    named = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in tracked()
        for match in former.finditer(path.read_text(encoding="utf-8"))
    ]
    assert named == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    links = re.findall(r"\]\(([^)#\s]+)[)#]", text)
    assert [link for link in links if "://" not in link and not (page.parent / link).exists()] == []
