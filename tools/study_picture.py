#!/usr/bin/env python3
"""Puts plots of the pages of studies side by side, as one picture.

    pip install pillow
    tools/study_picture.py -o study.jpg "DIR/report.html#FLIP over time: ao, cache 100 %, warm" ...

Plots are named by their page and their heading. It needs chromium, or another browser that --browser names.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

from PIL import Image, ImageChops


def plot(name):
    """The page's head and the plot of `PAGE#HEADING`."""
    path, _, wanted = name.partition("#")
    page = pathlib.Path(path).read_text(encoding="utf-8")
    figures = {}
    for figure in re.findall(r'<figure class="plot">.*?</figure>', page, re.DOTALL):
        heading = re.search(r"<h3>(.*?)</h3>", figure, re.DOTALL)
        if heading:
            figures[heading.group(1)] = figure
    if wanted not in figures:
        sys.exit(f'{path}: no plot "{wanted}"; there are: {", ".join(sorted(figures))}')
    return re.search(r"<head>.*?</head>", page, re.DOTALL).group(0), figures[wanted]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plots", nargs="+", metavar="PAGE#HEADING", help="pages of studies, and headings of plots")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="picture to write")
    parser.add_argument("--browser", default="chromium", help="default: %(default)s")
    options = parser.parse_args()
    plots = [plot(name) for name in options.plots]
    head, chosen = plots[0][0], "".join(figure for _, figure in plots)
    wide = f'<div style="display: grid; grid-template-columns: repeat({len(plots)}, 1fr); gap: 24px">{chosen}</div>'
    with tempfile.TemporaryDirectory() as folder:
        alone, shot = pathlib.Path(folder, "page.html"), pathlib.Path(folder, "page.png")
        body = f'<body style="margin: 16px">{wide}</body>'
        alone.write_text(f'<!doctype html><html lang="en">{head}{body}</html>', "utf-8")
        words = [options.browser, "--headless", "--no-sandbox", "--hide-scrollbars", "--force-device-scale-factor=1.5"]
        words += [f"--window-size={620 * len(plots)},700", f"--screenshot={shot}", alone.as_uri()]
        subprocess.run(words, check=True, capture_output=True)
        picture = Image.open(shot).convert("RGB")
    # What is below the plots is empty.
    empty = Image.new("RGB", picture.size, picture.getpixel((0, picture.height - 1)))
    bottom = ImageChops.difference(picture, empty).getbbox()[3]
    picture.crop((0, 0, picture.width, min(bottom + 16, picture.height))).save(options.output, quality=88)
    print(options.output)


main()
