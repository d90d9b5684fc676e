#!/usr/bin/env python3
"""Prints the licences of all crates that the program is made of, for a target: names, versions, texts.

    tools/licences.py TARGET [PACKAGE]

PACKAGE is another one of the workspace than brickwalk: brickwalk-python.
"""

import json
import pathlib
import subprocess
import sys


def output(*command):
    return subprocess.run(["cargo", *command], check=True, stdout=subprocess.PIPE, text=True).stdout


def crates(target, package="brickwalk"):
    """The crates that a package is made of, without those that only build or test it."""
    tree = output(
        "tree", "--locked", "--package", package, "--target", target, "--edges", "normal", "--prefix", "none"
    )
    used = {tuple(line.split()[:2]) for line in tree.splitlines()}
    metadata = json.loads(output("metadata", "--locked", "--format-version", "1", "--filter-platform", target))
    of_others = [p for p in metadata["packages"] if p["source"] and (p["name"], f"v{p['version']}") in used]
    return sorted(of_others, key=lambda package: (package["name"], package["version"]))


def texts(package):
    """The texts of a crate's licences."""
    folder = pathlib.Path(package["manifest_path"]).parent
    begins = ("license", "licence", "copying", "notice", "unlicense")
    files = [file for file in sorted(folder.iterdir()) if file.name.lower().startswith(begins) and file.is_file()]
    return [file.read_text(encoding="utf-8", errors="replace").strip() for file in files]


def main():
    users = {}
    print("brickwalk is made with these crates. Texts of their licences follow.\n")
    for package in crates(*sys.argv[1:]):
        name = f"{package['name']} {package['version']}"
        print(f"{name}: {package['license'] or 'see its text'}")
        for text in texts(package):
            users.setdefault(text, []).append(name)
    for text, names in users.items():
        print(f"\n{'-' * 80}\n{', '.join(names)}\n\n{text}")


if __name__ == "__main__":
    main()
