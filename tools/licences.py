#!/usr/bin/env python3
"""Prints the licences of all crates that the program is made of, for a target: names, versions, texts."""

import json
import pathlib
import subprocess
import sys


def crates(target):
    """The crates of the program, without those that only build or test it."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    found, waiting = set(), [metadata["resolve"]["root"]]
    while waiting:
        crate = waiting.pop()
        if crate not in found:
            found.add(crate)
            used = [d for d in nodes[crate]["deps"] if any(kind["kind"] is None for kind in d["dep_kinds"])]
            waiting += [dependency["pkg"] for dependency in used]
    of_others = [packages[crate] for crate in found if packages[crate]["source"]]
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
    for package in crates(sys.argv[1]):
        name = f"{package['name']} {package['version']}"
        print(f"{name}: {package['license'] or 'see its text'}")
        for text in texts(package):
            users.setdefault(text, []).append(name)
    for text, names in users.items():
        print(f"\n{'-' * 80}\n{', '.join(names)}\n\n{text}")


if __name__ == "__main__":
    main()
