"""The README and the pages beside the rooms: their examples run and their links lead somewhere. `tests/typed` has the
commands."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
PAGES = [TOP / "README.md", *sorted(TOP.glob("[!.]*/**/README.md"))]
EXAMPLES = [
    (page.parent.name, code)
    for page in (TOP / "README.md", TOP / "roisearch" / "README.md")
    for code in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.S)
    if "look_at_next_frame" not in code  # tests/integration/test_detectors.py runs that
]


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_an_example_runs_as_it_stands(number: int, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", EXAMPLES[number][1]], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(TOP)))
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", text):
        name, _, anchor = target.partition("#")
        file = (page.parent / name) if name else page
        assert file.exists(), f"{page.relative_to(TOP)}: {target}"
        if anchor:
            heads = re.findall(r"^#+ (.+)$", file.read_text(encoding="utf-8"), re.M)
            slugs = {re.sub(r"[^\w\s-]", "", head.lower()).replace(" ", "-") for head in heads}
            assert anchor in slugs, f"{page.relative_to(TOP)}: {target}"


def test_the_first_page_is_short() -> None:
    assert len((TOP / "README.md").read_text(encoding="utf-8").splitlines()) < 330
