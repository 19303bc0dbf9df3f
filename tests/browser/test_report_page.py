"""The report of a run, which leaves the service as a file: on a phone, on a screen and in print."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser

from service.export.formats import FORMATS
from service.export.run import read_run
from service.export.wishes import Wishes
from tests.service.export.recorded import record

from .hands import PHONE
from .stage import Watch

pytestmark = pytest.mark.timeout(300)


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Reports of a find, of a whole search in vain, and of half of one."""
    folder = tmp_path_factory.mktemp("pages")
    found = {}
    for name, options in (("found", {"found": True}), ("searched", {"part": 1.0}), ("half", {})):
        data = FORMATS["html"].write(read_run(record(folder / name, **options)), Wishes())  # type: ignore[arg-type]
        found[name] = folder / f"{name}.html"
        found[name].write_bytes(data)
    return found


@pytest.mark.parametrize("name", ["found", "searched", "half"])
@pytest.mark.parametrize("options", [{}, PHONE], ids=["desktop", "phone"])
def test_axe_finds_nothing_in_a_report_and_it_is_no_wider_than_the_screen(
    chromium: Browser, pages: dict[str, Path], name: str, options: dict[str, Any]
) -> None:
    watch = Watch(chromium, pages[name].as_uri(), **options)
    assert watch.violations() == []
    assert watch.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    tables = watch.page.locator(".wide")
    assert tables.evaluate_all("(all) => all.every((each) => each.scrollWidth <= each.clientWidth)")
    assert tables.get_by_role("row").count() > 10
    watch.page.emulate_media(media="print")
    assert watch.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    watch.close()


@pytest.mark.parametrize("name", ["found", "searched", "half"])
def test_in_print_what_everybody_reads_is_one_sheet(
    chromium: Browser, pages: dict[str, Path], name: str
) -> None:
    """Of A4 less its margins: 186 mm by 273 mm, at 96 pixels an inch."""
    watch = Watch(chromium, pages[name].as_uri(), viewport={"width": 703, "height": 1031})
    watch.page.emulate_media(media="print")
    appendix = watch.page.locator(".appendix").bounding_box()
    assert appendix is not None
    assert appendix["y"] <= 1031
    watch.close()
