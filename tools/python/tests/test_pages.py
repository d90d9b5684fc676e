"""The programs of the pages in docs/python run, with smaller numbers, and find what is known."""

import pathlib
import re

import pytest

PAGES = pathlib.Path(__file__).resolve().parents[3] / "docs" / "python"

# Numbers that a page has, and what they are here; what is printed; the picture.
CASES = {
    "solar": (
        {"TRIANGLES": "50_000", "GRID": "64"},
        r"[\d,]+ pieces of roof, [\d,]+ questions\nhours of sun: median (\d+\.\d), best (\d+\.\d), below",
        "solar.png",
    ),
    "thickness": (
        {"RINGS": "40", "PLACES": "2000"},
        r"thickness from (0\.0\d+) to (0\.1\d+), median (0\.\d+)\n.*\nall places lie in the wall: True",
        "thickness.png",
    ),
    "lidar": (
        {"TRIANGLES": "50_000", "COLUMNS, ROWS": "250, 100"},
        r"25,000 rays, (\d+)% of them come back, from (\d\.\d+) m on",
        "lidar.png",
    ),
}


def program(page, numbers):
    """The code of a page, with other numbers."""
    code = "\n".join(re.findall(r"```python\n(.*?)```", (PAGES / f"{page}.md").read_text(), re.DOTALL))
    for name, value in numbers.items():
        code, count = re.subn(rf"(?m)^{name} = [^#\n]*", f"{name} = {value}  ", code)
        assert count == 1, name
    return code


def test_all_pages_are_here():
    assert {path.stem for path in PAGES.glob("*.md")} == set(CASES)


@pytest.mark.parametrize("page", CASES)
def test_a_page_runs(page, tmp_path, monkeypatch, capsys):
    numbers, told, picture = CASES[page]
    monkeypatch.chdir(tmp_path)
    exec(compile(program(page, numbers), page, "exec"), {})
    found = re.search(told, capsys.readouterr().out)
    assert found, "what is known is told"
    assert (tmp_path / picture).stat().st_size > 100
    if page == "thickness":
        least, greatest, median = map(float, found.groups())
        # By the bowl's radii and how far its hole is off the middle.
        assert abs(least - 0.04) < 0.01 and abs(greatest - 0.16) < 0.01 and abs(median - 0.1) < 0.01
