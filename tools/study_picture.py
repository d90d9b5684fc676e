#!/usr/bin/env python3
"""Puts plots of a study's page side by side, as one picture.

    pip install pillow
    tools/study_picture.py DIR/report.html -o study.jpg "FLIP over time: ao, cache 100 %, warm" ...

Plots are named by their headings. It needs chromium, or another browser that --browser names.
"""

import argparse
import pathlib
import re
import subprocess
import sys
import tempfile

from PIL import Image, ImageChops


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=pathlib.Path, help="page of a study")
    parser.add_argument("plots", nargs="+", metavar="HEADING", help="headings of plots")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="picture to write")
    parser.add_argument("--browser", default="chromium", help="default: %(default)s")
    options = parser.parse_args()
    page = options.report.read_text(encoding="utf-8")
    figures = {}
    for figure in re.findall(r'<figure class="plot">.*?</figure>', page, re.DOTALL):
        heading = re.search(r"<h3>(.*?)</h3>", figure, re.DOTALL)
        if heading:
            figures[heading.group(1)] = figure
    unknown = [name for name in options.plots if name not in figures]
    if unknown:
        sys.exit(f"{options.report}: no plot \"{unknown[0]}\"; there are: {', '.join(sorted(figures))}")
    head = re.search(r"<head>.*?</head>", page, re.DOTALL).group(0)
    chosen = "".join(figures[name] for name in options.plots)
    wide = f'<div style="display: grid; grid-template-columns: repeat({len(options.plots)}, 1fr); gap: 24px">{chosen}</div>'
    with tempfile.TemporaryDirectory() as folder:
        alone, shot = pathlib.Path(folder, "page.html"), pathlib.Path(folder, "page.png")
        alone.write_text(f'<!doctype html><html lang="en">{head}<body style="margin: 16px">{wide}</body></html>', "utf-8")
        words = [options.browser, "--headless", "--no-sandbox", "--hide-scrollbars", "--force-device-scale-factor=1.5"]
        words += [f"--window-size={620 * len(options.plots)},700", f"--screenshot={shot}", alone.as_uri()]
        subprocess.run(words, check=True, capture_output=True)
        picture = Image.open(shot).convert("RGB")
    # What is below the plots is empty.
    empty = Image.new("RGB", picture.size, picture.getpixel((0, picture.height - 1)))
    bottom = ImageChops.difference(picture, empty).getbbox()[3]
    picture.crop((0, 0, picture.width, min(bottom + 16, picture.height))).save(options.output, quality=88)
    print(options.output)


main()
