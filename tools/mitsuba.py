#!/usr/bin/env python3
"""Compares converged pictures with Mitsuba 3, an independent path tracer, on the same geometry with diffuse materials.

    pip install mitsuba numpy
    tools/mitsuba.py --scenes ../shared/scenes --brickwalk target/release/brickwalk -o DIR [--spp 1024]

The scene is Sponza with a colour a material and neither textures nor normals, so that both shade the same surfaces. Cases: the
sun alone, an environment alone, ambient occlusion, sun and environment with one bounce; three views of paths/. Every picture is kept in
DIR and not made twice, so that a run that was interrupted is gone on with. The table says, picture by picture: the relative error of the
mean, of the mean of the worst tile of 20 x 20 pixels, of pixels on the average, and HDR-FLIP (`brickwalk compare`); all but the first have
the noise of both pictures in them.
"""

import argparse
import json
import pathlib
import subprocess
import sys

import numpy as np

SIZE = (320, 180)
# As long as the scene: occlusion is then what a sky of one brightness leaves.
AO_LENGTH = 1000.0
SUN = np.array([0.4, 0.8, 0.45])
# What a white surface that faces the sun reflects of it at intensity 1 (src/render/light.rs).
SUN_COLOR = np.array([0.60, 0.56, 0.48])
SUN_INTENSITY = 2.4
COMPONENT = {5126: np.float32, 5125: np.uint32, 5123: np.uint16}


def colour(index):
    """An albedo a material, 0.2 to 0.8."""
    return [round(0.2 + 0.6 * ((0.5 + index * g) % 1.0), 4) for g in (0.8191725, 0.6710436, 0.5497005)]


def diffuse_sponza(scenes, out):
    """Sponza's geometry with a colour a material, as a glTF file in `out`."""
    source = scenes / "sponza"
    document = json.loads((source / "Sponza.gltf").read_text())
    for key in ("textures", "images", "samplers", "extensionsUsed", "extensionsRequired"):
        document.pop(key, None)
    document["materials"] = [
        {
            "doubleSided": True,
            "pbrMetallicRoughness": {"baseColorFactor": colour(i) + [1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0},
        }
        for i in range(len(document["materials"]))
    ]
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
    width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
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
    """Mitsuba's pictures."""

    def __init__(self, document, data):
        import mitsuba

        mitsuba.set_variant("scalar_rgb")
        self.mi = mitsuba
        self.shapes = {}
        for number, (positions, indices, material) in enumerate(meshes(document, data)):
            properties = mitsuba.Properties()
            properties["bsdf"] = mitsuba.load_dict(
                {
                    "type": "twosided",
                    "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": colour(material)}},
                }
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

    def render(self, case, view, environment, spp):
        mi = self.mi
        scene = {"type": "scene", "sensor": self.sensor(view), **self.shapes}
        if case in ("sun", "bounce"):
            irradiance = (np.pi * SUN_INTENSITY * SUN_COLOR).tolist()
            scene["sun"] = {
                "type": "directional",
                "direction": (-SUN).tolist(),
                "irradiance": {"type": "rgb", "value": irradiance},
            }
        if case in ("environment", "bounce"):
            # Both look at an image's middle along -Z (this program) and +Z turned by half (Mitsuba).
            turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
            scene["environment"] = {"type": "envmap", "filename": str(environment), "to_world": turn}
        if case == "ao":
            scene["environment"] = {"type": "constant", "radiance": 1.0}
        depth = {"sun": 2, "environment": 2, "ao": 2, "bounce": 3}[case]
        scene["integrator"] = {"type": "path", "max_depth": depth, "rr_depth": 1000}
        scene = mi.load_dict(scene)
        total = np.zeros((SIZE[1], SIZE[0], 3))
        batch = 64
        for first in range(0, spp, batch):
            picture = np.array(mi.render(scene, spp=batch, seed=1 + first))
            total += picture.astype(np.float64) * batch
            print(f"\rMitsuba, {case}: {first + batch} of {spp}", end="", file=sys.stderr)
        print(file=sys.stderr)
        return (total / spp).astype(np.float32)


