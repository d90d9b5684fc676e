"""What the package is made of is told in it."""

import importlib.resources

import brickwalk


def test_licences_are_in_the_package():
    folder = importlib.resources.files(brickwalk)
    third = (folder / "THIRD-PARTY.txt").read_text()
    # What only the program needs is not named.
    assert "\npyo3 " in third and "\nwgpu " in third and "\nclap " not in third and "\naccesskit " not in third
    assert "MIT" in (folder / "LICENSE-MIT").read_text() and "Apache" in (folder / "LICENSE-APACHE").read_text()
