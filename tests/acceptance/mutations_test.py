#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Damages files of every kind that the program reads and gives them to it: packages (under wrong and under right
checksums), meshes of every format, recipes, masks, scenes. Each run has to end in time with an exit code of the
contract, one line with a reason where the input is bad, nothing half written, and, where the program is built with
sanitizers, without a word of theirs. Seeds are fixed: a failure repeats. Standard library only.

    mutations_test.py --sinew PROGRAM [--rounds N] [--only KIND] [--keep DIR]
"""
import argparse
import base64
import json
import os
import pathlib
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
ASSETS = ROOT / "tests/assets"
sys.path.insert(0, str(ROOT / "tests/formats"))
import read_package  # noqa: E402

SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
SANITIZER_EXIT = 86
REPORTS = ("Sanitizer", "runtime error:")
PIECES = [b"-1", b"4294967295", b"99999999999999999999", b"nan", b"1e999", b"0", b"\n", b" ", b"/", b'"', b"{", b"]",
          b"-0.5", b"3", b"\0", b"\xff\xfe", b"<", b">"]


def damaged(random_, whole, binary=False):
    """One to four edits of bytes; of binary files mostly such as leave all else at its place."""
    data = bytearray(whole)
    for _ in range(random_.choice([1, 1, 2, 4])):
        if not data:
            break
        at = random_.randrange(len(data))
        edit = random_.randrange(2) if binary and random_.random() < 0.7 else random_.randrange(6)
        if edit == 0:
            data[at] = random_.randrange(256)
        elif edit == 1:
            data[at] ^= 1 << random_.randrange(8)
        elif edit == 2 and random_.random() < 0.3:
            del data[at + 1:]
        elif edit == 3:
            del data[at:at + random_.randint(1, 12)]
        elif edit == 4:
            data[at:at] = random_.choice(PIECES)
        else:
            piece = random_.choice(PIECES)
            data[at:at + len(piece)] = piece
    return bytes(data)


def resealed(random_, whole):
    """Numbers of a package changed, and the checksums made right again: what only the checks of content can find."""
    data = bytearray(whole)
    count = struct.unpack_from("<I", data, 32)[0]
    words = len(data) // 4
    table = (64 + 64 * count) // 4
    for _ in range(random_.randint(1, 3)):
        word = random_.randrange(table, words) if random_.random() < 0.8 else random_.randrange(16, table)
        value = struct.unpack_from("<I", data, 4 * word)[0]
        edit = random_.randrange(4)
        if edit == 0:
            value ^= 1 << random_.randrange(32)
        elif edit == 1:
            value = random_.choice([0, 1, 2, 0x7f800000, 0x7fc00000, 0x80000000, 0x7f7fffff, 0x00000001, 0xfffffffe,
                                    0xffffffff, 64, 0x10000])
        elif edit == 2:
            value = (value + random_.randint(-2, 2)) & 0xffffffff
        else:
            value = random_.getrandbits(32)
        struct.pack_into("<I", data, 4 * word, value)
    for k in range(count):
        entry = 64 + 64 * k
        offset, size = struct.unpack_from("<QQ", data, entry + 8)
        end = offset + (size + 63) // 64 * 64
        if offset <= end <= len(data):
            struct.pack_into("<Q", data, entry + 40, read_package.xxh3(bytes(data[offset:end])))
    struct.pack_into("<Q", data, 40, 0)
    struct.pack_into("<Q", data, 40, read_package.xxh3(bytes(data[:64 + 64 * count])))
    return bytes(data)


def nested(levels):
    return '[' * levels + ']' * levels


HOSTILE = [None, True, -1, 0, 1e308, -1e308, 5e-324, 2 ** 32, 2 ** 64, 2 ** 63, -2 ** 63, "", "*", "**", "\0", "../../etc/passwd",
           ".", "/dev/zero", "x" * 100000, [], {}, [[]], [0, 0, 0], [1e308, -1e308, 1e308], [[0, 0, 0], [0, 0, 0]], 0.5, 3]


def damaged_json(random_, whole):
    """The structure changed: values of other kinds and sizes, keys gone, named otherwise, twice, nesting without end."""
    if random_.random() < 0.25:
        return damaged(random_, whole)
    document = json.loads(whole)
    for _ in range(random_.choice([1, 1, 2])):
        places = []

        def walk(node):
            for key in (node if isinstance(node, dict) else range(len(node))):
                places.append((node, key))
                if isinstance(node[key], (dict, list)):
                    walk(node[key])

        walk(document)
        if not places:
            break
        node, key = random_.choice(places)
        edit = random_.randrange(8)
        if edit == 0:
            del node[key]
        elif edit == 1 and isinstance(node, dict):
            node[random_.choice(["", "name", "from", "or", "nmae", key + " ", key[1:]])] = node.pop(key)
        elif edit == 2:
            other, there = random_.choice(places)
            node[key] = json.loads(json.dumps(other[there]))
        elif edit == 3 and isinstance(node[key], (int, float)) and not isinstance(node[key], bool):
            node[key] *= random_.choice([-1, 1e-30, 1e30, 1e6, 0.1])
        elif edit == 4:
            node[key] = "DEEP"
        else:
            node[key] = random_.choice(HOSTILE)
    text = json.dumps(document)
    return text.replace('"DEEP"', nested(random_.choice([3, 200, 100000]))).encode()


# ---- Good files ----


def cube():
    """Corners and outward faces of a cube in 2 x 2 squares a side."""
    points, faces = [], []

    def point(p):
        if p not in points:
            points.append(p)
        return points.index(p)

    for axis in range(3):
        for side in (0, 2):
            for i in range(2):
                for j in range(2):
                    square = []
                    for a, b in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)):
                        p = [0, 0, 0]
                        p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3] = side, a, b
                        square.append(point(tuple(p)))
                    square = square if side else square[::-1]
                    faces += [(square[0], square[1], square[2]), (square[0], square[2], square[3])]
    return points, faces


def off_text():
    points, faces = cube()
    return "\n".join(["OFF", f"{len(points)} {len(faces)} 0"] + ["%g %g %g" % p for p in points] +
                     ["3 %d %d %d" % f for f in faces]) + "\n"


def gltf_text():
    points, faces = cube()
    positions = b"".join(struct.pack("<3f", *p) for p in points)
    uvs = b"".join(struct.pack("<2f", p[0] / 2, p[1] / 2) for p in points)
    colours = b"".join(struct.pack("<4B", 255, 127 * p[1], 0, 255) for p in points)
    joints, weights = b"\0\1\0\0" * len(points), struct.pack("<4f", 0.5, 0.5, 0, 0) * len(points)
    matrices = struct.pack("<16f", *(1.0 if i % 5 == 0 else 0.0 for i in range(16))) * 2
    indices = b"".join(struct.pack("<3H", *f) for f in faces)
    parts = [positions, uvs, colours, joints, weights, matrices, indices]
    views, offset = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(part)})
        offset += len(part)
    n = len(points)
    accessor = lambda view, kind, count, type_, **more: {"bufferView": view, "componentType": kind, "count": count, "type": type_, **more}
    accessors = [accessor(0, 5126, n, "VEC3", min=[0, 0, 0], max=[2, 2, 2]), accessor(1, 5126, n, "VEC2"),
                 accessor(2, 5121, n, "VEC4", normalized=True), accessor(3, 5121, n, "VEC4"), accessor(4, 5126, n, "VEC4"),
                 accessor(5, 5126, 2, "MAT4"), accessor(6, 5123, 3 * len(faces), "SCALAR")]
    data = b"".join(parts)
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "root", "children": [1, 2], "scale": [1, 2, 1]}, {"name": "cube", "mesh": 0, "skin": 0},
                  {"name": "bone", "children": [3], "translation": [0, 1, 0]}, {"name": "tip", "rotation": [0, 0, 0, 1]}],
        "skins": [{"joints": [2, 3], "inverseBindMatrices": 5}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.5, 1]}}],
        "meshes": [{"name": "cube", "extras": {"targetNames": ["smile"]}, "primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2, "JOINTS_0": 3, "WEIGHTS_0": 4},
             "indices": 6, "material": 0, "targets": [{"POSITION": 0}]}]}],
        "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
        "bufferViews": views, "accessors": accessors})


def dae_text():
    points, faces = cube()
    numbers = " ".join("%g %g %g" % p for p in points)
    corners = " ".join(f"{v} {v}" for f in faces for v in f)
    source = lambda name: (f'<source id="{name}"><float_array id="{name}-a" count="{3 * len(points)}">{numbers}</float_array><technique_common>'
                           f'<accessor source="#{name}-a" count="{len(points)}" stride="3"><param name="X" type="float"/>'
                           '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>')
    return ('<?xml version="1.0" encoding="utf-8"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
            '<asset><unit name="centimeter" meter="0.01"/><up_axis>Z_UP</up_axis></asset><library_geometries>'
            f'<geometry id="g" name="cube"><mesh>{source("p")}{source("n")}<vertices id="v"><input semantic="POSITION" source="#p"/>'
            f'</vertices><triangles count="{len(faces)}" material="m"><input semantic="VERTEX" source="#v" offset="0"/>'
            f'<input semantic="NORMAL" source="#n" offset="1"/><p>{corners}</p></triangles></mesh></geometry></library_geometries>'
            '<library_visual_scenes><visual_scene id="s"><node id="a"><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>'
            '<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>')


RECIPE = {
    "sinew_recipe": 2, "source": "l_bar.obj",
    "settings": {"tetrahedra.vertices": 200, "clusters.mode": "linear", "clusters.stretch_hz": 8},
    "masks": {
        "low": {"half_space": [0, 0.05, 0], "normal": [0, -1, 0], "falloff": 0.02},
        "soft": {"soften": "low", "by": 0.04},
        "ball": {"sphere": [0, 0, 0.3], "radius": 0.2, "falloff": 0.02},
        "line": {"capsule": [[0, 0, 0], [0.2, 0, 0]], "radius": 0.05},
        "both": {"and": ["low", {"not": "ball"}]}, "any": {"or": ["low", "ball", {"box": [[0, 0, 0], [0.1, 0.1, 0.1]]}]},
        "grown": {"grow": "ball", "by": 0.02}, "less": {"minus": ["soft", "ball"]},
        "other": {"mirror": "ball", "plane": "z", "point": [0, 0, 0.15]},
        "kept": {"stored": "kept.json", "mask": "cheek"}, "numbers": {"values": "numbers.json"},
        "brush": {"strokes": "brush.json"}, "half": {"scale": "soft", "by": 0.5}},
    "clusters": [{"name": "a", "from": {"or": ["both", "any", "grown", "less", "other", "kept", "numbers", "brush", "half", "line"]}, "overlap": 0.1, "channel": "pull", "fibre": [0, 1, 0],
                  "settings": {"mode": "rigid"}},
                 {"name": "b", "from": {"rest": True}, "split": 0.5}],
    "pins": [{"name": "foot", "from": "low", "method": "matrix", "target": "bone"}],
    "stiffness": [{"from": "ball", "value": 0.4}],
    "colors": [{"from": {"all": True}, "color": [0.6, 0.4, 0.3]}, {"from": "kept", "color": [1, 0, 0, 1]}]}

STORED = {"sinew_masks": 1, "points": [0, 0, 0, 0.1, 0, 0, 0, 0.1, 0, 0.8, 0, 0.3],
          "masks": {"cheek": {"points": [0, 1, 3], "weights": [1, 0.5, 0.25]}}}
STROKES = {"strokes": [{"points": [[0, 0, 0], [0.1, 0, 0], [0.2, 0.1, 0]], "radius": 0.05, "falloff": 0.05, "strength": 1},
                       {"points": [[0.2, 0.1, 0]], "radius": 0.05, "erase": True}]}
SCENE = {"sinew_scene": 1, "seconds": 0.2, "still": 0.1, "gravity": 9.81, "iterations": 2, "step": 0.02, "damping": 0.5, "deformation_damping_ratio": 0.1, "stiffness": 2, "package_pins": True, "channels": {"pull": [[0, 0], [0.1, 1]], "p*": [[0.1, 0.5]]},
         "targets": {"bone": {"axis": [1, 0, 0], "point": [0, 0, 0], "keys": [{"time": 0}, {"time": 0.1, "turn": 20, "move": [0, 0.1, 0]}]}},
         "camera": {"yaw": 10, "pitch": 3, "at": [0, 0, 0], "height": 2}, "note": "by hand"}


def png():
    """16 x 16 grey, stored without compression's help."""
    import zlib
    rows = b"".join(b"\0" + bytes((16 * x + y) & 255 for x in range(16)) for y in range(16))
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 16, 16, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def reseal_png(data):
    """The sums of all chunks made right, as far as their lengths lead."""
    import zlib
    data, at = bytearray(data), 8
    while at + 12 <= len(data):
        size = struct.unpack_from(">I", data, at)[0]
        if at + 12 + size > len(data):
            break
        struct.pack_into(">I", data, at + 8 + size, zlib.crc32(bytes(data[at + 4:at + 8 + size])))
        at += 12 + size
    return bytes(data)


