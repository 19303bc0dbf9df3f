"""The Dockerfile, read by a parser that nobody here wrote: what it copies, starts and says of itself is there.

No image is built here, there is no registry for its base: what `pip install` makes of the project is the main job's.
"""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import tomllib
from pathlib import Path

import pytest
from dockerfile_parse import DockerfileParser

from service.cli import parser as flags
from service.config import KNOWN_KEYS, Settings
from service.http.address import split_address

TOP = Path(__file__).parents[2]
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="module")
def dockerfile() -> DockerfileParser:
    path = str(TOP / "config" / "Dockerfile")
    return DockerfileParser(path, env_replace=True)


def values(dockerfile: DockerfileParser, word: str) -> list[str]:
    """The arguments of every line of one kind, in order."""
    return [line["value"] for line in dockerfile.structure if line["instruction"] == word]


def test_the_labels_are_those_of_the_project(dockerfile: DockerfileParser) -> None:
    labels = dockerfile.labels
    assert labels["org.opencontainers.image.title"] == PROJECT["name"]
    assert labels["org.opencontainers.image.version"] == PROJECT["version"]
    assert labels["org.opencontainers.image.licenses"] == PROJECT["license"]
    assert labels["org.opencontainers.image.source"].startswith("https://")
    assert len(labels) == 4  # nothing is claimed that is not so, such as being an extension of something


def test_the_port_is_the_default_one_everywhere(dockerfile: DockerfileParser) -> None:
    port = split_address(Settings().http.listen)[1]
    assert values(dockerfile, "EXPOSE") == [str(port)]
    assert f"http://127.0.0.1:{port}/healthz" in values(dockerfile, "HEALTHCHECK")[0]
    assert f"0.0.0.0:{port}" in json.loads(values(dockerfile, "CMD")[-1])


def test_what_is_copied_is_in_the_project_and_in_the_build_context(dockerfile: DockerfileParser) -> None:
    allowed = {line[1:] for line in (TOP / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = [words for words in map(shlex.split, values(dockerfile, "COPY")) if "--from=build" not in words]
    sources = {source for words in copied for source in words[:-1]}
    assert sources == allowed
    assert all((TOP / source).exists() for source in sources)
    packages = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))
    assert set(packages["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]) <= sources
    assert {PROJECT["readme"], *PROJECT["license-files"]} <= sources


def test_it_starts_a_command_that_there_is_with_flags_that_it_takes(dockerfile: DockerfileParser) -> None:
    (entry,) = values(dockerfile, "ENTRYPOINT")
    (program,) = json.loads(entry)
    assert program in PROJECT["scripts"]
    options = flags().parse_args(json.loads(values(dockerfile, "CMD")[-1]))
    assert options.area == Path("/data/area.geojson")
    assert not options.takeoff
    assert options.connect == []  # the settings say what to fly
    names = [name for line in values(dockerfile, "ENV") for name in re.findall(r"(ROISEARCH_\w+)=", line)]
    assert names == ["ROISEARCH_HTTP_TOKEN_FILE"]
    assert "http.token_file" in KNOWN_KEYS


def test_it_runs_as_nobody_in_particular_on_a_python_that_is_supported(dockerfile: DockerfileParser) -> None:
    (user,) = values(dockerfile, "USER")
    assert int(user) >= 10_000
    images = set(dockerfile.parent_images)
    assert len(images) == 1
    version = re.fullmatch(r"python:3\.(\d+)-slim-\w+", images.pop())
    assert version is not None
    assert f"Programming Language :: Python :: 3.{version[1]}" in PROJECT["classifiers"]
    extras = re.search(r"\.\[([\w,]+)\]", values(dockerfile, "RUN")[0])
    assert extras is not None
    assert set(extras[1].split(",")) <= set(PROJECT["optional-dependencies"])


def test_the_shell_takes_every_command(dockerfile: DockerfileParser) -> None:
    for command in values(dockerfile, "RUN"):
        subprocess.run(["sh", "-n", "-c", command], check=True, timeout=10)


def test_the_health_check_fails_where_nothing_listens(dockerfile: DockerfileParser) -> None:
    _, _, command = values(dockerfile, "HEALTHCHECK")[0].partition("CMD ")
    words = json.loads(command)
    words[2] = words[2].replace(":8080", ":1")
    assert subprocess.run(words, capture_output=True, timeout=30, check=False).returncode != 0
