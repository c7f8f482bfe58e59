"""The source files that the documentation names exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("analysis", "model", "recordings", "daq", "rigs", "tests")
DOCUMENTS = (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")))
NAMED_FILE = re.compile(r"`([\w*][\w./*-]*\.(?:py|toml|js|css|proto))`")
OTHER_FILES = {"pyproject.toml", "rig.toml"}  # at the root; an attachment of every recording


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_documents_name_existing_files(document: Path) -> None:
    named = set(NAMED_FILE.findall(document.read_text(encoding="utf-8"))) - OTHER_FILES
    missing = [name for name in sorted(named) if not any(any(ROOT.glob(f"{top}/**/{name}")) for top in FOLDERS)]
    assert not [name for name in missing if not any(ROOT.glob(name))]
