"""Where commands are told: shell blocks, indented lines, words set as code, comments of the files in `config`."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

TOP = Path(__file__).parents[2]
BEGINS = re.compile(
    r"(?:[A-Z_]+=\S+ )?(?:\.venv/bin/\S+|roisearch-(?:service|sim)|pdoc|pytest|pip install|python3? -m|bash|docker|"
    r"apt-get|openssl|curl|systemctl|mkdir|install|cp) "
)
"""What a line or words set as code begin with, if they are a command."""


def files() -> list[Path]:
    """Pages, and the files of `config` whose comments tell how they are used."""
    listed = subprocess.run(["git", "ls-files"], cwd=TOP, capture_output=True, text=True, check=True).stdout
    names = [Path(name) for name in listed.splitlines()]
    pages = [name for name in names if name.suffix == ".md" and name.name != "CHANGELOG.md"]
    return pages + [
        name for name in names if name.parts[0] == "config" and name.suffix in ("", ".toml", ".service")
    ]


def _whole_lines(text: str) -> list[str]:
    """Commands of a block: continued lines joined, a here-document with its text, comments left out."""
    lines: list[str] = []
    end = ""
    for line in text.replace("\\\n", " ").splitlines():
        if end:
            lines[-1] += f"\n{line}"
            end = "" if line == end else end
        elif said := re.sub(r"(?:^|\s+)# .*", "", line).strip():
            lines.append(re.sub(r"\s+", " ", said))
            end = here.group(1) if (here := re.search(r"<<'(\w+)'", said)) else ""
    return lines


def _spans(text: str) -> list[str]:
    """Words set as code, on one line or two."""
    return [re.sub(r"\s+", " ", span) for span in re.findall(r"(?<!`)`([^`]+)`(?!`)", text)]


def commands_of(file: Path) -> list[str]:
    """The commands of a file, in its order, each once."""
    text = (TOP / file).read_text(encoding="utf-8")
    if file.suffix != ".md":
        told = re.sub(r"^# ?", "", "\n".join(re.findall(r"^#.*", text, re.M)), flags=re.M)
        found = [line for line in _whole_lines(told) if BEGINS.match(line)]
        return list(dict.fromkeys([*found, *(span for span in _spans(told) if BEGINS.match(span))]))
    blocks = re.findall(r"```sh\n(.*?)```", text, re.S)
    prose = re.sub(r"```.*?```", "", text, flags=re.S)
    indented = [
        line for line in _whole_lines("\n".join(re.findall(r"^ {4}.*", prose, re.M))) if BEGINS.match(line)
    ]
    spans = [span for span in _spans(prose) if BEGINS.match(span)]
    return list(dict.fromkeys([line for block in blocks for line in _whole_lines(block)] + indented + spans))


COMMANDS = {file: commands_of(file) for file in files()}
