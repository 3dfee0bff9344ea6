#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recipes through the program: the same clusters authored in different ways, wrong recipes, the commands of `author`."""
import argparse
import json
import math
import os
import pathlib
import random
import shlex
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "formats"))
import read_package  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "render"))
from read_png import read_png  # noqa: E402

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
DATA = None
NAMES = ("left", "middle", "right")
ACROSS, ALONG = 8, 24  # cells of the bar


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=300 * SLOWNESS)


def png(path, width, height, pixel):
    """Writes an 8-bit RGB picture; pixel(x, y) with y from the top."""
    rows = b"".join(b"\0" + b"".join(bytes(pixel(x, y)) for x in range(width)) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def exr(path, width, height, pixel):
    """Writes an uncompressed picture of 32-bit floats; pixel(x, y) = (r, g, b) with y from the top."""
    def attribute(name, kind, data):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data

    channels = b"".join(c + b"\0" + struct.pack("<iBBBBii", 2, 0, 0, 0, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = struct.pack("<ii", 20000630, 2) + attribute("channels", "chlist", channels) + \
        attribute("compression", "compression", b"\0") + attribute("dataWindow", "box2i", window) + \
        attribute("displayWindow", "box2i", window) + attribute("lineOrder", "lineOrder", b"\0") + \
        attribute("pixelAspectRatio", "float", struct.pack("<f", 1)) + \
        attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)) + \
        attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0"
    lines = []
    for y in range(height):
        row = [pixel(x, y) for x in range(width)]
        data = b"".join(struct.pack(f"<{width}f", *(p[c] for p in row)) for c in (2, 1, 0))
        lines.append(struct.pack("<ii", y, len(data)) + data)
    first = len(head) + 8 * height
    offsets = b"".join(struct.pack("<Q", first + y * len(lines[0])) for y in range(height))
    path.write_bytes(head + offsets + b"".join(lines))


class Bar:
    """A bar of 3 x 1 x 1 m, in cells; the cluster of a face is the metre along x it lies in."""

    def __init__(self):
        self.points, self.index, self.quads = [], {}, []
        sides = [(1, 0, 1), (1, 1, 0), (2, 0, 0), (2, 1, 1)]
        for strip, (axis, end, turned) in enumerate(sides):
            for i in range(ALONG):
                for j in range(ACROSS):
                    corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    self.quad(corners, lambda c, a=axis, e=end: self.at(c, a, e), strip, turned)
        for end in (0, 1):
            for i in range(ACROSS):
                for j in range(ACROSS):
                    corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
                    place = lambda c, e=end: (3.0 * e, c[0] / ACROSS - 0.5, c[1] / ACROSS - 0.5)  # noqa: E731
                    self.quad(corners, place, 4 + end, not end)

    @staticmethod
    def at(corner, axis, end):
        x, other = 3 * corner[0] / ALONG, corner[1] / ACROSS - 0.5
        return (x, end - 0.5, other) if axis == 1 else (x, other, end - 0.5)

    def quad(self, corners, place, strip, turned):
        vertices, uvs = [], []
        for c in corners:
            p = place(c)
            vertices.append(self.index.setdefault(p, len(self.index)))
            if vertices[-1] == len(self.points):
                self.points.append(p)
            # Each side is a strip of the picture; u runs along the bar.
            v = (strip + 0.1 + 0.8 * (c[1] / ACROSS)) / 6
            uvs.append((0.05 + 0.9 * p[0] / 3 if strip < 4 else 0.05 + 0.9 * (strip - 4) + (0.5 - (strip - 4)) * 0.02 *
                        (1 + p[1]), v))
        if turned == (strip >= 4):
            vertices.reverse()
            uvs.reverse()
        cell = corners[0][0] * 3 // ALONG if strip < 4 else 2 * (strip - 4)
        self.quads.append((cell, vertices, uvs))

    def obj(self, colors=False, groups=False, duplicates=None, reverse=False):
        lines = ["o bar"]
        for p in self.points:
            tint = ""
            if colors:
                tint = " %d %d %d" % tuple(self.regions(p))
            lines.append("v %.9f %.9f %.9f%s" % (*p, tint))
        texture = 0
        for cell, vertices, uvs in self.quads:
            for uv in uvs:
                lines.append("vt %.9f %.9f" % uv)
            if groups:
                lines.append("g " + NAMES[cell])
            lines.append("f " + " ".join(f"{v + 1}/{texture + k + 1}" for k, v in enumerate(vertices)))
            texture += len(uvs)
        if duplicates is not None:
            first = len(self.points)
            for cell, name in enumerate(NAMES):
                lines.append("o CLUSTER_" + name)
                used = sorted({v for c, vertices, _ in self.quads if c == cell for v in vertices})
                for v in used:
                    lines.append("v %.9f %.9f %.9f" % duplicates(self.points[v]))
                for c, vertices, _ in self.quads:
                    if c == cell:
                        order = reversed(vertices) if reverse else vertices
                        lines.append("f " + " ".join(str(first + used.index(v) + 1) for v in order))
                first += len(used)
        return "\n".join(lines) + "\n"


    @staticmethod
    def regions(p):
        return [float(p[0] <= 1.001), float(0.999 <= p[0] <= 2.001), float(p[0] >= 1.999)]

    def glb(self):
        """With an attribute _LEFT, ... and a morph target left, ... for each of the three regions."""
        blobs, views, accessors = [], [], []

        def accessor(kind, values, flat, component=5126, **bounds):
            data = struct.pack(f"<{len(flat)}{'f' if component == 5126 else 'I'}", *flat)
            views.append({"buffer": 0, "byteOffset": sum(map(len, blobs)), "byteLength": len(data)})
            blobs.append(data)
            accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": values, "type": kind,
                              **bounds})
            return len(accessors) - 1

        count = len(self.points)
        low, high = ([f(p[k] for p in self.points) for k in range(3)] for f in (min, max))
        attributes = {"POSITION": accessor("VEC3", count, [c for p in self.points for c in p], min=low, max=high)}
        targets = []
        for k, name in enumerate(NAMES):
            weights = [self.regions(p)[k] for p in self.points]
            attributes["_" + name.upper()] = accessor("SCALAR", count, weights)
            moved = [c for w in weights for c in (0, 0.25 * w, 0)]
            targets.append({"POSITION": accessor("VEC3", count, moved, min=[0, 0, 0], max=[0, 0.25, 0])})
        corners = [v for _, q, _ in self.quads for v in (q[0], q[1], q[2], q[0], q[2], q[3])]
        indices = accessor("SCALAR", len(corners), corners, component=5125)
        document = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
                    "nodes": [{"name": "bar", "mesh": 0}],
                    "meshes": [{"name": "bar", "extras": {"targetNames": list(NAMES)},
                                "primitives": [{"attributes": attributes, "indices": indices, "targets": targets}]}],
                    "buffers": [{"byteLength": sum(map(len, blobs))}], "bufferViews": views, "accessors": accessors}
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        binary = b"".join(blobs)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def write(self, name, content):
        (self.path / name).write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
        return self.path / name

    def bake(self, recipe, *arguments):
        package = self.path / "out.sinew"
        result = run("bake", recipe, "-o", package, "--report", self.path / "report.json", *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.report = json.loads((self.path / "report.json").read_text())
        return read_package.Package(package.read_bytes())

    def finding(self, name):
        return next((f for f in self.report["findings"] if f["id"] == name), None)

    @staticmethod
    def shares(package):
        """Share of each (cluster name, physical vertex)."""
        return {(package.text(c[0], c[1]), m[0]): m[2] for c in package.records["CLUS"]
                for m in package.records["MEMB"][c[4]:c[4] + c[5]]}


class FiveWays(Folder):
    def recipe(self, name, source, froms):
        file = self.path / (name + (".obj" if isinstance(source, str) else ".glb"))
        file.write_bytes(source.encode() if isinstance(source, str) else source)
        clusters = [{"name": n, "from": f} if f else {"name": n} for n, f in zip(NAMES, froms)]
        return self.write(name + ".json", {"sinew_recipe": 2, "source": file.name,
                                           "settings": {"tetrahedra.vertices": 800}, "clusters": clusters})

    def test_five_ways_agree(self):
        bar = Bar()
        boxes = [{"box": [[a - 0.001, -1, -1], [a + 1.001, 1, 1]]} for a in range(3)]
        reference = self.bake(self.recipe("boxes", bar.obj(), boxes))
        wanted = self.shares(reference)
        self.assertEqual({name for name, _ in wanted}, set(NAMES))

        # The edge of a painted mask lies between two rows of vertices.
        size = 512

        def pixel(x, y):
            along = ((x + 0.5) / size - 0.05) / 0.9 * 3
            return [255 * (a - 0.06 <= along <= a + 1.06) for a in range(3)]
        png(self.path / "mask.png", size, size, pixel)
        exr(self.path / "mask.exr", size, size, lambda x, y: [c / 255 * 0.75 for c in pixel(x, y)])
        png(self.path / "flipped.png", size, size, lambda x, y: pixel(x, size - 1 - y))
        rng = random.Random(1)
        smoothed = lambda p: tuple(c + rng.uniform(-0.012, 0.012) for c in p)  # noqa: E731
        same = lambda p: p  # noqa: E731
        ways = {
            "groups": (bar.obj(groups=True), [{"group": n} for n in NAMES]),
            "colors": (bar.obj(colors=True), [{"color": c} for c in "rgb"]),
            "picture": (bar.obj(), [{"image": "mask.png", "channel": c, "threshold": 0.5} for c in "rgb"]),
            "float picture": (bar.obj(), [{"image": "mask.exr", "channel": c, "threshold": 0.5} for c in "rgb"]),
            "attributes": (bar.glb(), [{"attribute": "_" + n.upper()} for n in NAMES]),
            "morph targets": (bar.glb(), [{"morph": n} for n in NAMES]),
            "morph targets in proportion": (bar.glb(), [{"morph": n, "threshold": 0} for n in NAMES]),
            "picture from the top": (bar.obj(), [{"image": "flipped.png", "channel": c, "v": "down"} for c in "rgb"]),
            "duplicates": (bar.obj(duplicates=same), [{"cluster_mesh": n} for n in NAMES]),
            "duplicates by name alone": (bar.obj(duplicates=same), [None] * 3),
            "edited duplicates": (bar.obj(duplicates=smoothed), [None] * 3),
            "edited duplicates inside out": (bar.obj(duplicates=smoothed, reverse=True), [None] * 3),
        }
        for way, (source, froms) in ways.items():
            with self.subTest(way):
                package = self.bake(self.recipe(way.replace(" ", "_"), source, froms))
                self.assertEqual(len(package.records["PVTX"]), len(reference.records["PVTX"]))
                self.assertEqual(len(package.records["VTRI"]), len(reference.records["VTRI"]))
                shares = self.shares(package)
                keys = set(wanted) | set(shares)
                rms = math.sqrt(sum((wanted.get(k, 0) - shares.get(k, 0)) ** 2 for k in keys) / len(keys))
                self.assertLess(rms, 0.02)

    def test_duplicates_of_a_bare_mesh_need_no_recipe(self):
        package = self.bake(self.write("bar.obj", Bar().obj(duplicates=lambda p: p)))
        self.assertEqual([package.text(c[0], c[1]) for c in package.records["CLUS"]], list(NAMES))

    def test_a_duplicate_that_moved_away_is_reported(self):
        source = Bar().obj(duplicates=lambda p: (p[0], p[1] + (0.4 if p[0] > 2.5 and p[1] > 0.4 else 0), p[2]))
        self.bake(self.recipe("moved", source, [None] * 3))
        self.assertIn("CLUSTER_right", self.finding("cluster-mesh-unmatched")["message"])


class Package(Folder):
    def test_pins_channels_stiffness_and_settings_reach_their_sections(self):
        self.write("bar.obj", Bar().obj())
        recipe = self.write("bar.json", {
            "sinew_recipe": 2, "source": "bar.obj", "settings": {"tetrahedra.vertices": 600},
            "masks": {"left": {"half_space": [1, 0, 0], "normal": [-1, 0, 0]}},
            "clusters": [
                {"name": "muscle", "from": "left", "channel": "pull", "contraction": 0.25, "overlap": 0.3,
                 "settings": {"stretch_hz": 33, "mode": "linear"},
                 "origin": {"half_space": [0.01, 0, 0], "normal": [-1, 0, 0]}},
                {"name": "rest", "from": {"rest": True}, "split": 1.0}],
            "pins": [{"name": "far", "from": {"half_space": [2.99, 0, 0], "normal": [1, 0, 0]}, "method": "matrix",
                      "target": "Hand"}],
            "stiffness": [{"from": {"sphere": [3, 0, 0], "radius": 0.9}, "value": 0.25}]})
        package = self.bake(recipe)
        r = package.records
        names = [package.text(c[0], c[1]) for c in r["CLUS"]]
        self.assertEqual(names[0], "muscle")
        self.assertEqual(names[1:], [f"rest.{i + 1}" for i in range(len(names) - 1)])
        self.assertGreaterEqual(len(names), 3)
        self.assertEqual(r["CLUS"][0][2], 1)
        self.assertEqual(r["CLUS"][0][12], 33)
        self.assertNotEqual(r["CLUS"][1][12], 33)
        self.assertEqual([package.text(*c) for c in r["CHAN"]], ["pull"])
        muscle = r["CMEC"][0]
        self.assertEqual((muscle[21], muscle[22]), (0, 0.25))
        self.assertEqual(r["CMEC"][1][21], read_package.NONE)
        self.assertAlmostEqual(sum(c * c for c in muscle[18:21]), 1, 4)
        sets = {package.text(s[0], s[1]): s for s in r["PSET"]}
        self.assertEqual(set(sets), {"far", "muscle.origin"})
        far = sets["far"]
        self.assertEqual((package.text(far[2], far[3]), far[4]), ("Hand", 2))
        origin = r["INFO"][0][0]
        held = [v for (v,) in r["PSTV"]][far[5]:far[5] + far[6]]
        self.assertGreater(len(held), 8)
        for v in held:
            self.assertGreater(r["PVTX"][v][0] + origin, 2.5)
            self.assertGreater(r["PPIN"][v][0], 0)
        soft = [v for v, (s,) in enumerate(r["PSTF"]) if s < 0.3]
        self.assertTrue(soft)
        self.assertTrue(all(r["PVTX"][v][0] + origin > 1.9 for v in soft))
        self.assertEqual(self.report["pin_sets"], 2)
        check = run("simulate", self.path / "out.sinew", "--scene", "rest", "--seconds", "0.5", "--json")
        self.assertLess(json.loads(check.stdout)["rest_error"]["max"], 1e-5)

    def test_what_no_cluster_covers_goes_to_the_nearest_and_is_counted(self):
        self.write("bar.obj", Bar().obj())
        package = self.bake(self.write("bar.json", {
            "sinew_recipe": 2, "source": "bar.obj",
            "clusters": [{"name": "a", "from": {"box": [[-1, -1, -1], [0.8, 1, 1]]}},
                         {"name": "b", "from": {"box": [[2.2, -1, -1], [4, 1, 1]]}}]}))
        uncovered = self.finding("cluster-uncovered")
        self.assertGreater(uncovered["count"], 100)
        origin = package.records["INFO"][0][0]
        for (name, v), share in self.shares(package).items():
            x = package.records["PVTX"][v][0] + origin
            if abs(x - 1.5) > 0.5:
                self.assertTrue((name == "a") == (x < 1.5) or share < 0.5)
        self.assertIsNone(self.finding("clusters-unconnected"))

    def test_warnings_of_clusters_that_were_not_meant(self):
        self.write("bar.obj", Bar().obj())
        ends = {"or": [{"half_space": [0.4, 0, 0], "normal": [-1, 0, 0]}, {"half_space": [2.6, 0, 0], "normal": [1, 0, 0]}]}
        self.bake(self.write("bar.json", {
            "sinew_recipe": 2, "source": "bar.obj",
            "clusters": [{"name": "ends", "from": ends, "overlap": 0}, {"name": "again", "from": ends, "overlap": 0},
                         {"name": "idle", "from": {"scale": ends, "by": 0.001}},
                         {"name": "rest", "from": {"rest": True}, "overlap": 0}]}))
        self.assertIn("ends", self.finding("cluster-apart")["place"])
        self.assertIn("ends = again", self.finding("cluster-identical")["place"])
        self.assertIn("idle", self.finding("cluster-idle")["place"])

    def test_kmeans_bakes(self):
        source = self.write("bar.obj", Bar().obj())
        package = self.bake(source, "--set", "clusters.method=kmeans", "--set", "clusters.size=1.0")
        self.assertGreaterEqual(len(package.records["CLUS"]), 3)
        self.assertIsNone(self.finding("clusters-unconnected"))


class Pins(Folder):
    """Sets of pins that meet, on the bar from x = 0 to 3."""

    def slab(self, low, high, **more):
        return {"box": [[low, -9, -9], [high, 9, 9]], **more}

    def recipe(self, pins, clusters=()):
        self.write("bar.obj", Bar().obj())
        return self.write("r.json", {"sinew_recipe": 3, "source": "bar.obj", "settings": {"tetrahedra.vertices": 600},
                                     "clusters": list(clusters), "pins": [{"name": n, "from": f, "target": n} for n, f in pins]})

    def moved(self, target, low, high):
        """How far the vertices of low <= x <= high move up with a target that moves by 0.3."""
        scene = self.write("s.json", {"sinew_scene": 1, "seconds": 1, "targets": {
            target: {"keys": [{"time": 0}, {"time": 0.5, "move": [0, 0.3, 0]}]}}})
        poses = []
        for seconds in ("0.01", "1"):
            out = self.path / "pose.obj"
            result = run("simulate", self.path / "out.sinew", "--scene", scene, "--seconds", seconds, "--export", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            poses.append([tuple(map(float, line.split()[1:])) for line in out.read_text().splitlines() if line.startswith("v ")])
        return [b[1] - a[1] for a, b in zip(*poses) if low <= a[0] <= high]

    def test_an_end_face_holds_stiff_bars_as_it_holds_soft_ones(self):
        sections = [(i / 40, y, z) for i in range(41) for y, z in ((-0.025, -0.025), (0.025, -0.025), (0.025, 0.025), (-0.025, 0.025))]
        faces = [(1, 2, 3, 4), (164, 163, 162, 161)]
        faces += [(4 * i + c + 1, 4 * i + c + 5, 4 * i + (c + 1) % 4 + 5, 4 * i + (c + 1) % 4 + 1) for i in range(40) for c in range(4)]
        self.write("slender.obj", "".join("v %g %g %g\n" % p for p in sections) + "".join("f %d %d %d %d\n" % f for f in faces))
        sags = []
        for young in (1e7, 1e9):  # under weights in proportion
            self.bake(self.write("r.json", {
                "sinew_recipe": 3, "source": "slender.obj", "pins": [{"name": "A", "from": {"half_space": [1e-4, 0, 0], "normal": [-1, 0, 0]}}],
                "settings": {"clusters.stiffness": "elastic", "clusters.young": young, "clusters.poisson": 0.3}}))
            scene = self.write("s.json", {"sinew_scene": 1, "seconds": 10, "gravity": young * 8e-8})
            out = self.path / "pose.obj"
            result = run("simulate", self.path / "out.sinew", "--scene", scene, "--export", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            places = [[float(x) for x in line.split()[1:4]] for line in out.read_text().splitlines() if line.startswith("v ")]
            sags.append(-sum(p[1] for p in places[-4:]) / 4)
        # Of a beam 1.5 rho g l^3 / (E h^2) = 0.048; the tetrahedra cut its edges off.
        self.assertAlmostEqual(sags[0], 0.058, delta=0.012)
        self.assertAlmostEqual(sags[1] / sags[0], 1, delta=0.02)

    def test_a_vertex_moves_with_the_pins_that_hold_it_firmest(self):
        package = self.bake(self.recipe([("A", self.slab(-1, 0.3, falloff=2)), ("B", self.slab(1.6, 1.8))]))
        sets = [[v for (v,) in package.records["PSTV"]][s[5]:s[5] + s[6]] for s in package.records["PSET"]]
        self.assertGreater(len(sets[1]), 10)
        self.assertFalse(set(sets[0]) & set(sets[1]))
        up = self.moved("B", 1.6, 1.8)
        self.assertGreater(max(up), 0.28)
        self.assertGreater(min(up), 0.15)  # at the edges of what is held
        self.assertIsNone(self.finding("pins-overruled"))

    def test_pins_that_do_not_move_their_vertices_are_said(self):
        bone = [{"name": "bone", "from": self.slab(-1, 1.5), "settings": {"mode": "rigid"}}, {"name": "flesh", "from": {"rest": True}}]
        firm = ("A", self.slab(-1, 0.3))
        cases = {
            "in a rigid cluster that others hold": ([firm, ("B", {"scale": self.slab(0.8, 1.1), "by": 0.3})], bone,
                                                    "pins-hold-nothing", "B", ("rigid cluster 'bone'", "pins 'A'")),
            "under a copy": ([firm, ("B", self.slab(-1, 0.3))], (), "pins-hold-nothing", "B", ("pins 'A'", "minus")),
            "under a neighbour": ([firm, ("B", self.slab(0.1, 1.1))], (), "pins-overruled", "B", ("pins 'A'", "minus")),
            "as springs": ([firm, ("B", {"scale": self.slab(1.6, 1.8), "by": 0.3})], (), "pins-loose", "B", ("firmly", "weight")),
            "both in one bone": ([firm, ("B", self.slab(0.8, 1.1))], bone, "cluster-held-by-several", "bone", ("'A' and 'B'",)),
        }
        for case, (pins, clusters, name, place, says) in cases.items():
            with self.subTest(case):
                recipe = self.recipe(pins, clusters)
                self.bake(recipe)
                checked = json.loads(run("check", recipe, "--json").stdout)["findings"]
                said = [[f for f in findings if f["id"].startswith(("pins-", "cluster-"))]
                        for findings in (self.report["findings"], checked)]
                self.assertEqual(*said)
                for findings in said:
                    found = next(f for f in findings if (f["id"], f["place"]) == (name, place))
                    self.assertEqual(found["severity"], "warning")
                    self.assertGreater(found["count"], 0)
                    for word in says:
                        self.assertIn(word, found["message"] + found["cure"])
                # The same where the second set is added by hand.
                second = json.loads(recipe.read_text())["pins"].pop()
                recipe = self.recipe(pins[:1], clusters)
                result = run("author", recipe, "add-pins", "B", "--from", json.dumps(second["from"]))
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertIn(f"[{name}]", result.stdout)

    def test_a_falloff_does_not_take_a_bone_from_who_holds_it(self):
        bone = [{"name": "bone", "from": self.slab(-1, 2.2), "settings": {"mode": "rigid", "overlap": 0.2}},
                {"name": "flesh", "from": {"rest": True}, "settings": {"overlap": 0.2}}]
        self.bake(self.recipe([("A", self.slab(-1, 0.3)), ("B", self.slab(2.7, 3.1, falloff=1.2))], bone))
        self.assertIsNone(self.finding("cluster-held-by-several"))
        up = self.moved("A", 0.8, 1.3)
        self.assertGreater(min(up), 0.298)


class Overlap(Folder):
    """One name and one meaning: clusters.overlap, in metres, of all clusters or of one."""

    def baked(self, version, settings, own=None):
        self.write("bar.obj", Bar().obj(groups=True))
        clusters = [{"name": n, "from": {"group": n}, **(own or {})} for n in NAMES]
        return self.bake(self.write("r.json", {"sinew_recipe": version, "source": "bar.obj", "settings": settings, "clusters": clusters}))

    def test_it_widens_authored_clusters_and_zero_is_none(self):
        widths = {}
        for value in ("auto", 0, 0.2, 0.5):
            widths[value] = len(self.shares(self.baked(3, {"clusters.overlap": value})))
        self.assertLess(widths[0], widths[0.2])
        self.assertLess(widths[0.2], widths[0.5])
        self.assertLess(widths[0], widths["auto"])
        own = self.shares(self.baked(3, {"clusters.overlap": 0.5}, {"settings": {"overlap": 0}}))
        self.assertEqual(len(own), widths[0])

    def test_one_that_reaches_no_vertex_is_said(self):
        for own in (0, 0.01, 0.5):
            with self.subTest(own):
                shares = self.shares(self.baked(3, {}, {"settings": {"overlap": own}}))
                found = self.finding("overlap-short")
                self.assertEqual(found is not None, own == 0.01)
                if own == 0:
                    none = shares
                if own == 0.01:
                    self.assertEqual(shares.keys(), none.keys())
                    self.assertEqual(found["place"], "left, middle, right")
                    self.assertIn(" cm away", found["message"])
        # A cluster that is all has no border.
        self.bake(self.write("all.json", {"sinew_recipe": 3, "source": "bar.obj", "settings": {"clusters.overlap": 0.01},
                                          "clusters": [{"name": "c", "from": {"all": True}}]}))
        self.assertIsNone(self.finding("overlap-short"))

    def test_older_recipes_mean_what_they_meant(self):
        cases = (({"clusters.overlap_metres": 0.2}, None, {"clusters.overlap": 0.2}, None, "info"),
                 ({"clusters.overlap_metres": 0}, None, {}, None, "info"),
                 ({"clusters.overlap_metres": 0.2}, {"overlap": 0}, {}, {"settings": {"overlap": 0}}, "info"),
                 ({"clusters.overlap": 0.5}, None, {}, None, None),
                 ({"clusters.overlap": 0.3}, None, {}, None, "warning"))
        for old, old_own, new, new_own, severity in cases:
            with self.subTest(old):
                before = self.shares(self.baked(2, old, old_own))
                found = self.finding("recipe-migrated")
                self.assertEqual(found and found["severity"], severity)
                self.assertEqual(before, self.shares(self.baked(3, new, new_own)))
                self.assertIsNone(self.finding("recipe-migrated"))
        self.baked(2, {"clusters.overlap_metres": 0.2}, {"overlap": 0.1})
        self.assertEqual(run("author", self.path / "r.json", "set", "clusters.mode=linear").returncode, 0)
        written = json.loads((self.path / "r.json").read_text())
        self.assertEqual((written["sinew_recipe"], written["settings"]["clusters.overlap"]), (3, 0.2))
        self.assertEqual(written["clusters"][0], {"name": "left", "from": {"group": "left"}, "settings": {"overlap": 0.1}})

    def test_settings_that_say_nothing_are_said(self):
        def unused(settings, own=None):
            self.baked(3, settings, own)
            found = self.finding("settings-unused")
            return found and found["place"]
        self.assertIsNone(unused({"clusters.overlap": 0.2, "clusters.stretch_hz": 5}))
        self.assertIn("clusters.grid (all clusters are the recipe's)", unused({"clusters.grid": [2, 2, 2]}))
        self.assertIn("clusters.size", unused({"clusters.method": "kmeans", "clusters.size": 1}))
        self.assertIn("clusters.overlap (every cluster has its own)", unused({"clusters.overlap": 0.2}, {"settings": {"overlap": 0}}))
        self.assertIn("clusters.young (it is of clusters.stiffness = elastic)", unused({"clusters.young": 5e4}))
        self.assertIsNone(unused({"clusters.young": 5e4}, {"settings": {"stiffness": "elastic"}}))
        # Of a quadratic cluster the lowest frequency counts; and of one cluster what it has of another choice.
        self.assertIn("clusters.stretch_hz (of a quadratic cluster the lowest of its three frequencies counts, 10 Hz)", unused({"clusters.stretch_hz": 25}))
        self.assertIsNone(unused({"clusters.stretch_hz": 25, "clusters.bend_hz": 25, "clusters.twist_hz": 25}))
        self.assertIsNone(unused({"clusters.stretch_hz": 25, "clusters.mode": "linear"}))
        self.assertIn("left: clusters.stretch_hz (of a quadratic", unused({}, {"settings": {"stretch_hz": 25}}))
        self.assertIn("left: clusters.young (it is of clusters.stiffness = elastic)", unused({}, {"settings": {"young": 5e4}}))
        self.write("bar.obj", Bar().obj())
        self.bake(self.path / "bar.obj", "--set", "clusters.soften_metres=0.1")
        self.assertIn("clusters.soften_metres (no cluster is the recipe's)", self.finding("settings-unused")["place"])


class WrongRecipes(Folder):
    def refused(self, recipe, *words, text=None):
        file = self.path / "wrong.json"
        file.write_text(text if text is not None else json.dumps(recipe, indent=1))
        out = self.path / "never.sinew"
        result = run("bake", file, "-o", out)
        self.assertEqual(result.returncode, 3, result.stderr + result.stdout)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        self.assertIn("wrong.json", result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        self.assertFalse(out.exists())
        return result.stderr

    def test_each_names_place_and_cure(self):
        self.write("bar.obj", Bar().obj())
        base = {"sinew_recipe": 3, "source": "bar.obj"}
        cluster = lambda f, **more: {**base, **more, "clusters": [{"name": "c", "from": f}]}  # noqa: E731
        self.refused({**base, "clustres": []}, "line 4", "clustres", "clusters")
        self.refused({**base, "settings": {"clusters.overlop": 1}}, "line 5", "clusters.overlap")
        self.refused({**base, "settings": {"clusters.overlap": -7}}, "line 5", "auto | 0 .. ")
        self.refused({**base, "settings": {"clusters.overlap_metres": 1}}, "line 5", "clusters.overlap")
        self.refused(cluster({"gruop": "x"}), "line 8", "group")
        self.refused(cluster({"group": "x", "material": "y"}), "group and material")
        self.refused(cluster({"group": 5}), "line 8", "Legal")
        self.refused(cluster({"sphere": [0, 0, 0]}), "lacks its key 'radius'")
        self.refused(cluster("smile"), "no mask 'smile'")
        self.refused(cluster("smle", masks={"smile": {"all": True}}), "Did you mean smile?")
        self.refused(cluster({"group": "lip"}), "no group 'lip'", "line 8")
        self.refused(cluster({"image": "none.png"}), "there is no file", "line 8")
        self.refused(cluster({"image": "../none.png"}), "outside the project folder", "project")
        self.refused({"sinew_recipe": 2, "source": "../bar.obj"}, "outside the project folder", "line 3")
        self.refused({"sinew_recipe": 2, "source": "/bar.obj"}, "absolute")
        self.refused(cluster({"sphere": [9, 9, 9], "radius": 0.1}), "selects nothing", "line 7", "reaches from")
        self.refused(cluster("a", masks={"a": {"not": "b"}, "b": {"and": ["a", {"all": True}]}}), "a -> b -> a")
        self.refused(cluster("a", masks={"a": {"rest": ["a"]}}), "a -> a")
        self.refused({**base, "clusters": [{"name": "c", "from": {"all": True}}, {"name": "c", "from": {"all": True}}]},
                     "two clusters named 'c'", "line 12")
        self.refused(None, "line 3", text='{"sinew_recipe": 2,\n "source": "bar.obj",\n "clusters" []}')
        self.refused(None, "twice", "line 2", text='{"sinew_recipe": 2, "source": "bar.obj",\n "source": "b.obj"}')
        self.refused({**base, "clusters": [{"name": "c"}]}, "no cluster mesh 'c'", "CLUSTER_c")
        self.refused({**base, "clusters": [{"name": "c", "from": {"all": True}, "settings": {"moda": 1}}]}, "mode")
        self.refused({**base, "clusters": [{"name": "c", "from": {"all": True}, "overlap": 1}]},
                     'no key \'overlap\' in a cluster (line 10', 'Did you mean "settings": {"overlap": ...}?')
        self.refused({**base, "clusters": [{"name": "c", "from": {"all": True}, "contraction": 0.5}]}, "channel")
        self.refused({"sinew_recipe": 4, "source": "bar.obj"}, "version 4")
        self.refused({"sinew_recipe": 1, "source": "bar.obj", "clusters": []}, "version 1", "Set sinew_recipe to 3")
        self.refused(cluster({"color": "r"}), "no vertex colours")
        self.refused(cluster({"bone": "Jaw"}), "no bone")
        self.refused(cluster({"morph": "smile"}), "no morph target")
        self.refused(cluster({"attribute": "_X"}), "no attribute")

    def test_wrong_masks_name_their_own_file(self):
        self.write("bar.obj", Bar().obj())
        file = self.path / "values.json"
        file.write_text("[0, 1, 0.5]")
        recipe = self.write("r.json", {"sinew_recipe": 2, "source": "bar.obj",
                                       "clusters": [{"name": "c", "from": {"values": "values.json"}}]})
        result = run("bake", recipe, "-o", self.path / "x.sinew")
        self.assertEqual(result.returncode, 3)
        self.assertIn("values.json: has 3 values, but the source has", result.stderr)
        (self.path / "mask.png").write_bytes(b"no picture")
        recipe = self.write("r.json", {"sinew_recipe": 2, "source": "bar.obj",
                                       "clusters": [{"name": "c", "from": {"image": "mask.png"}}]})
        result = run("bake", recipe, "-o", self.path / "x.sinew")
        self.assertEqual(result.returncode, 3)
        self.assertIn("mask.png: is no picture", result.stderr)
        self.write("s.json", {"strokes": [{"points": [[0, 0, 0]], "radios": 1}]})
        recipe = self.write("r.json", {"sinew_recipe": 2, "source": "bar.obj",
                                       "clusters": [{"name": "c", "from": {"strokes": "s.json"}}]})
        result = run("bake", recipe, "-o", self.path / "x.sinew")
        self.assertEqual(result.returncode, 3)
        self.assertIn("radius", result.stderr)
        self.assertFalse((self.path / "x.sinew").exists())


class Commands(Folder):
    def author(self, *arguments, code=0):
        result = run("author", self.path / "r.json", *arguments)
        self.assertEqual(result.returncode, code, result.stderr)
        return result

    def recipe(self):
        return json.loads((self.path / "r.json").read_text())

    def test_every_command_and_its_undo(self):
        self.write("bar.obj", Bar().obj(groups=True))
        png(self.path / "mask.png", 8, 8, lambda x, y: [255] * 3)
        self.write("strokes.json", {"strokes": [{"points": [[0.5, 0.5, 0], [1, 0.5, 0]], "radius": 0.2}]})
        texts = []

        def do(*arguments):
            if (self.path / "r.json").exists():
                texts.append((self.path / "r.json").read_text())
            self.author(*arguments)

        do("new", self.path / "bar.obj")
        self.assertEqual(self.recipe(), {"sinew_recipe": 3, "source": "bar.obj"})
        do("add-cluster", "side_l", "--from", '{"group": "left"}')
        do("set", "side_l.mode=linear", "side_l.overlap=0.2", "tetrahedra.vertices=500")
        self.assertEqual(self.recipe()["clusters"][0], {"name": "side_l", "from": {"group": "left"},
                                                        "settings": {"mode": "linear", "overlap": 0.2}})
        do("mirror", "side_l", "--plane", "auto")
        self.assertEqual(self.recipe()["clusters"][1]["name"], "side_r")
        do("paint", "spot", self.path / "strokes.json")
        do("paint", "all", self.path / "mask.png", "--options", '{"threshold": 0.5}')
        do("add-mask", "both", "--from", '{"or": ["spot", "all"]}')
        do("move", "spot", "down", "2")
        self.assertEqual(list(self.recipe()["masks"]), ["all", "both", "spot"])
        do("move", "side_r", "up", "--list", "clusters")
        self.assertEqual([c["name"] for c in self.recipe()["clusters"]], ["side_r", "side_l"])
        do("move", "side_l", "up")
        do("rename", "spot", "dot")
        self.assertEqual(self.recipe()["masks"]["both"], {"or": ["dot", "all"]})
        do("add-pins", "ends", "--from", '{"half_space": [0.1, 0, 0], "normal": [-1, 0, 0]}', "--target", "Wall")
        do("set", "ends.method=hold")
        self.assertEqual(self.recipe()["pins"][0]["method"], "hold")
        do("set", "/clusters/0/settings/overlap=default")
        self.assertEqual(self.recipe()["clusters"][0]["settings"], {"mode": "linear"})
        shown = json.loads(self.author("show", "--json").stdout)
        covers = {s["name"]: s["coverage"] for s in shown["selections"]}
        self.assertAlmostEqual(covers["side_l"], covers["side_r"], 2)
        dot = json.loads(self.author("show", "dot", "--json").stdout)["selections"]
        self.assertEqual(len(dot), 1)
        self.assertGreater(dot[0]["visual_vertices"], 0)
        do("remove", "ends")
        self.assertNotIn("pins", self.recipe())
        do("add-thickness", "3", "--from", "dot")
        do("add-stiffness", "0.5", "--from", "dot")
        self.assertEqual(self.recipe()["thickness"], [{"from": "dot", "value": 3}])
        do("rename", "dot", "spot")
        self.assertEqual(self.recipe()["thickness"][0]["from"], "spot")
        self.assertEqual(self.recipe()["stiffness"][0], {"from": "spot", "value": 0.5})
        before = self.recipe()
        self.author("add-thickness", "0", "--from", "spot", code=3)
        self.assertEqual(self.recipe(), before)
        do("rename", "spot", "dot")
        final = (self.path / "r.json").read_text()
        # What the runs of `set` change is undone one value at a time.
        steps = 0
        while run("author", self.path / "r.json", "undo").returncode == 0:
            steps += 1
            if texts and (self.path / "r.json").read_text() == texts[-1]:
                texts.pop()
        self.assertEqual(texts, [])
        self.assertEqual(self.recipe(), {"sinew_recipe": 3, "source": "bar.obj"})
        for _ in range(steps):
            self.author("redo")
        self.assertEqual((self.path / "r.json").read_text(), final)

    def test_a_cluster_for_each_thing_that_the_source_names(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.author("new", self.path / "bar.obj")
        self.author("add-cluster", "right", "--from", '{"box": [[2, -1, -1], [4, 1, 1]]}')
        said = self.author("add-clusters", "group").stdout
        clusters = self.recipe()["clusters"]
        self.assertEqual([c["name"] for c in clusters], ["right", "left", "middle"])
        self.assertEqual(clusters[1]["from"], {"group": "left"})
        self.assertIn("were there: right", said)
        self.author("undo")
        self.assertEqual(len(self.recipe()["clusters"]), 1)
        self.author("add-clusters", "group", "m*")
        self.assertEqual([c["name"] for c in self.recipe()["clusters"]], ["right", "middle"])
        self.author("add-clusters", "part")
        self.assertEqual(self.recipe()["clusters"][2], {"name": "part.0", "from": {"part": 0}})
        before = (self.path / "r.json").read_text()
        self.assertIn("no bones", self.author("add-clusters", "bone", code=2).stderr)
        self.assertIn("Did you mean middle?", self.author("add-clusters", "group", "midle", code=2).stderr)
        self.assertIn("no key 'soft'", self.author("add-clusters", "group", "--options", '{"soft": 1}', code=3).stderr)
        self.author("add-clusters", "group", "--options", "soft", code=2)
        self.author("add-clusters", "colour", code=2)
        self.assertEqual((self.path / "r.json").read_text(), before)

    def test_a_command_that_would_spoil_the_recipe_changes_nothing(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.author("new", self.path / "bar.obj")
        self.author("add-mask", "m", "--from", '{"group": "left"}')
        self.author("add-cluster", "c", "--from", "m")
        before = (self.path / "r.json").read_text()
        self.author("add-cluster", "c", "--from", "m", code=3)
        self.author("add-cluster", "d", "--from", "n", code=3)
        self.author("set", "clusters.mode=liquid", code=3)
        self.author("set", "clustres.mode=linear", code=2)
        self.author("remove", "m", code=2)
        self.author("remove", "x", code=2)
        self.author("rename", "x", "y", code=2)
        self.assertIn("number 1 of 1 entry in clusters", self.author("move", "c", "up", code=2).stderr)
        self.author("move", "c", "up", "--list", "masks", code=2)
        self.author("mirror", "c", code=2)
        self.author("paint", "p", self.path.parent / "elsewhere.png", code=3)
        self.write("no_picture.png", "text")
        self.assertIn("no picture", self.author("paint", "p", self.path / "no_picture.png", code=3).stderr)
        self.author("new", self.path / "bar.obj", code=2)
        self.author("redo", code=2)
        self.assertEqual((self.path / "r.json").read_text(), before)

    def test_what_selects_nothing_is_refused_when_it_is_added(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.write("strokes.json", {"strokes": [{"points": [[0.5, 0.5, 0]], "radius": 0.2, "strength": 0}]})
        self.author("new", self.path / "bar.obj")
        before = (self.path / "r.json").read_text()
        nothing = '{"box": [[9, 9, 9], [10, 10, 10]]}'
        for command in (("add-mask", "m", "--from", nothing), ("add-cluster", "c", "--from", nothing),
                        ("add-pins", "p", "--from", nothing), ("add-part", "p", "--from", nothing),
                        ("add-stiffness", "0.5", "--from", nothing), ("paint", "m", self.path / "strokes.json"),
                        ("add-mask", "m", "--from", '{"and": [{"group": "left"}, {"group": "right"}]}')):
            with self.subTest(command):
                result = self.author(*command, code=3)
                self.assertIn("selects nothing", result.stderr)
                self.assertEqual((self.path / "r.json").read_text(), before)

    def test_what_rides_along_holds_no_cluster_and_no_pins(self):
        button = "g button\nv 1 0.6 0\nv 1.2 0.6 0\nv 1.1 0.6 0.2\nv 1.1 0.8 0.1\nf -4 -3 -2\nf -4 -1 -3\nf -3 -1 -2\nf -2 -1 -4\n"
        self.write("bar.obj", Bar().obj(groups=True) + button)
        self.author("new", self.path / "bar.obj")
        only, some = '{"group": "button"}', '{"group": ["button", "left"]}'
        self.author("add-part", "button", "--from", only)
        before = (self.path / "r.json").read_text()
        for command in (("add-pins", "p", "--from", only), ("add-cluster", "c", "--from", only)):
            with self.subTest(command):
                self.assertIn("rides along", self.author(*command, code=3).stderr)
                self.assertEqual((self.path / "r.json").read_text(), before)
        self.author("remove", "button")
        self.author("add-pins", "p", "--from", only)
        self.author("add-pins", "some", "--from", some)
        self.author("add-cluster", "c", "--from", only)
        self.author("add-cluster", "body", "--from", '{"group": ["left", "middle", "right"]}')
        self.assertIn("[pins-hold-nothing]", self.author("add-part", "button", "--from", only).stdout)
        # The bake and the doctor say the same, of what is held alone.
        self.bake(self.path / "r.json")
        checked = json.loads(run("check", self.path / "r.json", "--json").stdout)["findings"]
        for name, place in (("pins-hold-nothing", "p"), ("cluster-idle", "c")):
            found = [[f for f in findings if f["id"] == name] for findings in (self.report["findings"], checked)]
            self.assertEqual(found[0], found[1])
            self.assertEqual([f["place"] for f in found[0]], [place])
            self.assertIn("rides along", found[0][0]["message"])

    def test_set_takes_patterns_and_prints_what_changes(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.author("new", self.path / "bar.obj")
        self.author("add-clusters", "group")
        self.author("add-pins", "left_end", "--from", '{"half_space": [0.1, 0, 0], "normal": [-1, 0, 0]}')
        self.author("set", "middle.stretch_hz=7", "clusters.limit_max=2")
        said = self.author("set", "*.stretch_hz=5").stdout
        for line in ("left.stretch_hz: default -> 5", "middle.stretch_hz: 7 -> 5", "right.stretch_hz: default -> 5"):
            self.assertIn(line, said)
        self.assertNotIn("left_end", said)
        self.assertEqual([c["settings"]["stretch_hz"] for c in self.recipe()["clusters"]], [5, 5, 5])
        self.assertIn("left.mode: default -> \"linear\"", self.author("set", "clusters.l*.mode=linear").stdout)
        said = self.author("set", "clusters.limit_m*=default").stdout
        self.assertIn("clusters.limit_max: 2 -> default", said)
        self.assertNotIn("clusters.limit_min", said)
        self.assertIn("nothing changed", self.author("set", "*.stretch_hz=5").stdout)
        # In every place of a key; what matches nothing says so.
        self.author("set", "tetra*.vert*=900", "middle.*_hz=8", "l*.limit_m*=1")
        self.assertEqual(self.recipe()["settings"], {"tetrahedra.vertices": 900})
        self.assertEqual(self.recipe()["clusters"][1]["settings"], {"stretch_hz": 8, "bend_hz": 8, "twist_hz": 8})
        left = self.recipe()["clusters"][0]["settings"]
        self.assertEqual(left, {"stretch_hz": 5, "mode": "linear", "limit_min": 1, "limit_max": 1})
        self.assertIn("left.mode: \"linear\" -> default", self.author("set", "*.*=default").stdout)
        self.assertTrue(all("settings" not in c for c in self.recipe()["clusters"]))
        self.assertIn("tetrahedra.vertices: 900 -> default", self.author("set", "*=default").stdout)
        self.assertNotIn("settings", self.recipe())
        for key in ("x*.stretch_hz", "*.strech_hz", "*.stretch?hz", "clusters.m?de", "x*"):
            self.assertIn(f"'{key}' matches nothing. *", self.author("set", key + "=5", code=2).stderr)
        self.assertIn("without patterns", self.author("set", "/clusters/*/from=default", code=2).stderr)
        # Of things of one name each line says which.
        self.author("add-pins", "left", "--from", '{"group": "left"}')
        said = self.author("set", '*.from={"group": "right"}').stdout
        for line in ("  clusters.left.from:", "  pins.left.from:", "  middle.from:"):
            self.assertIn(line, said)

    def test_a_fibre_is_mirrored_about_the_plane_that_is_found(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.author("new", self.path / "bar.obj")
        self.author("add-cluster", "wing.L", "--from", '{"group": "left"}')
        self.author("set", "wing.L.channel=flap.L", "wing.L.fibre=[1, 0.5, 0.25]")
        self.author("mirror", "wing.L")
        fibre = self.recipe()["clusters"][1]["fibre"]
        for found, wanted in zip(fibre, (-1, 0.5, 0.25)):
            self.assertAlmostEqual(found, wanted, 3)
        self.author("mirror", "wing.L", "--to", "other", "--plane", "z")
        self.assertEqual(self.recipe()["clusters"][2]["fibre"], [1, 0.5, -0.25])

    def test_pins_and_parts_are_mirrored_with_the_names_that_have_sides(self):
        self.write("bar.obj", Bar().obj(groups=True))
        end = {"half_space": [0.1, 0, 0], "normal": [-1, 0, 0]}
        self.write("r.json", {"sinew_recipe": 3, "source": "bar.obj", "masks": {"lid": {"all": True}},
                              "clusters": [{"name": "end.L", "from": {"group": "left"}}],
                              "pins": [{"name": "p.L", "from": end, "target": "hand.L", "method": "hold"},
                                       {"name": "end.L", "from": end}]})
        self.author("mirror", "p.L", "--plane", "x")
        self.assertEqual(self.recipe()["pins"][2], {"name": "p.R", "from": {"mirror": end, "plane": "x"}, "target": "hand.R", "method": "hold"})
        self.author("mirror", "end.L")
        self.assertEqual([c["name"] for c in self.recipe()["clusters"]], ["end.L", "end.R"])
        self.author("mirror", "end.L", "--list", "pins")
        self.assertEqual(self.recipe()["pins"][3], {"name": "end.R", "from": {"mirror": end}})
        shown = json.loads(self.author("show", "p.L", "p.R", "--json").stdout)["selections"]
        self.assertEqual(shown[0]["visual_vertices"], shown[1]["visual_vertices"])
        # A list without it does not offer it, and it has no side.
        for list_, offered in (("masks", "Did you mean lid?"), ("parts", "none yet")):
            said = self.author("mirror", "end.L", "--list", list_, code=2).stderr
            self.assertIn(offered, said)
        self.assertIn("no side", self.author("mirror", "lid", code=2).stderr)
        recipe = self.recipe()
        for to, image in (("end.L", "end.R"), ("lid", {"mirror": "lid"}), ({"group": "left"}, {"mirror": {"group": "left"}})):
            with self.subTest(to):
                self.write("r.json", {**recipe, "parts": [{"name": "eye.L", "from": {"part": 0}, "attach": "follow", "to": to}],
                                      "pins": []})
                self.author("mirror", "eye.L")
                self.assertEqual(self.recipe()["parts"][1], {"name": "eye.R", "from": {"mirror": {"part": 0}}, "attach": "follow", "to": image})

    def test_suggested_commands_run_as_they_stand(self):
        folder = self.path / "it's here & there"
        folder.mkdir()
        (folder / "my bar.obj").write_text(Bar().obj(groups=True))
        recipe = folder / "my recipe.json"
        said = run("author", recipe, "new", folder / "my bar.obj").stdout
        command = said[said.index("sinew author"):].strip()
        self.assertEqual(shlex.split(command), ["sinew", "author", str(recipe), "add-clusters", "part"])
        done = subprocess.run(["sh", "-c", command.replace("sinew ", SINEW + " ", 1)], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        said = run("author", recipe, "add-mask", "m", "--from", '{"sphere": [9, 9, 9], "radius": 1}').stderr
        words = shlex.split(said[said.index("sinew author"):].strip().removesuffix("."))
        self.assertEqual(words, ["sinew", "author", str(recipe), "show"])

    def test_hand_edits_are_steps_and_version_1_migrates(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.write("r.json", {"sinew_recipe": 1, "source": "bar.obj"})
        self.author("add-cluster", "c", "--from", '{"group": "left"}')
        self.assertEqual(self.recipe()["sinew_recipe"], 3)
        edited = (self.path / "r.json").read_text().replace('"left"', '"right"')
        self.write("r.json", edited)
        self.author("add-mask", "m", "--from", '{"all": true}')
        self.author("undo")
        self.assertEqual((self.path / "r.json").read_text(), edited)
        self.author("undo")
        self.assertIn('"left"', (self.path / "r.json").read_text())
        self.author("undo")
        self.assertEqual(self.recipe()["sinew_recipe"], 1)

    def test_show_draws(self):
        self.write("bar.obj", Bar().obj(groups=True))
        self.author("new", self.path / "bar.obj")
        self.author("add-cluster", "c", "--from", '{"group": "left"}')
        picture = self.path / "weights.png"
        self.author("show", "-o", picture)
        self.assertTrue(picture.read_bytes().startswith(b"\x89PNG"))
        # A mask and a cluster of one name and place differ in their captions.
        self.author("add-mask", "c", "--from", '{"group": "left"}')
        self.author("show", "c", "-o", picture)
        width, _, rows = read_png(picture)
        ink = [{(i, y) for y in range(362, 386) for i in range(300) if max(rows[y][3 * (x + i):3 * (x + i) + 3]) < 90}
               for x in (16, 16 + 306)]
        self.assertGreater(len(ink[0]), 30)
        self.assertNotEqual(*ink)


class Blending(Folder):
    """What the bake makes of authored weights on its way to clusters."""

    def recipe(self, **more):
        self.write("bar.obj", Bar().obj(groups=True))
        clusters = [{"name": n, "from": {"group": n}, "overlap": 0} for n in NAMES]
        return self.write("r.json", {"sinew_recipe": 2, "source": "bar.obj", "clusters": clusters, **more})

    def largest_jump(self, package):
        """Of a share over an edge of the tetrahedra."""
        shares = self.shares(package)
        edges = {(a, b) for t in package.records["TETS"] for a in t for b in t if a < b}
        return max(abs(shares.get((n, a), 0) - shares.get((n, b), 0)) for n in NAMES for a, b in edges)

    def test_soften_takes_jumps_out_of_weights(self):
        jumps = []
        for width in (0, 0.6, 1.2):
            package = self.bake(self.recipe(), "--set", f"clusters.soften_metres={width}")
            sums = {}
            for (_, v), share in self.shares(package).items():
                sums[v] = sums.get(v, 0) + share
            self.assertLess(max(abs(x - 1) for x in sums.values()), 1e-5)
            jumps.append(self.largest_jump(package))
        self.assertGreater(jumps[0], 0.5)
        self.assertLess(jumps[1], 0.7 * jumps[0])
        self.assertLess(jumps[2], 0.7 * jumps[1])

    def test_stray_pieces_are_left_to_the_others(self):
        self.write("bar.obj", Bar().obj(groups=True))
        left = {"or": [{"group": "left"}, {"sphere": [3, 0.5, 0.5], "radius": 0.2}]}
        clusters = [{"name": "left", "from": left, "overlap": 0}, {"name": "all", "from": {"all": True}}]
        package = self.bake(self.write("r.json", {"sinew_recipe": 2, "source": "bar.obj", "clusters": clusters}))
        self.assertEqual(self.finding("cluster-strays")["severity"], "info")
        rest = package.records["PVTX"]
        centre = [(min(v[k] for v in rest) + max(v[k] for v in rest)) / 2 for k in range(3)]
        self.assertLess(max(rest[v][0] - centre[0] for (n, v) in self.shares(package) if n == "left"), 0.5)

    def test_colors_paint_in_order(self):
        colors = [{"from": {"all": True}, "color": [0, 0, 1]}, {"from": {"scale": {"group": "left"}, "by": 0.5}, "color": [1, 0, 0]}]
        package = self.bake(self.recipe(colors=colors))
        found = {tuple(c) for c in package.records["VCOL"]}
        self.assertEqual(found, {(0, 0, 255, 255), (128, 0, 128, 255)})
        bad = self.recipe(colors=[{"from": {"all": True}, "color": [0, 0, 2]}])
        result = run("bake", bad, "-o", self.path / "bad.sinew")
        self.assertEqual(result.returncode, 3)
        self.assertIn("r.json: ", result.stderr)
        self.assertIn("color", result.stderr)
        self.assertFalse((self.path / "bad.sinew").exists())


class RealFiles(Folder):
    """Sources that were not made for this test; what they have is in the data's own list."""

    def covered(self, source, selection):
        file = DATA / source
        if DATA is None or not file.exists():
            self.skipTest(f"{source} is not here")
        recipe = self.path / "r.json"
        # The data lies outside of this folder: a copy.
        (self.path / file.name).write_bytes(file.read_bytes())
        self.write("r.json", {"sinew_recipe": 2, "source": file.name, "clusters": [{"name": "c", "from": selection}]})
        result = run("author", recipe, "show", "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)["selections"][0]["coverage"]

    def test_groups_of_a_head(self):
        lips = self.covered("makehuman_head.obj", {"group": "lip_*"})
        upper = self.covered("makehuman_head.obj", {"group": "lip_upper"})
        self.assertTrue(0 < upper < lips < 0.2)
        left = self.covered("makehuman_head.obj", {"group": "brow_l"})
        mirrored = self.covered("makehuman_head.obj", {"mirror": {"group": "brow_r"}})
        self.assertAlmostEqual(left, mirrored, delta=0.1 * left)

    def test_bones_of_a_hand(self):
        every = self.covered("hand_rigged.glb", {"bone": "*"})
        self.assertAlmostEqual(every, 1, 3)

    def test_a_cluster_for_each_bone_that_moves_something(self):
        self.covered("hand_rigged.glb", {"all": True})  # a copy
        recipe = self.path / "bones.json"
        self.assertEqual(run("author", recipe, "new", self.path / "hand_rigged.glb").returncode, 0)
        result = run("author", recipe, "add-clusters", "bone", "thumb-*", "wrist", "--options", '{"weights": "dominant"}')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("nothing belongs to them: thumb-tip", result.stdout)
        clusters = json.loads(recipe.read_text())["clusters"]
        self.assertEqual([c["name"] for c in clusters],
                         ["thumb-phalanx-distal", "thumb-phalanx-proximal", "thumb-metacarpal", "wrist"])
        self.assertEqual(clusters[3]["from"], {"bone": "wrist", "weights": "dominant"})

    def test_colours_of_a_penguin(self):
        red = self.covered("penguin_painted.ply", {"color": "r"})
        blue = self.covered("penguin_painted.ply", {"color": [0, 0, 1], "tolerance": 0.5})
        self.assertTrue(0 < red < 1 and 0 < blue < 1)

    def test_parts_of_a_spider(self):
        parts = [self.covered("spider/spider.obj", {"part": i}) for i in range(18)]
        self.assertTrue(all(p > 0 for p in parts))
        self.assertAlmostEqual(sum(parts), 1, 1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--data")
    options, rest = parser.parse_known_args()
    SINEW = options.sinew
    DATA = pathlib.Path(options.data) if options.data else None
    unittest.main(argv=[sys.argv[0], *rest])
