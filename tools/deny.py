#!/usr/bin/env python3
"""Holds all dependencies against deny.toml: their licences, and where they come from.

    tools/deny.py

It does what `cargo deny check licenses sources` does, without anything installed. Exit status 1: a dependency is not
allowed; each is a line that says why.
"""

import json
import pathlib
import re
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parent.parent


def is_allowed(expression, allowed):
    """Whether a licence expression (SPDX) can be met by licences that are allowed."""
    words = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))
    at = 0

    def term():
        nonlocal at
        word = words[at]
        at += 1
        if word == "(":
            value = anything()
            at += 1
            return value
        if at + 1 < len(words) and words[at] == "WITH":
            word = f"{word} WITH {words[at + 1]}"
            at += 2
        return word in allowed

    def all_of():
        nonlocal at
        value = term()
        while at < len(words) and words[at] == "AND":
            at += 1
            value = term() and value
        return value

    def anything():
        nonlocal at
        value = all_of()
        while at < len(words) and words[at] == "OR":
            at += 1
            value = all_of() or value
        return value

    return anything()


def check_itself():
    """It says no where it should."""
    cases = {
        "MIT": True,
        "GPL-2.0-only": False,
        "Apache-2.0 OR GPL-2.0-only": True,
        "MIT/Apache-2.0": True,
        "(MIT OR Apache-2.0) AND GPL-2.0-only": False,
        "GPL-2.0-only WITH Classpath-exception-2.0 OR MIT AND Zlib": False,
        "(GPL-3.0-only OR MIT) AND Apache-2.0": True,
    }
    for expression, expected in cases.items():
        if is_allowed(expression, {"MIT", "Apache-2.0"}) != expected:
            sys.exit(f"tools/deny.py: {expression} is taken for the other")


def main():
    check_itself()
    rules = tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))
    allowed = set(rules["licenses"]["allow"])
    registries = {f"registry+{registry}" for registry in rules["sources"]["allow-registry"]}
    command = ["cargo", "metadata", "--locked", "--all-features", "--format-version", "1"]
    metadata = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, cwd=ROOT).stdout)
    problems, versions = [], {}
    for package in metadata["packages"]:
        name = f"{package['name']} {package['version']}"
        versions.setdefault(package["name"], []).append(package["version"])
        if package["source"] and package["source"] not in registries:
            problems.append(f"{name}: it comes from {package['source']}, which deny.toml does not allow")
        if not package["license"] or not is_allowed(package["license"], allowed):
            licence = package["license"] or "none is stated"
            problems.append(f"{name}: its licence is not in deny.toml ({licence})")
    several = sum(len(of) > 1 for of in versions.values())
    print(f"{len(metadata['packages'])} crates, {several} of them in several versions; {len(problems)} not allowed")
    for problem in problems:
        print(problem)
    sys.exit(bool(problems))


if __name__ == "__main__":
    main()
