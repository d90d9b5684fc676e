#!/usr/bin/env bash
# Makes the pictures of docs/: generates a city, a plant, woods and a stadium, renders each with `--quality high`,
# beside Sponza where its folder is given, and puts them on one sheet. Half an hour on two cores, and an hour with
# SCENES. Pictures that are there are not made twice.
#
#   tools/pictures.sh DIR [SCENES [PART…]]
#
# DIR keeps scenes and pictures. SCENES is a folder with sponza/Sponza.gltf and env/. All of it takes python3 with
# pillow. The parts, of which all are made by default:
#
#   sheet   pictures.jpg
#   window  window.jpg, where there are Xvfb, openbox, import and convert
#   lights  sponza.jpg, Sponza under six lights, with SCENES
#   study   study.jpg, plots of a study of it, with SCENES and chromium
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
brickwalk=${BRICKWALK:-$root/target/release/brickwalk}
[ $# -ge 1 ] || { echo "usage: tools/pictures.sh DIR [SCENES [PART…]]" >&2; exit 2; }
[ -x "$brickwalk" ] || { echo "$brickwalk is not there: build with cargo build --release" >&2; exit 1; }
mkdir -p "$1"
out=$(cd -- "$1" && pwd)
scenes=${2:-}
parts=" ${*:3} "
[ $# -ge 3 ] || parts=" sheet window lights study "
size=${SIZE:-1280x720}

wants() { [[ $parts == *" $1 "* ]]; }
has() { command -v "$1" >/dev/null; }

# Asked before anything is rendered, for it is used last.
if wants sheet || wants lights || wants study; then
    python3 -c "import PIL" 2>/dev/null || { echo "python3 has no pillow: pip install pillow" >&2; exit 1; }
fi

# A picture: its name, the scene, the camera path, and more options.
picture() {
    local name=$1 scene=$2 path=$3
    shift 3
    [ -e "$out/$name/frames/0000.png" ] && return
    echo "$name"
    "$brickwalk" walk "$scene" -o "$out/$name" --path "$path" --frames 1 --size "$size" --quality high --quiet "$@"
}

# A generated scene: its kind and its triangles.
generated() {
    [ -e "$out/$1.bricks" ] || "$brickwalk" scene "$1" --triangles "$2" --quiet -o "$out/$1.bricks"
}

sponza() {
    [ -e "$out/sponza.bricks" ] || "$brickwalk" convert "$scenes/sponza/Sponza.gltf" --quiet -o "$out/sponza.bricks"
}

pictures() {
    generated city 4M
    picture city "$out/city.bricks" "$root/docs/city.json" --sun 0.7,0.5,0.5
    generated pipes 4M
    picture plant "$out/pipes.bricks" "$out/pipes.near.json"
    generated terrain 4M
    picture woods "$out/terrain.bricks" "$out/terrain.near.json" --sun -0.6,0.5,0.4
    generated stadium 4M
    picture stadium "$out/stadium.bricks" "$out/stadium.near.json" --sun 0.5,0.45,0.6
    if [ -n "$scenes" ]; then
        sponza
        picture sponza "$out/sponza.bricks" "$root/paths/sponza_3.json" --sun 0.3,1,0.06
    fi
}

# The window over the city, once it rests.
window() {
    local display=:97 server view
    generated city 4M
    Xvfb $display -screen 0 1280x800x24 2>/dev/null &
    server=$!
    sleep 2
    DISPLAY=$display openbox 2>/dev/null &
    DISPLAY=$display "$brickwalk" view "$out/city.bricks" -o "$out" --path "$root/docs/city.json" \
        --size 1280x775 --quiet --sun 0.7,0.5,0.5 --spp 16 --effects shadow,ao &
    view=$!
    sleep "${WINDOW_SECONDS:-150}"
    DISPLAY=$display import -window root "$out/window.png"
    kill "$view" "$server"
    wait "$view" "$server" 2>/dev/null || true
    convert "$out/window.png" -quality 88 "$out/window.jpg"
}

# Sponza under six lights.
lights() {
    local lights=$out/lights
    sponza
    mkdir -p "$lights"
    [ -e "$lights/sponza.bricks" ] || ln -s "$out/sponza.bricks" "$lights/sponza.bricks"
    python3 "$root/tools/contact_sheet.py" --scenes "$scenes" --brickwalk "$brickwalk" -o "$lights"
    cp "$lights/sheet.jpg" "$out/sponza.jpg"
}

# Error over time of two effects in Sponza.
study() {
    local effect
    sponza
    for effect in ao diffuse; do
        "$brickwalk" study "$out/sponza.bricks" -o "$out/study-$effect" --path "$root/paths/sponza.json" \
            --effects "$effect" --caches 100 --views 1 --size 320x180 --budget 15 --quiet
    done
    python3 "$root/tools/study_picture.py" -o "$out/study.jpg" \
        "$out/study-ao/report.html#FLIP over time: ao, cache 100 %, warm" \
        "$out/study-diffuse/report.html#FLIP over time: diffuse, cache 100 %, warm"
}

if wants window && [ ! -e "$out/window.jpg" ] && has Xvfb && has openbox && has import && has convert; then
    echo "window"
    window
fi
if wants lights && [ -n "$scenes" ]; then
    lights
fi
if wants study && [ -n "$scenes" ] && has chromium; then
    study
fi
wants sheet || exit 0
pictures

python3 - "$out" <<'SHEET'
import pathlib
import sys

from PIL import Image

out = pathlib.Path(sys.argv[1])
names = [name for name in ("sponza", "city", "woods", "plant", "stadium") if (out / name / "frames" / "0000.png").exists()]
pictures = [Image.open(out / name / "frames" / "0000.png") for name in names]
# The first is wide, the others two in a row below it.
width, gap = 1600, 8
first, rest = (pictures[:1], pictures[1:]) if len(pictures) % 2 else ([], pictures)


def scaled(image, width):
    return image.resize((width, image.height * width // image.width), Image.LANCZOS)


rows = [[scaled(image, width) for image in first]] if first else []
half = (width - gap) // 2
rows += [[scaled(image, half) for image in rest[i : i + 2]] for i in range(0, len(rest), 2)]
height = sum(row[0].height for row in rows) + gap * (len(rows) - 1)
sheet, y = Image.new("RGB", (width, height), "white"), 0
for row in rows:
    x = 0
    for image in row:
        sheet.paste(image, (x, y))
        x += image.width + gap
    y += row[0].height + gap
sheet.save(out / "pictures.jpg", quality=88)
print(out / "pictures.jpg")
SHEET
