"""Input files that the cases of tests/golden/matrix.txt name: the same bytes on every machine."""

import json
import math
import random
import struct
import zlib


def write(folder):
    """All of them."""
    folder.mkdir()
    gallery(folder)
    floor(folder)
    environment(folder / "sky.hdr")
    rays(folder / "rays.npy")


def noise(x, y, seed):
    """A byte triple a texel."""
    word = (x // 2 * 7919 + y // 3 * 104_729 + 31 * seed) * 0x9E3779B1 & 0xFFFFFFFF
    return [word >> shift & 0xFF for shift in (24, 16, 8)]


def png(path, width, height, texel, channels=3):
    """Stored, not deflated: the bytes do not depend on the version of zlib."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    lines = b"".join(b"\0" + bytes(v for x in range(width) for v in texel(x, y)) for y in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines, 0)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + parts)


def floor(folder):
    """A floor of 40 x 40 metres with four pictures, a camera path and a resting camera over it."""
    obj, mtl = ["mtllib floor.mtl"], []
    for at in range(81):
        x, z = at % 9 * 5, at // 9 * 5
        obj += [f"v {x} 0 {z}", f"vt {x / 60:.6f} {z / 60:.6f}"]
    for picture in range(4):
        mtl += [f"newmtl m{picture}", f"map_Kd floor{picture}.png"]
        obj += [f"usemtl m{picture}"]
        for at in range(72):
            if at % 9 < 8 and (at % 9 + at // 9) % 4 == picture:
                a, b, c, d = at + 1, at + 2, at + 10, at + 11
                obj += [f"f {a}/{a} {c}/{c} {b}/{b}", f"f {b}/{b} {c}/{c} {d}/{d}"]
        png(folder / f"floor{picture}.png", 300, 200, lambda x, y, picture=picture: noise(x, y, picture))
    (folder / "floor.obj").write_text("\n".join(obj) + "\n")
    (folder / "floor.mtl").write_text("\n".join(mtl) + "\n")
    still = {"time": 0, "position": [3, 4, 3], "target": [20, 0, 20]}
    write_path(folder / "floor.json", 50, [still, {"time": 1, "position": [30, 3, 12], "target": [20, 0, 26]}])
    write_path(folder / "still.json", 50, [still])


def write_path(path, fov, keyframes):
    path.write_text(json.dumps({"fov_y_degrees": fov, "up": [0, 1, 0], "keyframes": keyframes}))


def exact(value):
    """On a grid of 2^-10: no last bit of a sine matters."""
    return round(value * 1024) / 1024


class Gltf:
    """A document with one buffer."""

    def __init__(self):
        self.bytes, self.views, self.accessors = bytearray(), [], []

    def add(self, values, kind, component):
        code, size = {5126: ("f", 4), 5123: ("H", 2)}[component]
        width = {"VEC2": 2, "VEC3": 3, "SCALAR": 1}[kind]
        data = struct.pack(f"<{len(values)}{code}", *values)
        self.views.append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(values) * size})
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(values) // width,
            "type": kind,
        }
        if kind == "VEC3":
            accessor["min"] = [min(values[axis::3]) for axis in range(3)]
            accessor["max"] = [max(values[axis::3]) for axis in range(3)]
        self.accessors.append(accessor)
        self.bytes += data + bytes(-len(data) % 4)
        return len(self.accessors) - 1

    def grid(self, columns, rows, point, normal, repeat=1):
        """Attributes and indices of a grid of points by u and v in 0..1."""
        at = [(i / columns, j / rows) for j in range(rows + 1) for i in range(columns + 1)]
        positions = [exact(x) for u, v in at for x in point(u, v)]
        normals = [x for u, v in at for x in unit(normal(u, v))]
        uvs = [repeat * x for pair in at for x in pair]
        indices, row = [], columns + 1
        for p in (i + j * row for j in range(rows) for i in range(columns)):
            indices += [p, p + row, p + 1, p + 1, p + row, p + row + 1]
        names = {"POSITION": (positions, "VEC3"), "NORMAL": (normals, "VEC3"), "TEXCOORD_0": (uvs, "VEC2")}
        attributes = {name: self.add(values, kind, 5126) for name, (values, kind) in names.items()}
        return {"attributes": attributes, "indices": self.add(indices, "SCALAR", 5123)}


def unit(normal):
    """In f32 after rounding components, as near 1 as an importer asks."""
    x, y, z = (round(n * 65536) / 65536 for n in normal)
    length = math.sqrt(x * x + y * y + z * z)
    return [round(n / length * 2**22) / 2**22 for n in (x, y, z)]


def sheet(corner, u_edge, v_edge):
    """Points and normal of a parallelogram."""
    (a, b, c), (d, e, f) = u_edge, v_edge
    # Triangles go p, p + v, p + u.
    normal = (e * c - f * b, f * a - d * c, d * b - e * a)

    def point(u, v):
        return [corner[k] + u * u_edge[k] + v * v_edge[k] for k in range(3)]

    return point, lambda u, v: normal


def ball(u, v):
    """A point of the unit sphere."""
    turn, rise = 2 * math.pi * u, math.pi * v
    return [math.cos(turn) * math.sin(rise), math.cos(rise), -math.sin(turn) * math.sin(rise)]


def gallery(folder):
    """Spheres of metal, lacquer and matt, four of them instances; sheets with alpha; a panel that shines; lights."""
    png(folder / "colour.png", 128, 128, lambda x, y: noise(x, y, 1))
    png(folder / "normal.png", 64, 64, lambda x, y: [128 + (x * 5 % 32) - 16, 128 + (y * 3 % 32) - 16, 250])
    png(folder / "rough.png", 64, 64, lambda x, y: [0, 40 + (x * 3 + y) % 200, 255 * (x // 8 % 2)])
    png(folder / "fade.png", 64, 32, lambda x, y: noise(x, y, 2) + [min(255, x * 4 + (y % 4) * 8)], channels=4)

    def material(name, metallic, roughness, colour=(0.8, 0.8, 0.8, 1), **more):
        pbr = {"baseColorFactor": list(colour), "metallicFactor": metallic, "roughnessFactor": roughness}
        pbr |= {key: {"index": index} for key, index in more.pop("textures", {}).items()}
        return {"name": name, "pbrMetallicRoughness": pbr, **more}

    materials = [
        material(
            "floor",
            1,
            1,
            (1, 1, 1, 1),
            textures={"baseColorTexture": 0, "metallicRoughnessTexture": 2},
            normalTexture={"index": 1},
        ),
        material("matt", 0, 1, (0.75, 0.5, 0.25, 1)),
        material("metal", 1, 0.25, (0.9, 0.8, 0.6, 1)),
        material(
            "lacquer",
            0,
            0.5,
            (0.2, 0.3, 0.8, 1),
            extensions={"KHR_materials_clearcoat": {"clearcoatFactor": 1, "clearcoatRoughnessFactor": 0.1}},
        ),
        material("veil", 0, 1, (1, 1, 1, 0.75), textures={"baseColorTexture": 3}, alphaMode="BLEND", doubleSided=True),
        material(
            "fence",
            0,
            1,
            (1, 1, 1, 1),
            textures={"baseColorTexture": 3},
            alphaMode="MASK",
            alphaCutoff=0.5,
            doubleSided=True,
        ),
        material(
            "panel",
            0,
            1,
            (0, 0, 0, 1),
            emissiveFactor=[1, 0.75, 0.5],
            doubleSided=True,
            extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 4}},
        ),
        material("glass", 0, 0.05, (0.5, 0.75, 0.5, 0.5), alphaMode="BLEND", doubleSided=True),
    ]
    document = Gltf()

    def mesh(name, primitive, which):
        return {"name": name, "primitives": [primitive | {"material": which}]}

    def flat(corner, u_edge, v_edge, squares=4, repeat=1):
        return document.grid(squares, squares, *sheet(corner, u_edge, v_edge), repeat)

    sphere = document.grid(32, 24, ball, ball)
    meshes = [
        mesh("floor", flat([-6, 0, -6], [12, 0, 0], [0, 0, 12], 24, 3), 0),
        mesh("wall", flat([-6, 0, -6], [0, 6, 0], [12, 0, 0], 12), 1),
        mesh("matt", sphere, 1),
        mesh("metal", sphere, 2),
        mesh("lacquer", sphere, 3),
        mesh("veil", flat([-3, 0, 2], [2, 0, 0.5], [0, 2, 0]), 4),
        mesh("fence", flat([0.5, 0, 2.5], [2, 0, -0.5], [0, 2, 0]), 5),
        mesh("panel", flat([-2, 4, -4], [3, 0, 0], [0, 0, 2], 2), 6),
        mesh("glass", flat([-1, 0, 1.5], [1.5, 0, 0], [0, 1.5, 0], 2), 7),
    ]
    nodes = [
        {"name": one["name"], "mesh": index}
        for index, one in enumerate(meshes)
        if one["name"] not in ("matt", "metal", "lacquer")
    ]
    half = math.sqrt(0.5)
    nodes += [
        {"name": "ball 0", "mesh": 2, "translation": [-3, 1, -1]},
        {
            "name": "ball 1",
            "mesh": 2,
            "translation": [3, 0.75, -2],
            "rotation": [0, half, 0, half],
            "scale": [0.75, 0.75, 0.75],
        },
        {
            "name": "ball 2",
            "mesh": 2,
            "translation": [4, 1, 1.5],
            "rotation": [0.6, 0, 0, 0.8],
            "scale": [0.5, 1, 0.75],
        },
        {
            "name": "ball 3",
            "mesh": 2,
            "translation": [-1.5, 0.5, 3.5],
            "rotation": [0.5, 0.5, 0.5, 0.5],
            "scale": [-0.5, 0.5, 0.5],
        },
        {"name": "metal ball", "mesh": 3, "translation": [0, 1, -1]},
        {"name": "lacquer ball", "mesh": 4, "translation": [1.5, 0.75, 0.75], "scale": [0.75, 0.75, 0.75]},
        {"name": "bulb", "translation": [-2, 3, 2], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        {
            "name": "spot",
            "translation": [3, 4, 3],
            "rotation": [-half, 0, 0, half],
            "extensions": {"KHR_lights_punctual": {"light": 1}},
        },
        {"name": "moon", "rotation": [-0.6, 0, 0, 0.8], "extensions": {"KHR_lights_punctual": {"light": 2}}},
    ]
    lights = [
        {"type": "point", "color": [1, 0.75, 0.5], "intensity": 10},
        {"type": "spot", "intensity": 30, "range": 12, "spot": {"innerConeAngle": 0.25, "outerConeAngle": 0.75}},
        {"type": "directional", "color": [0.5, 0.5, 1], "intensity": 0.5},
    ]
    pictures = ("colour", "normal", "rough", "fade")
    used = ("KHR_materials_clearcoat", "KHR_materials_emissive_strength", "KHR_lights_punctual")
    (folder / "gallery.bin").write_bytes(document.bytes)
    text = json.dumps(
        {
            "asset": {"version": "2.0"},
            "extensionsUsed": list(used),
            "extensions": {"KHR_lights_punctual": {"lights": lights}},
            "scene": 0,
            "scenes": [{"nodes": list(range(len(nodes)))}],
            "nodes": nodes,
            "meshes": meshes,
            "materials": materials,
            "textures": [{"source": index} for index in range(len(pictures))],
            "images": [{"uri": f"{name}.png"} for name in pictures],
            "buffers": [{"uri": "gallery.bin", "byteLength": len(document.bytes)}],
            "bufferViews": document.views,
            "accessors": document.accessors,
        }
    )
    (folder / "gallery.gltf").write_text(text)
    first = {"time": 0, "position": [0.5, 2, 7], "target": [0, 1, 0]}
    write_path(folder / "gallery.json", 55, [first, {"time": 1, "position": [2.5, 2.5, 6], "target": [0, 1, 0]}])
    moves = [
        {"time": 0, "translation": [0, 0, 0]},
        {"time": 1, "translation": [0.5, 0.25, 0.5], "rotation": [0, 0.6, 0, 0.8], "scale": 1.125},
    ]
    (folder / "gallery.motion.json").write_text(json.dumps({"instances": [{"node": "ball 1", "keyframes": moves}]}))


def environment(path):
    """64 x 32 texels with a bright patch, Radiance RGBE without run lengths."""
    texels = bytearray()
    for y in range(32):
        for x in range(64):
            red, green, blue = noise(x, y, 3)
            is_bright = 40 <= x < 44 and 8 <= y < 11
            # 2, 2 at the start of a row would mean run lengths.
            texels += bytes([red | 128, green | 64, blue | 32, 133 if is_bright else 127 - y // 12])
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n" + bytes(texels))


def rays(path):
    """3000 rays about the middle of a city: long, short, and some with a range that is empty."""
    draw = random.Random(1)

    def ray(index):
        origin = [exact(draw.uniform(-60, 60)), exact(draw.uniform(0.5, 30)), exact(draw.uniform(-60, 60))]
        direction = [exact(draw.uniform(-1, 1)) for _ in range(3)]
        direction = direction if any(direction) else [0.0, -1.0, 0.0]
        t_min, t_max = [(0.0, math.inf), (0.0, 4.0), (2.5, 40.0), (3.0, 2.0)][index % 4]
        return [*origin, *direction, t_min, t_max]

    values = [x for index in range(3000) for x in ray(index)]
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3000, 8), }"
    header += " " * (-(len(header) + 11) % 64) + "\n"
    path.write_bytes(
        b"\x93NUMPY\x01\x00"
        + struct.pack("<H", len(header))
        + header.encode()
        + struct.pack(f"<{len(values)}d", *values)
    )
