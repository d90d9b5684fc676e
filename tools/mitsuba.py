#!/usr/bin/env python3
"""Compares converged pictures with Mitsuba 3, an independent path tracer, on the same geometry with diffuse materials.

    pip install mitsuba numpy
    tools/mitsuba.py --scenes ../shared/scenes --brickwalk target/release/brickwalk -o DIR

The scene is Sponza with a colour a material and neither textures nor normals, so that both shade the same surfaces.
Cases: the sun alone, an environment alone, ambient occlusion, sun and environment with one bounce, and with four and
eight (`bounce-4`, `bounce-8`); three views of paths/. Pictures are kept in DIR and not made twice; Mitsuba's are kept
after every 64 samples. The same command goes on with a run that was interrupted. One DIR is for one build of brickwalk:
a new build needs a new DIR, or one without the folders CASE-VIEW-SPP.

A row of the table is a picture: the relative difference of the means, with one standard error of Mitsuba's; that of the
channel that differs most; of the mean of the worst tile of 20 x 20 pixels; of pixels on the average; HDR-FLIP
(`brickwalk compare`); the seconds of processor time that each took. Tiles, pixels and FLIP have the noise of both
pictures in them. The exit status is 1 where means differ by more than 1 %, and with --control where they do not.

The variant llvm_ad_rgb is 10 to 30 times as fast as scalar_rgb. It needs a libLLVM.so, which the system finds or
DRJIT_LIBLLVM_PATH names: 15 and 16 fail ("Cannot select"), 19.1 (Debian's libllvm19) works.
"""

import argparse
import functools
import json
import os
import pathlib
import resource
import subprocess
import sys
import time

# The folder of this file comes first, and `import mitsuba` would be this file.
sys.path = [path for path in sys.path if pathlib.Path(path or ".").resolve() != pathlib.Path(__file__).resolve().parent]

import numpy as np

SIZE = (320, 180)
# As long as the scene: occlusion is then what a sky of one brightness leaves.
AO_LENGTH = 1000.0
SUN = np.array([0.4, 0.8, 0.45])
# What a white surface that faces the sun reflects of it at intensity 1 (src/frame/light.rs).
SUN_COLOR = np.array([0.60, 0.56, 0.48])
SUN_INTENSITY = 2.4
# Samples a pixel that Mitsuba takes before its picture is kept.
BATCH = 64
# What means may differ by.
BOUND = 0.01
# What Mitsuba is told wrongly with --control, and in which cases that shows.
CONTROLS = {
    "albedo": ("every albedo 2 % higher", ("sun", "environment", "ao", "bounce")),
    "sun": ("the sun turned by 2 degrees about the vertical", ("sun", "bounce")),
    "environment": ("the environment turned by 90 degrees about the vertical", ("environment", "bounce")),
}
COMPONENT = {5126: np.float32, 5125: np.uint32, 5123: np.uint16}


def split(case):
    """The kind of light of a case, and how many bounces it has."""
    kind, _, bounces = case.partition("-")
    return kind, int(bounces or kind == "bounce")


def colour(index):
    """An albedo a material, 0.2 to 0.8."""
    return [round(0.2 + 0.6 * ((0.5 + index * g) % 1.0), 4) for g in (0.8191725, 0.6710436, 0.5497005)]


