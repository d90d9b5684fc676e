#!/usr/bin/env python3
"""The same picture by brickwalk, by Blender's Cycles and by Mitsuba 3, in turns: seconds, memory and noise.

    python3.11 -m venv V && V/bin/pip install bpy==4.2.0 mitsuba numpy
    V/bin/python benches/peer/picture.py --scenes DIR [--turns 3] [--only city,plant,sponza] [--out target/picture]

The picture: 640x360, 16 samples, a sun 0.53 degrees wide, a sky of radiance 1, one bounce, Lambertian surfaces of
albedo 0.7. Scenes: a generated city and plant of 5M triangles, seen as their near paths begin, and Sponza without
textures (DIR/sponza), view 3 of paths/. All read the same PLY. Every frame has a seed of its own. The first frame of a
process loads bricks and builds trees, and is left out. A turn runs every program once; columns are medians over frames.

Noise is the variance of a pixel over its squared mean, from pairs of frames: `noise` is the mean over pixels, in which
the frames' mean is held to 1e-3 from below. `work` is seconds times noise. Rows go to OUT/rows.jsonl.
On Debian bpy needs libxrender1 libxi6 libxxf86vm1 libxfixes3 libgl1 libxkbcommon0 libsm6 libice6.
"""

import argparse
import importlib.util
import json
import math
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]