# ---- Runs ----


class Runner:
    def __init__(self, arguments, folder):
        self.arguments, self.folder = arguments, folder
        self.failures, self.codes, self.runs, self.longest = [], {}, 0, (0, "")
        # A crash stays a signal: one of the child that imports is an answer that the program knows.
        self.environment = dict(os.environ)
        for name, more in (("ASAN_OPTIONS", ":handle_segv=0:handle_abort=0:handle_sigbus=0:handle_sigfpe=0"), ("UBSAN_OPTIONS", "")):
            self.environment[name] = os.environ.get(name, "") + f":exitcode={SANITIZER_EXIT}{more}"

    def sinew(self, *words, seconds=None):
        seconds = (seconds or 30) * SLOWNESS
        start = time.monotonic()
        process = subprocess.Popen([self.arguments.sinew, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   cwd=self.folder, env=self.environment)
        try:
            out, err = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            return "time", out, err.decode("utf-8", "replace"), seconds
        return process.returncode, out, err.decode("utf-8", "replace"), time.monotonic() - start

    def judge(self, name, inputs, words, output=None):
        """Runs once and holds the answer against the contract. inputs: the damaged files, kept where it fails."""
        code, out, err, seconds = self.sinew(*words)
        self.runs += 1
        self.codes.setdefault(name.split()[0], {}).setdefault(code, 0)
        self.codes[name.split()[0]][code] += 1
        self.longest = max(self.longest, (seconds, name))
        faults = []
        if code not in (0, 1, 3):
            faults.append(f"ended with {code}")
        # assimp's own faults stay in that child; the program's code does not lie beneath.
        if any(report in err for report in REPORTS) and not (code == 3 and "libassimp" in err):
            faults.append("a sanitizer complained")
        if code == 3:
            lines = [line for line in err.strip().splitlines() if line.startswith("sinew: ")]
            if len(lines) != 1 or len(lines[0]) < 20 or len(lines[0]) > 4000:
                faults.append("wants one line with a reason")
            if "unexpected fault" in err:
                faults.append("an exception nobody expected")
        if output is not None:
            left = [p for p in output.parent.iterdir()]
            if code == 0 and left != [output]:
                faults.append(f"wrote {[p.name for p in left]}")
            if code == 3 and left:
                faults.append(f"left {[p.name for p in left]} behind")
            if code == 0 and left == [output]:
                again = self.sinew("inspect", output, "--json")
                if again[0] != 0:
                    faults.append(f"its package is refused: {again[2].strip()[:200]}")
            for path in left:
                path.unlink()
        if code in (0, 1) and "--json" in map(str, words):
            try:
                json.loads(out)
            except ValueError:
                faults.append("its JSON is none")
        if faults:
            self.failures.append(f"{name}: {', '.join(faults)}: {err.strip()[-1500:]}")
            print("FAIL", self.failures[-1], flush=True)
            if self.arguments.keep:
                kept = pathlib.Path(self.arguments.keep) / name.replace(" ", "_").replace("/", "_")
                kept.mkdir(parents=True, exist_ok=True)
                (kept / "command.txt").write_text(" ".join(map(str, words)) + "\n" + err)
                for path in inputs:
                    shutil.copy(path, kept)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--rounds", type=int, default=20, help="damaged files of each kind")
    parser.add_argument("--only", default="", help="kinds whose names hold this")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", default="", help="folder for the files of runs that fail")
    arguments = parser.parse_args()
    arguments.sinew = str(pathlib.Path(arguments.sinew).resolve())
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        runner = Runner(arguments, folder)
        out = folder / "out"
        out.mkdir()

        def rounds(kind):
            """Round number and the source of chance of each: the same whichever kinds are run."""
            if arguments.only in kind:
                for i in range(arguments.rounds):
                    yield i, random.Random(f"{arguments.seed} {kind} {i}")

        # A good project, and the package that its bake gives.
        shutil.copy(ASSETS / "generated/l_bar.obj", folder)
        texts = {"recipe.json": RECIPE, "kept.json": STORED, "brush.json": STROKES, "scene.json": SCENE}
        for file, document in texts.items():
            (folder / file).write_text(json.dumps(document))
        source_vertices = sum(line.startswith("v ") for line in (folder / "l_bar.obj").read_text().splitlines())
        texts["numbers.json"] = [i % 9 / 8 if i < source_vertices // 4 else 0 for i in range(source_vertices)]
        (folder / "numbers.json").write_text(json.dumps(texts["numbers.json"]))
        package = folder / "good.sinew"
        for words in (["bake", "recipe.json", "-o", package, "--no-cache"], ["author", "recipe.json", "show", "--json"],
                      ["simulate", package, "--scene", "scene.json", "--json"]):
            code, _, err, _ = runner.sinew(*words, seconds=300)
            if code != 0:
                print(f"the good files do not pass: {words} ended with {code}: {err}")
                return 1

        verbs = [["inspect"], ["check"], ["simulate", "--scene", "squash", "--seconds", "0.1"],
                 ["simulate", "--scene", "scene.json"]]
        packages = [package.read_bytes(), *(p.read_bytes() for p in sorted((ROOT / "tests/formats/golden").glob("*.sinew")))]
        for kind, damage in (("package", damaged), ("package_resealed", resealed)):
            for i, chance in rounds(kind):
                file = folder / "damaged.sinew"
                file.write_bytes(damage(chance, packages[i % len(packages)]))
                for verb in verbs if kind == "package_resealed" else [verbs[i % len(verbs)]]:
                    runner.judge(f"{kind} {i} {verb[0]}", [file], [verb[0], file, *verb[1:], "--json"])

        # ---- Meshes ----
        hand, fish = ASSETS / "models/hand_rigged.glb", ASSETS / "models/trout"
        shutil.copy(fish / "fish.skeleton", folder)
        meshes = {
            "obj": (ASSETS / "generated/l_bar.obj").read_bytes(), "ply": (ASSETS / "models/penguin_painted.ply").read_bytes(),
            "stl": (ASSETS / "generated/cube_soup.stl").read_bytes(), "off": off_text().encode(), "gltf": gltf_text().encode(),
            "glb": hand.read_bytes(), "fbx": (ASSETS / "models/bar_skeleton.fbx").read_bytes(), "dae": dae_text().encode(),
            "mesh": (fish / "fish.mesh").read_bytes()}
        for format_, whole in meshes.items():
            for i, chance in rounds(format_):
                file = folder / f"damaged.{format_}"
                if format_ == "gltf":
                    file.write_bytes(damaged_json(chance, whole))
                elif format_ == "glb" and i % 2 == 0:
                    size = struct.unpack_from("<I", whole, 12)[0]
                    file.write_bytes(whole[:20] + damaged(chance, whole[20:20 + size])[:size].ljust(size) + whole[20 + size:])
                elif format_ in ("fbx", "mesh", "ply") and i % 2 == 0:
                    file.write_bytes(damaged(chance, whole[:2000], True) + whole[2000:])  # where the structure is
                else:
                    file.write_bytes(damaged(chance, whole, format_ in ("glb", "fbx", "mesh", "ply", "stl")))
                if i % 3 == 0:
                    package_out = out / "made.sinew"
                    runner.judge(f"{format_} {i} bake", [file], ["bake", file, "-o", package_out, "--quiet", "--no-cache", "--set",
                                                                "tetrahedra.vertices=200"], package_out)
                else:
                    runner.judge(f"{format_} {i} check", [file], ["check", file, "--json"])

        # ---- Recipes and what they name ----
        for i, chance in rounds("recipe"):
            file = folder / "damaged.json"
            file.write_bytes(damaged_json(chance, json.dumps(RECIPE).encode()))
            runner.judge(f"recipe {i} show", [file], ["author", file, "show", "--json"])
            if i % 4 == 0:
                package_out = out / "made.sinew"
                runner.judge(f"recipe {i} bake", [file], ["bake", file, "-o", package_out, "--quiet", "--no-cache"], package_out)
        for name in ("kept.json", "brush.json", "numbers.json"):
            for i, chance in rounds("mask_" + name):
                file = folder / name
                file.write_bytes(damaged_json(chance, json.dumps(texts[name]).encode()))
                runner.judge(f"mask_{name} {i} show", [file], ["author", "recipe.json", "show", "--json"])
            (folder / name).write_text(json.dumps(texts[name]))
        shutil.copy(ASSETS / "generated/skin_patch.obj", folder)
        (folder / "painted.json").write_text(json.dumps({
            "sinew_recipe": 2, "source": "skin_patch.obj",
            "clusters": [{"name": "a", "from": {"image": "mask.png", "threshold": 0.5, "close": 2, "specks": 3, "feather": 2}}]}))
        for i, chance in rounds("mask_picture"):
            file = folder / "mask.png"
            whole = damaged(chance, png())
            file.write_bytes(reseal_png(whole) if i % 2 else whole)
            runner.judge(f"mask_picture {i} show", [file], ["author", "painted.json", "show", "--json"])
        for i, chance in rounds("scene"):
            file = folder / "damaged_scene.json"
            file.write_bytes(damaged_json(chance, json.dumps(SCENE).encode()))
            # A damaged length may be ten minutes: the steps are bounded here.
            runner.judge(f"scene {i} simulate", [file], ["simulate", package, "--scene", file, "--seconds", "0.2", "--json"])

        for kind, codes in runner.codes.items():
            print(f"  {kind:24s} " + "  ".join(f"exit {code}: {n}" for code, n in sorted(codes.items(), key=str)))
        print(f"{runner.runs} runs, {len(runner.failures)} failures; longest {runner.longest[0]:.1f} s ({runner.longest[1]})")
        both = sum((0 in c or 1 in c) and 3 in c for c in runner.codes.values())
        if not arguments.only and arguments.rounds >= 10 and both < len(runner.codes) // 2:
            print("hardly any kind was both read and refused: the damage is not of a kind that tests anything")
            return 1
        return 1 if runner.failures else 0


if __name__ == "__main__":
    sys.exit(main())