def diffuse_sponza(scenes, out):
    """Sponza's geometry with a colour a material, as a glTF file in `out`.

    Without its factor of 0 a surface would be glossy as glass is.
    """
    source = scenes / "sponza"
    document = json.loads((source / "Sponza.gltf").read_text())
    for key in ("textures", "images", "samplers", "extensionsUsed", "extensionsRequired"):
        document.pop(key, None)
    document["materials"] = [
        {
            "doubleSided": True,
            "pbrMetallicRoughness": {
                "baseColorFactor": colour(i) + [1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
            "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
        }
        for i in range(len(document["materials"]))
    ]
    document["extensionsUsed"] = ["KHR_materials_specular"]
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["attributes"] = {"POSITION": primitive["attributes"]["POSITION"]}
    binary = out / "scene.bin"
    if not binary.exists():
        binary.write_bytes((source / document["buffers"][0]["uri"]).read_bytes())
    document["buffers"][0]["uri"] = binary.name
    path = out / "scene.gltf"
    path.write_text(json.dumps(document))
    return path, document, binary.read_bytes()


def accessor(document, data, index):
    a = document["accessors"][index]
    view = document["bufferViews"][a["bufferView"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[a["type"]]
    kind = np.dtype(COMPONENT[a["componentType"]])
    stride = view.get("byteStride", width * kind.itemsize)
    start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
    rows = np.lib.stride_tricks.as_strided(
        np.frombuffer(data, np.uint8, (a["count"] - 1) * stride + width * kind.itemsize, start),
        (a["count"], width * kind.itemsize),
        (stride, 1),
    )
    return np.ascontiguousarray(rows).view(kind).reshape(a["count"], width)


def matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    m = np.eye(4)
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    m[:3, :3] = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ) * np.array(node.get("scale", [1, 1, 1]))
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def meshes(document, data):
    """World positions, indices and material of every primitive."""

    def visit(index, above):
        node = document["nodes"][index]
        world = above @ matrix(node)
        if "mesh" in node:
            for primitive in document["meshes"][node["mesh"]]["primitives"]:
                positions = accessor(document, data, primitive["attributes"]["POSITION"]).astype(np.float64)
                positions = positions @ world[:3, :3].T + world[:3, 3]
                indices = accessor(document, data, primitive["indices"]).reshape(-1, 3)
                yield positions, indices, primitive["material"]
        for child in node.get("children", []):
            yield from visit(child, world)

    for root in document["scenes"][document.get("scene", 0)]["nodes"]:
        yield from visit(root, np.eye(4))


class Reference:
    """Mitsuba's pictures, of a scene that is wrong by `control`."""

    def __init__(self, document, data, control):
        import mitsuba

        self.mi = mitsuba
        self.control = control
        self.shapes = {}
        factor = 1.02 if control == "albedo" else 1.0
        for number, (positions, indices, material) in enumerate(meshes(document, data)):
            properties = mitsuba.Properties()
            reflectance = [factor * c for c in colour(material)]
            properties["bsdf"] = mitsuba.load_dict(
                {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": reflectance}}}
            )
            mesh = mitsuba.Mesh(f"part {number}", len(positions), len(indices), props=properties)
            parameters = mitsuba.traverse(mesh)
            parameters["vertex_positions"] = positions.astype(np.float32).ravel()
            parameters["faces"] = indices.astype(np.uint32).ravel()
            parameters.update()
            self.shapes[f"part{number}"] = mesh

    def sensor(self, view):
        mi = self.mi
        key = view["keyframes"][0]
        return {
            "type": "perspective",
            "fov": float(view["fov_y_degrees"]),
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(key["position"], key["target"], view.get("up", [0, 1, 0])),
            "film": {
                "type": "hdrfilm",
                "width": SIZE[0],
                "height": SIZE[1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
                "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        }

    def scene(self, case, view, environment):
        mi = self.mi
        scene = {"type": "scene", "sensor": self.sensor(view), **self.shapes}
        about_y = mi.ScalarTransform4f().rotate
        kind, bounces = split(case)
        if kind in ("sun", "bounce"):
            toward = about_y([0, 1, 0], 2 if self.control == "sun" else 0).matrix
            scene["sun"] = {
                "type": "directional",
                "direction": (np.array(toward)[:3, :3] @ -SUN).tolist(),
                "irradiance": {"type": "rgb", "value": (np.pi * SUN_INTENSITY * SUN_COLOR).tolist()},
            }
        if kind in ("environment", "bounce"):
            # Both look at an image's middle along -Z (this program) and +Z turned by half (Mitsuba).
            turn = about_y([0, 1, 0], 180 + (90 if self.control == "environment" else 0))
            scene["environment"] = {"type": "envmap", "filename": str(environment), "to_world": turn}
        if case == "ao":
            scene["environment"] = {"type": "constant", "radiance": 1.0}
        scene["integrator"] = {"type": "path", "max_depth": 2 + bounces, "rr_depth": 1000}
        return mi.load_dict(scene)

    def render(self, scene, number):
        """The picture of batch `number` of BATCH samples."""
        return np.array(self.mi.render(scene, spp=BATCH, seed=number)).astype(np.float64)


def complete(path, write):
    """Has `path` written elsewhere first, so that it is there whole or not at all."""
    unfinished = path.with_name(f"unfinished-{path.name}")
    write(unfinished)
    os.replace(unfinished, path)


def theirs(make_reference, case, view, environment, spp, base):
    """The mean picture of `spp` samples, the means of its batches, and seconds.

    Goes on from what `base`.npz holds, and keeps it there.
    """
    kept = base.with_name(f"{base.name}.npz")
    pictures, total, means, seconds = None, np.zeros((SIZE[1], SIZE[0], 3)), [], 0.0
    if kept.exists():
        with np.load(kept) as state:
            total, means, seconds = state["total"], list(state["means"]), float(state["seconds"])
    for number in range(len(means), spp // BATCH):
        if pictures is None:
            reference = make_reference()
            pictures = reference.scene(case, view, environment)
        start = time.process_time()
        picture = reference.render(pictures, number)
        seconds += time.process_time() - start
        total += picture
        means.append(picture.mean())
        complete(kept, lambda path: np.savez(path, total=total, means=means, seconds=seconds))
        print(f"\rMitsuba, {base.name}: {BATCH * len(means)} of {spp}", end="", file=sys.stderr)
    if pictures is not None:
        print(file=sys.stderr)
    return total / len(means), np.array(means), seconds


LIGHT = {
    "sun": ["--effects", "shadow", "--sky-intensity", "0", "--sun-angle", "0", "--sun-intensity", str(SUN_INTENSITY)],
    "environment": ["--effects", "shadow,environment", "--sun-intensity", "0"],
    "ao": ["--effects", "ao", "--sun-intensity", "0", "--ao-rays", "1", "--ao-length", str(AO_LENGTH)]
    + ["--rotation", "full"],
    "bounce": ["--effects", "shadow,environment,diffuse", "--sun-angle", "0", "--sun-intensity", str(SUN_INTENSITY)]
    + ["--diffuse-rays", "1", "--rotation", "full"],
}


def processor_time():
    """Seconds of processor time that programs started from here took."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def ours(binary, bricks, case, view, environment, white, spp, folder):
    """The picture of `brickwalk walk`, and the seconds that it took; made if `folder` has none."""
    picture, took = folder / "frames" / "0000.exr", folder / "seconds"
    if not took.exists():
        words = [binary, "walk", bricks, "-o", folder, "--path", view, "--frames", "1"]
        words += ["--size", f"{SIZE[0]}x{SIZE[1]}", "--quality", "exact"]
        kind, bounces = split(case)
        words += ["--spp", str(spp), "--aov", "--cache", "100%", *LIGHT[kind]]
        if bounces > 1:
            words += ["--bounces", str(bounces)]
        if kind in ("environment", "bounce"):
            words += ["--environment", environment]
        if case == "ao":
            words += ["--environment", white]
        start = processor_time()
        subprocess.run([str(word) for word in words], check=True, stdout=sys.stderr)
        complete(took, lambda path: path.write_text(f"{processor_time() - start:.1f}\n"))
    return picture, float(took.read_text())


def read(mitsuba, path):
    # Of layers the first is the radiance.
    return np.array(mitsuba.Bitmap(str(path)).split()[0][1])[..., :3].astype(np.float64)


def row(options, mine, reference, means):
    """The columns of the table from the pictures of this program and of Mitsuba, and the difference that is bounded."""
    import mitsuba

    a, b = (read(mitsuba, path) for path in (mine, reference))
    tiles = [x.reshape(9, 20, 16, 20, 3).mean(axis=(1, 3, 4)) for x in (a, b)]
    # Tiles that are all but black would divide by noise.
    bright = tiles[1] > 0.05 * b.mean()
    worst = np.abs(tiles[0] / np.maximum(tiles[1], 1e-9) - 1)[bright].max()
    words = [str(options.brickwalk), "compare", str(mine), str(reference), "--json"]
    flip = json.loads(subprocess.run(words, check=True, capture_output=True).stdout)["flip"]
    mean, pixels = a.mean() / b.mean() - 1, np.abs(a - b).mean() / b.mean()
    channels = a.mean(axis=(0, 1)) / b.mean(axis=(0, 1)) - 1
    channel = channels[np.abs(channels).argmax()]
    error = means.std(ddof=1) / len(means) ** 0.5 / means.mean() if len(means) > 1 else float("nan")
    columns = [
        f"{100 * mean:+.2f} ± {100 * error:.2f} %",
        f"{100 * channel:+.2f} %",
        f"{100 * worst:.1f} %",
        f"{100 * pixels:.1f} %",
    ]
    return [*columns, f"{flip:.4f}"], mean


def parse():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--scenes", type=pathlib.Path, required=True, help="folder with sponza/ and env/")
    arguments.add_argument(
        "--brickwalk",
        type=pathlib.Path,
        default=pathlib.Path("target/release/brickwalk"),
        help="default target/release/brickwalk",
    )
    arguments.add_argument(
        "--paths", type=pathlib.Path, default=pathlib.Path("paths"), help="folder of the views (default paths)"
    )
    arguments.add_argument(
        "-o", "--output", type=pathlib.Path, required=True, help="folder for pictures, made if missing"
    )
    arguments.add_argument("--spp", type=int, default=1024, help="samples a pixel of this program (default 1024)")
    arguments.add_argument(
        "--reference-spp", type=int, help="samples a pixel of Mitsuba, a multiple of 64 (default as --spp)"
    )
    every = "sun,environment,ao,bounce,bounce-4,bounce-8"
    arguments.add_argument("--cases", default=every, help=f"of these; bounce-N has N bounces (default {every})")
    arguments.add_argument("--views", default="1,3,5", help="numbers of paths/sponza_N.json (default 1,3,5)")
    arguments.add_argument(
        "--variant", choices=["scalar_rgb", "llvm_ad_rgb"], default="scalar_rgb", help="of Mitsuba (default scalar_rgb)"
    )
    control = "; ".join(f"{name}: {what} (cases {', '.join(cases)})" for name, (what, cases) in CONTROLS.items())
    arguments.add_argument(
        "--control",
        choices=list(CONTROLS),
        help="tell Mitsuba something wrong, which all means must show. "
        f"{control.replace('%', '%%')} (default: nothing)",
    )
    options = arguments.parse_args()
    options.reference_spp = options.reference_spp or options.spp
    options.cases, options.views = options.cases.split(","), options.views.split(",")
    if options.reference_spp % BATCH:
        arguments.error(f"--reference-spp must be a multiple of {BATCH}")
    unknown = {case for case in options.cases if split(case)[0] not in LIGHT or ("-" in case and split(case)[1] < 1)}
    if unknown:
        arguments.error(f"--cases: no case is named {', '.join(sorted(unknown))}")
    if options.control:
        options.cases = [case for case in options.cases if split(case)[0] in CONTROLS[options.control][1]]
    return options


def main():
    options = parse()
    import mitsuba

    mitsuba.set_variant(options.variant)
    out = options.output
    out.mkdir(parents=True, exist_ok=True)
    gltf, document, data = diffuse_sponza(options.scenes, out)
    bricks = out / "scene.bricks"
    if not bricks.exists():
        subprocess.run([str(options.brickwalk), "convert", str(gltf), "-o", str(bricks)], check=True, stdout=sys.stderr)
    environment = options.scenes / "env" / "venice_sunset_1k.hdr"
    white = out / "white.exr"
    mitsuba.Bitmap(np.ones((32, 64, 3), np.float32)).write(str(white))
    make_reference = functools.cache(lambda: Reference(document, data, options.control))
    print("| case | view | mean | channel | worst tile | pixels | FLIP | brickwalk, s | Mitsuba, s |", flush=True)
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    failed = 0
    for case in options.cases:
        for view in options.views:
            path = options.paths / f"sponza_{view}.json"
            folder = out / f"{case}-{view}-{options.spp}"
            mine, seconds = ours(options.brickwalk, bricks, case, path, environment, white, options.spp, folder)
            name = "-".join(filter(None, ["mitsuba", options.variant, options.control, case, view]))
            keyframes = json.loads(path.read_text())
            picture, means, reference_seconds = theirs(
                make_reference, case, keyframes, environment, options.reference_spp, out / name
            )
            reference = out / f"{name}.exr"
            mitsuba.Bitmap(picture.astype(np.float32)).write(str(reference))
            columns, mean = row(options, mine, reference, means)
            failed += (abs(mean) <= BOUND) == bool(options.control)
            columns = [case, view, *columns, f"{seconds:.0f}", f"{reference_seconds:.0f}"]
            print(f"| {' | '.join(columns)} |", flush=True)
    count = len(options.cases) * len(options.views)
    by = "more than" if options.control else "at most"
    print(f"{count - failed} of {count} means differ by {by} 1 %", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("interrupted; the same command goes on")
