"""Colours: the page's custom properties carry the values of daq.colours."""

import re
from pathlib import Path

from daq import colours
from daq.colours import ON_WHITE, Color, hex_code

CONSOLE = Path(__file__).parents[2] / "daq" / "console"
MEANINGS: dict[str, Color] = {
    "background": colours.BACKGROUND,
    "text": colours.TEXT,
    "label": colours.LABEL,
    "x": colours.MEASURED_X,
    "y": colours.MEASURED_Y,
    "model": colours.MODEL,
    "tacho": colours.TACHO,
    "marker": colours.MARKER,
    "clearance": colours.CLEARANCE,
    "good": colours.GOOD,
    "alarm": colours.ALARM,
    "danger": colours.DANGER,
}
ONLY_ON_THE_PAGE = {"panel", "edge"}


def custom_properties(block: str) -> dict[str, str]:
    """Return the colours of a CSS block, written with six digits."""
    found = dict(re.findall(r"--([a-z]+): #([0-9a-f]+);", block))
    return {
        name: "#" + (code if len(code) == 6 else "".join(2 * digit for digit in code)) for name, code in found.items()
    }


def test_page_has_the_colours_of_the_live_view_on_dark_and_on_paper() -> None:
    css = (CONSOLE / "page.css").read_text(encoding="utf-8")
    screen, paper = (custom_properties(block) for block in re.findall(r":root \{(.*?)\}", css, re.DOTALL))
    assert set(screen) == {*MEANINGS, *ONLY_ON_THE_PAGE}
    assert {name: screen[name] for name in MEANINGS} == {name: hex_code(color) for name, color in MEANINGS.items()}
    printed = {name: code for name, code in paper.items() if name not in ONLY_ON_THE_PAGE}
    assert printed == {name: hex_code(ON_WHITE[MEANINGS[name]]) for name in printed}
    assert {"background", "text", "x", "y", "model", "alarm", "danger"} <= set(printed)


def test_reference_page_uses_the_same_text_and_background() -> None:
    css = (CONSOLE / "reference.css").read_text(encoding="utf-8")
    for color in (colours.BACKGROUND, colours.TEXT, colours.LABEL, colours.MEASURED_X):
        assert hex_code(color) in css
