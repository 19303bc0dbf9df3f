"""Two ways to use the page without a mouse: a keyboard alone, and fingers on a phone. Both know the same few acts, so
that one story can be walked by either."""

from __future__ import annotations

from typing import Any, ClassVar

from playwright.sync_api import Browser, Locator, expect

from .stage import Watch

PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
MOST_TABS = 150
STEP_PX, LEAP_PX = 20, 100
BESIDE_PX = 50  # below the cross-hair: a finger on what was just drawn would drag that
ARROWS = {(1, 0): "ArrowRight", (-1, 0): "ArrowLeft", (0, 1): "ArrowDown", (0, -1): "ArrowUp"}
Way = tuple[int, int]
"""To the right and down, in steps of 20 pixels."""


class Keyboard:
    """Only keys: nothing here may click, hover, or give anything the focus but by Tab."""

    options: ClassVar[dict[str, Any]] = {}

    def __init__(self, browser: Browser, url: str, **options: Any) -> None:
        self.watch = Watch(browser, url, **{**self.options, **options})
        self.page = self.watch.page

    def reach(self, wanted: Locator) -> None:
        """Tab until it has the keyboard."""
        expect(wanted).to_be_visible()
        for _ in range(MOST_TABS):
            if wanted.evaluate("(element) => element === document.activeElement"):
                return
            self.page.keyboard.press("Tab")
        raise AssertionError(f"{MOST_TABS} times Tab do not lead to {wanted}")

    def press(self, wanted: Locator) -> None:
        """A button, a link, a summary."""
        expect(wanted).to_be_enabled()
        self.reach(wanted)
        self.page.keyboard.press("Enter")

    def write(self, wanted: Locator, text: str) -> None:
        """A field: what is in it is written over."""
        self.reach(wanted)
        self.page.keyboard.press("Control+a")
        self.page.keyboard.type(text)

    def go(self, way: Way) -> None:
        """Move the map under the cross-hair."""
        for side, count in (((1, 0), way[0]), ((0, 1), way[1])):
            sign = 1 if count >= 0 else -1
            leaps, steps = divmod(abs(count), LEAP_PX // STEP_PX)
            arrow = ARROWS[side[0] * sign, side[1] * sign]
            for key in [f"Shift+{arrow}"] * leaps + [arrow] * steps:
                self.page.keyboard.press(key)

    def draw(self, what: str, *ways: Way) -> None:
        """Draw something: from where the map is, a way to each of its corners; it closes itself."""
        self.press(drawing(self.watch, what))
        expect(self.page.locator("#map")).to_be_focused()
        for way in ways:
            self.go(way)
            self.page.keyboard.press("Enter")
        if len(ways) > 1:
            self.page.keyboard.press("Enter")  # twice in one place: it is closed
        expect(self.page.locator("#aimed")).to_have_text(f"{what}: drawn.")

    def close(self) -> None:
        """Nothing may have gone wrong on the page."""
        self.watch.close()


class Fingers(Keyboard):
    """Only taps and strokes, on a screen of a phone's size."""

    options: ClassVar[dict[str, Any]] = PHONE

    def press(self, wanted: Locator) -> None:
        expect(wanted).to_be_enabled()
        wanted.tap()

    def write(self, wanted: Locator, text: str) -> None:
        wanted.tap()
        wanted.fill(text)

    def go(self, way: Way) -> None:
        """Stroke over the map: it follows the finger."""
        if way == (0, 0):
            return  # a finger that goes nowhere is a tap
        box = self.page.locator("#map").bounding_box()
        assert box is not None
        dx, dy = -way[0] * STEP_PX, -way[1] * STEP_PX
        x, y = box["x"] + (box["width"] - dx) / 2, box["y"] + (box["height"] - dy) / 2 + BESIDE_PX
        touch = self.watch.context.new_cdp_session(self.page)
        touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
        for part in range(1, 9):
            point = {"x": x + dx * part / 8, "y": y + dy * part / 8}
            touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [point]})
            self.page.wait_for_timeout(16)
        self.page.wait_for_timeout(250)  # the finger rests, so that the map does not slide on
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        touch.detach()

    def draw(self, what: str, *ways: Way) -> None:
        """Move the map with a finger and press 'Set here' for each corner."""
        self.press(drawing(self.watch, what))
        for way in ways:
            self.go(way)
            self.press(self.page.get_by_role("button", name="Set here"))
        if len(ways) > 1:
            self.press(self.page.get_by_role("button", name="Close"))
        expect(self.page.locator("#aimed")).to_have_text(f"{what}: drawn.")


def drawing(watch: Watch, what: str) -> Locator:
    """The button that begins a drawing."""
    return watch.page.locator("#draw").get_by_role("button", name=what, exact=True)