def load(path):
    """A program as a module, under a name that hides no package."""
    spec = importlib.util.spec_from_file_location(f"{path.stem}_program", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# The sun, and how glTF is read.
REFERENCE = load(ROOT / "tools" / "mitsuba.py")
SIZE = (640, 360)
SAMPLES = 16
SUN = REFERENCE.SUN.tolist()
SUN_DEGREES = 0.53
# So much irradiance of the sun, luminance.
SUN_IRRADIANCE = 2.4
SUN_INTENSITY = SUN_IRRADIANCE / math.pi / sum(a * b for a, b in zip((0.2126, 0.7152, 0.0722), REFERENCE.SUN_COLOR))
IRRADIANCE = [math.pi * SUN_INTENSITY * c for c in REFERENCE.SUN_COLOR.tolist()]
ALBEDO = 0.7
PROGRAMS = ("brickwalk", "brickwalk, 20 %", "Cycles", "Mitsuba")
FRAMES = 3


def view_of(path):
    """Position, target, up and the vertical field of view in degrees of a camera path's first frame."""
    words = json.loads(pathlib.Path(path).read_text())
    first = words["keyframes"][0]
    return first["position"], first["target"], words["up"], words["fov_y_degrees"]


def as_cycles(ply, path, out):
    """Renders the frames with Cycles; seconds of each."""
    import bpy
    from mathutils import Matrix, Vector

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.ply_import(filepath=str(ply), forward_axis="Y", up_axis="Z")
    scene, model = bpy.context.scene, bpy.context.object
    material = bpy.data.materials.new("matt")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    diffuse, surface = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (ALBEDO, ALBEDO, ALBEDO, 1)
    links.new(diffuse.outputs["BSDF"], surface.inputs["Surface"])
    model.data.materials.append(material)

    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    lamp = bpy.data.lights.new("sun", "SUN")
    lamp.angle = math.radians(SUN_DEGREES)
    lamp.energy, lamp.color = max(IRRADIANCE), [c / max(IRRADIANCE) for c in IRRADIANCE]
    sun = bpy.data.objects.new("sun", lamp)
    sun.rotation_mode, sun.rotation_quaternion = "QUATERNION", Vector(SUN).to_track_quat("Z", "Y")
    scene.collection.objects.link(sun)

    position, target, up, fov = view_of(path)
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.angle = "VERTICAL", math.radians(fov)
    camera = bpy.data.objects.new("camera", lens)
    scene.collection.objects.link(camera)
    scene.camera = camera
    back = (Vector(position) - Vector(target)).normalized()
    right = Vector(up).cross(back).normalized()
    rows = zip(right, back.cross(right), back, position)
    camera.matrix_world = Matrix([*(tuple(row) for row in rows), (0, 0, 0, 1)])

    render, cycles = scene.render, scene.cycles
    render.engine, render.use_persistent_data = "CYCLES", True
    render.resolution_x, render.resolution_y, render.resolution_percentage = *SIZE, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles.device, cycles.samples, cycles.use_adaptive_sampling = "CPU", SAMPLES, False
    cycles.use_denoising, cycles.use_light_tree = False, False
    cycles.max_bounces = cycles.diffuse_bounces = 1
    seconds = []
    for frame in range(FRAMES):
        cycles.seed, render.filepath = frame, str(out / f"{frame}.exr")
        start = time.monotonic()
        bpy.ops.render.render(write_still=True)
        seconds.append(time.monotonic() - start)
    return seconds


def as_mitsuba(ply, path, out):
    """Renders the frames with Mitsuba's path tracer; seconds of each."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    position, target, up, fov = view_of(path)
    camera = mitsuba.ScalarTransform4f().look_at(position, target, up)
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "pixel_format": "rgb", "rfilter": {"type": "box"}}
    matt = {"type": "diffuse", "reflectance": {"type": "rgb", "value": ALBEDO}}
    scene = mitsuba.load_dict({
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3, "rr_depth": 100},
        "camera": {
            "type": "perspective", "fov_axis": "y", "fov": fov, "to_world": camera, "film": film,
            "sampler": {"type": "independent", "sample_count": SAMPLES},
        },
        "model": {
            "type": "ply", "filename": str(ply), "face_normals": True, "bsdf": {"type": "twosided", "matt": matt},
        },
        "sky": {"type": "constant", "radiance": 1.0},
        "sun": {
            "type": "directional", "direction": [-c for c in SUN],
            "irradiance": {"type": "rgb", "value": IRRADIANCE},
        },
    })
    seconds = []
    for frame in range(FRAMES):
        start = time.monotonic()
        picture = mitsuba.render(scene, spp=SAMPLES, seed=frame)
        mitsuba.Bitmap(picture).write(str(out / f"{frame}.exr"))
        seconds.append(time.monotonic() - start)
    return seconds


def as_brickwalk(brickwalk, bricks, path, sky, cache, out):
    """Renders the frames with `walk`; seconds of the passes of each, and the peak of its memory in bytes."""
    still = out / "path.json"
    words = json.loads(pathlib.Path(path).read_text())
    first = words["keyframes"][0]
    words["keyframes"] = [{**first, "time": 0.0}, {**first, "time": 1.0}]
    still.write_text(json.dumps(words))
    line = [brickwalk, "walk", bricks, "-o", out / "walk", "--path", still, "--frames", FRAMES, "--quiet", "--aov"]
    line += ["--size", f"{SIZE[0]}x{SIZE[1]}", "--spp", SAMPLES, "--adapter", "cpu", "--quality", "exact"]
    line += ["--effects", "shadow,environment,diffuse", "--diffuse-rays", 1, "--rotation", "full"]
    line += ["--environment", sky, "--sun-intensity", SUN_INTENSITY, "--sun-angle", SUN_DEGREES, "--cache", cache]
    subprocess.run([str(word) for word in line], check=True)
    seconds = [0.0] * FRAMES
    for row in (out / "walk" / "records.jsonl").read_text().splitlines():
        record = json.loads(row)
        seconds[record["frame"]] += record["ms"] / 1000
    for frame in range(FRAMES):
        shutil.move(out / "walk" / "frames" / f"{frame:04}.exr", out / f"{frame}.exr")
    peak = json.loads((out / "walk" / "summary.json").read_text())["memory"]["peak_bytes"]
    shutil.rmtree(out / "walk")
    return seconds, peak


def write_sky(path):
    """An environment of radiance 1 from everywhere, in the format of Radiance."""
    width, height = 64, 32
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    path.write_bytes(header.encode() + bytes([128, 128, 128, 129]) * (width * height))


def write_sponza(gltf, ply):
    """The triangles of a glTF file with a buffer of its own, placed, as PLY."""
    import numpy

    document = json.loads(gltf.read_text())
    data = (gltf.parent / document["buffers"][0]["uri"]).read_bytes()
    points, corners, count = [], [], 0
    for positions, indices, _ in REFERENCE.meshes(document, data):
        points.append(positions)
        corners.append(indices.astype("<u4") + count)
        count += len(positions)
    points, corners = numpy.concatenate(points).astype("<f4"), numpy.concatenate(corners)
    faces = numpy.empty(len(corners), [("count", "u1"), ("corners", "<u4", 3)])
    faces["count"], faces["corners"] = 3, corners
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {len(faces)}\nproperty list uchar uint vertex_indices\nend_header\n"
    ply.write_bytes(header.encode() + points.tobytes() + faces.tobytes())


def prepare(name, options):
    """The scene's PLY, bricks and path; made where they are missing."""
    folder = options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    ply, bricks, path = folder / "scene.ply", folder / "scene.bricks", folder / "scene.near.json"
    if name == "sponza":
        path = ROOT / "paths" / "sponza_3.json"
        if not ply.exists():
            write_sponza(options.scenes / "sponza" / "Sponza.gltf", ply)
    elif not ply.exists():
        kind = {"city": "city", "plant": "pipes"}[name]
        subprocess.run([options.brickwalk, "scene", kind, "--triangles", "5M", "-o", ply, "--quiet"], check=True)
    if not bricks.exists():
        subprocess.run([options.brickwalk, "convert", ply, "-o", bricks, "--quiet"], check=True)
    return ply, bricks, path


def render(program, name, options):
    """Seconds of the frames of a program, and its peak of memory in bytes; the frames are in the folder."""
    ply, bricks, path = prepare(name, options)
    folder = options.out / name / program.replace(", ", "-").replace(" %", "")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    if program.startswith("brickwalk"):
        sky = options.out / "sky.hdr"
        write_sky(sky)
        cache = "20%" if "20" in program else "100%"
        return folder, *as_brickwalk(options.brickwalk, bricks, path, sky, cache, folder)
    line = [sys.executable, __file__, "--as", program, ply, path, folder]
    run = subprocess.run([str(word) for word in line], check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    answer = json.loads(run.stdout.decode().splitlines()[-1])
    return folder, answer["seconds"], answer["peak_bytes"]


def pictures(folder):
    """The frames after the first, radiance by pixel."""
    import mitsuba
    import numpy

    mitsuba.set_variant("scalar_rgb")
    # Of layers the first is the radiance.
    read = [mitsuba.Bitmap(str(folder / f"{frame}.exr")).split()[0][1] for frame in range(1, FRAMES)]
    return [numpy.array(picture)[..., :3].astype(float) for picture in read]


def noise(a, b):
    """Variance of pixels over their squared mean."""
    mean = ((a + b) / 2).mean(axis=2)
    return ((((a - b) ** 2) / 2).mean(axis=2) / (mean**2 + 1e-3)).mean()


def measure(options):
    rows = options.out / "rows.jsonl"
    rows.unlink(missing_ok=True)
    for turn in range(options.turns):
        for name in options.only.split(","):
            for program in PROGRAMS:
                folder, seconds, peak = render(program, name, options)
                a, b = pictures(folder)
                row = {"turn": turn, "scene": name, "program": program, "seconds": seconds, "peak_bytes": peak}
                row |= {"mean": (a.mean() + b.mean()) / 2, "noise": noise(a, b)}
                with rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
                print(f"turn {turn + 1} of {options.turns}: {name}, {program}", file=sys.stderr)
    return [json.loads(line) for line in rows.read_text().splitlines()]


def table(rows):
    print("| scene | program | s a frame | first frame | MB | mean | noise | work | ÷ the better peer |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in dict.fromkeys(row["scene"] for row in rows):
        columns = {}
        for program in PROGRAMS:
            own = [row for row in rows if (row["scene"], row["program"]) == (name, program)]
            median = lambda key: statistics.median(key(row) for row in own)
            seconds = statistics.median(s for row in own for s in row["seconds"][1:])
            columns[program] = (seconds, median(lambda row: row["seconds"][0]), median(lambda row: row["peak_bytes"]),
                                median(lambda row: row["mean"]), median(lambda row: row["noise"]))
        better = min(columns[program][0] * columns[program][4] for program in ("Cycles", "Mitsuba"))
        for program, (seconds, first, peak, mean, spread) in columns.items():
            work = seconds * spread
            print(f"| {name} | {program} | {seconds:.2f} | {first:.2f} | {peak / 1e6:.0f} | {mean:.4f} | {spread:.4f} "
                  f"| {work:.3f} | {work / better:.2f} |")


def parse():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--scenes", type=pathlib.Path, help="folder with sponza/Sponza.gltf")
    arguments.add_argument("--brickwalk", type=pathlib.Path, default=ROOT / "target" / "release" / "brickwalk",
                           help="the program [default: target/release/brickwalk]")
    arguments.add_argument("--turns", type=int, default=3, help="how often every program runs [default: 3]")
    arguments.add_argument("--only", default="city,plant,sponza", help="scenes [default: city,plant,sponza]")
    arguments.add_argument("--out", type=pathlib.Path, default=ROOT / "target" / "picture",
                           help="folder of scenes, pictures and rows [default: target/picture]")
    arguments.add_argument("--as", nargs=4, dest="peer", metavar=("PROGRAM", "PLY", "PATH", "OUT"), help="of use here")
    options = arguments.parse_args()
    if options.peer is None and options.scenes is None and "sponza" in options.only:
        arguments.error("--scenes is missing; name the folder with sponza/Sponza.gltf, or leave it out with --only")
    return options


def main():
    options = parse()
    if options.peer:
        program, ply, path, out = options.peer
        seconds = {"Cycles": as_cycles, "Mitsuba": as_mitsuba}[program](ply, path, pathlib.Path(out))
        peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        print("\n" + json.dumps({"seconds": seconds, "peak_bytes": peak}))
        return
    options.out.mkdir(parents=True, exist_ok=True)
    table(measure(options))


if __name__ == "__main__":
    main()
