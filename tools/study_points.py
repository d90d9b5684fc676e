#!/usr/bin/env python3
"""Makes the points of a study again from its rows.jsonl alone, and compares them with those of its page.

    tools/study_points.py DIR

Prints settings that no other beats in both time and error, by effect and cache: milliseconds, FLIP, method, command.
Ends with 1 and says which where a point of report.html is missing or stands elsewhere. Needs no package.
"""

import collections
import html
import json
import pathlib
import re
import sys


def points(path):
    """(effect, percent, cold) -> settings, a dictionary each: means over views."""
    lines = path.read_text().splitlines()[1:]
    views = collections.defaultdict(list)
    for row in map(json.loads, lines):
        views[row["key"].replace(f"view {row['view']}", "")].append(row)
    groups = collections.defaultdict(list)
    for rows in views.values():
        mean = lambda name: sum(row[name] for row in rows) / len(rows)
        point = {"ms": 1e3 * mean("seconds_frame"), "flip": mean("flip_converged")}
        first = rows[0]
        point |= {name: first[name] for name in ("method", "command")}
        groups[first["effect"], first["cache_percent"], first["cold"]].append(point)
    return groups


def is_best(point, others):
    """Whether none is both at most as slow and at most as far off, and better in one."""
    at = (point["ms"], point["flip"])
    beats = lambda other: other[0] <= at[0] and other[1] <= at[1] and other != at
    return not any(beats((other["ms"], other["flip"])) for other in others)


def drawn(page):
    """Command, milliseconds, FLIP and opacity of the points of a page, by the titles of its plots."""
    found = {}
    figures = re.findall(r"<figure class=\"plot\">.*?</figure>", page, re.S)
    for figure in figures:
        title = html.unescape(re.search(r"<h3>(.*?)</h3>", figure).group(1))
        circles = re.findall(r"<(?:circle|rect) [^>]*opacity=\"([^\"]*)\"[^>]*data-words=\"([^\"]*)\"", figure)
        for opacity, words in circles:
            _, values, command = html.unescape(words).split("\n")
            ms, flip = re.match(r"([\d.]+) ms, FLIP ([\d.]+)", values).groups()
            found[title, command] = (ms, flip, opacity == "1")
    return found


def main():
    folder = pathlib.Path(sys.argv[1])
    page = drawn((folder / "report.html").read_text())
    groups, wrong, count = points(folder / "rows.jsonl"), [], 0
    for (effect, percent, cold), settings in sorted(groups.items()):
        title = f"FLIP over time: {effect}, cache {percent} %, {'cold' if cold else 'warm'}"
        print(f"\n{title}")
        for point in sorted(settings, key=lambda point: point["ms"]):
            best = is_best(point, settings)
            own = (f"{point['ms']:.1f}", f"{point['flip']:.4f}", best)
            count += 1
            if page.get((title, point["command"])) != own:
                wrong.append(f"{title}: {point['command']}: {own}, on the page {page.get((title, point['command']))}")
            if best:
                print(f"{own[0]:>10} ms  {own[1]}  {point['method']}  {point['command']}")
    print(f"\n{count} points, {len(wrong)} of them elsewhere on the page; {len(page)} on the page")
    if wrong or len(page) != count:
        sys.exit("\n".join(wrong) or "the page has other points")


if __name__ == "__main__":
    main()