LIGHT = {
    "sun": ["--effects", "shadow", "--sky-intensity", "0", "--sun-angle", "0", "--sun-intensity", str(SUN_INTENSITY)],
    "environment": ["--effects", "shadow,environment", "--sun-intensity", "0"],
    "ao": ["--effects", "ao", "--sun-intensity", "0", "--ao-rays", "1", "--ao-length", str(AO_LENGTH), "--rotation", "full"],
    "bounce": ["--effects", "shadow,environment,diffuse", "--sun-angle", "0", "--sun-intensity", str(SUN_INTENSITY)]
    + ["--diffuse-rays", "1", "--rotation", "full"],
}


def ours(binary, bricks, case, view, environment, white, spp, folder):
    """The picture of `brickwalk walk`."""
    words = [binary, "walk", bricks, "-o", folder, "--path", view, "--frames", "1", "--size", f"{SIZE[0]}x{SIZE[1]}"]
    words += ["--spp", str(spp), "--aov", "--cache", "100%", *LIGHT[case]]
    if case in ("environment", "bounce"):
        words += ["--environment", environment]
    if case == "ao":
        words += ["--environment", white]
    subprocess.run([str(word) for word in words], check=True)
    return folder / "frames" / "0000.exr"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--scenes", type=pathlib.Path, required=True, help="folder with sponza/ and env/")
    arguments.add_argument("--brickwalk", type=pathlib.Path, default=pathlib.Path("target/release/brickwalk"))
    arguments.add_argument("--paths", type=pathlib.Path, default=pathlib.Path("paths"))
    arguments.add_argument("-o", "--output", type=pathlib.Path, required=True)
    arguments.add_argument("--spp", type=int, default=1024, help="samples a pixel, a multiple of 16 (default 1024)")
    arguments.add_argument("--cases", default="sun,environment,ao,bounce", help="of these (default all)")
    arguments.add_argument("--views", default="1,3,5", help="numbers of paths/sponza_N.json (default 1,3,5)")
    options = arguments.parse_args()
    out = options.output
    out.mkdir(parents=True, exist_ok=True)
    gltf, document, data = diffuse_sponza(options.scenes, out)
    bricks = out / "scene.bricks"
    if not bricks.exists():
        subprocess.run([str(options.brickwalk), "convert", str(gltf), "-o", str(bricks)], check=True)
    environment = options.scenes / "env" / "venice_sunset_1k.hdr"
    reference = None
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    white = out / "white.exr"
    mitsuba.Bitmap(np.ones((32, 64, 3), np.float32)).write(str(white))
    print("| case | view | mean | worst tile | pixels | FLIP |\n| --- | --- | --- | --- | --- | --- |")
    for case in options.cases.split(","):
        for view in options.views.split(","):
            path = options.paths / f"sponza_{view}.json"
            name = f"{case}-{view}-{options.spp}"
            theirs = out / f"{name}-mitsuba.exr"
            if not theirs.exists():
                reference = reference or Reference(document, data)
                picture = reference.render(case, json.loads(path.read_text()), environment, options.spp)
                mitsuba.Bitmap(picture).write(str(theirs))
            folder = out / name
            mine = folder / "frames" / "0000.exr"
            if not mine.exists():
                ours(options.brickwalk, bricks, case, path, environment, white, options.spp, folder)
            # Of layers the first is the radiance.
            a, b = (np.array(mitsuba.Bitmap(str(p)).split()[0][1])[..., :3].astype(np.float64) for p in (mine, theirs))
            tiles = [x.reshape(9, 20, 16, 20, 3).mean(axis=(1, 3, 4)) for x in (a, b)]
            # Tiles that are all but black would divide by noise.
            bright = tiles[1] > 0.05 * b.mean()
            worst = np.abs(tiles[0] / np.maximum(tiles[1], 1e-9) - 1)[bright].max()
            compared = subprocess.run(
                [str(options.brickwalk), "compare", str(mine), str(theirs), "--json"], check=True, capture_output=True
            )
            flip = json.loads(compared.stdout)["flip"]
            mean, pixels = a.mean() / b.mean() - 1, np.abs(a - b).mean() / b.mean()
            print(f"| {case} | {view} | {100 * mean:+.2f} % | {100 * worst:.1f} % | {100 * pixels:.1f} % | {flip:.4f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
