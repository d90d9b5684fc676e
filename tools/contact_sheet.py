#!/usr/bin/env python3
"""Renders Sponza from five viewpoints under the sun, a physical sky and each HDR environment, on one sheet.

    pip install pillow
    tools/contact_sheet.py --scenes ../shared/scenes --brickwalk target/release/brickwalk -o DIR [--spp 16]

Rows are lights, columns the views of paths/sponza_1.json to sponza_5.json. Every picture is kept in DIR and not made
twice; the sheet is DIR/sheet.jpg. Every picture is exposed by itself, has all light with eight bounces and is
denoised.
"""

import argparse
import pathlib
import subprocess

from PIL import Image, ImageDraw

VIEWS = range(1, 6)


def lights(scenes):
    """Name, options."""
    high = ["--sun", "0.3,1,0.06"]
    rows = [("sun and plain sky", ["--environment", "none", *high]), ("physical sky", ["--environment", "sky", *high])]
    for name in ("venice_sunset_1k.hdr", "potsdamer_platz_1k.hdr", "city.exr", "studio.exr"):
        rows.append((name, ["--environment", str(scenes / "env" / name)]))
    return rows


def render(args, scene, name, options, view):
    """The picture of one view in one light, made unless it is there."""
    folder = args.output / f"{name.split('.')[0].replace(' ', '-').replace(',', '')}-{view}"
    picture = folder / "frames" / "0000.png"
    if not picture.exists():
        command = [args.brickwalk, "walk", scene, "-o", folder, "--path", f"paths/sponza_{view}.json", "--frames", "1"]
        command += ["--size", args.size, "--quality", "high", "--spp", str(args.spp), "--quiet", *options]
        subprocess.run([str(word) for word in command], check=True)
    return picture


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=pathlib.Path, required=True, help="folder with sponza/ and env/")
    parser.add_argument(
        "--brickwalk", type=pathlib.Path, default="target/release/brickwalk", help="the program (default: %(default)s)"
    )
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder of all pictures")
    parser.add_argument("--spp", type=int, default=16, help="samples a pixel (default: %(default)s)")
    parser.add_argument("--size", default="320x180", help="pixels of a picture (default: %(default)s)")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    scene = args.output / "sponza.bricks"
    if not scene.exists():
        model = args.scenes / "sponza" / "Sponza.gltf"
        subprocess.run([str(args.brickwalk), "convert", str(model), "-o", str(scene)], check=True)
    width, height = map(int, args.size.split("x"))
    rows = lights(args.scenes)
    label = 18
    sheet = Image.new("RGB", (len(VIEWS) * width, len(rows) * (height + label)), "white")
    draw = ImageDraw.Draw(sheet)
    for row, (name, options) in enumerate(rows):
        top = row * (height + label)
        draw.text((4, top + 3), name, fill="black")
        for column, view in enumerate(VIEWS):
            with Image.open(render(args, scene, name, options, view)) as picture:
                sheet.paste(picture, (column * width, top + label))
    sheet.save(args.output / "sheet.jpg", quality=88)
    print(args.output / "sheet.jpg")


if __name__ == "__main__":
    main()
