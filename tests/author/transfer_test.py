#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sinew author transfer`: a head's recipe carried over to the same head shuffled, subdivided, shaken, thinned out, in
other formats, unit and axes. Cluster weights of the packages must agree at the same places of the surface."""
import argparse
import heapq
import json
import math
import os
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "formats"))
import read_package  # noqa: E402

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
TESTS = pathlib.Path(__file__).resolve().parent.parent
MODELS = TESTS / "assets" / "models"
TABLE = None  # a table of what was measured, for people


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=600 * SLOWNESS)


class Mesh:
    """Points, UVs, faces as lists of (point, uv), and the group of each face."""

    def __init__(self):
        self.points, self.uvs, self.faces, self.groups = [], [], [], []
        self.origin = None  # for each point the point of the original that it is, or None

    @staticmethod
    def read(path):
        mesh = Mesh()
        groups = ""
        for line in pathlib.Path(path).read_text().splitlines():
            words = line.split()
            if line.startswith("v "):
                mesh.points.append(tuple(map(float, words[1:4])))
            elif line.startswith("vt "):
                mesh.uvs.append(tuple(map(float, words[1:3])))
            elif line.startswith("g "):
                groups = line
            elif line.startswith("f "):
                corners = [w.split("/") for w in words[1:]]
                mesh.faces.append([(int(c[0]) - 1, int(c[1]) - 1 if len(c) > 1 and c[1] else None) for c in corners])
                mesh.groups.append(groups)
        mesh.origin = list(range(len(mesh.points)))
        return mesh

    def copy(self):
        mesh = Mesh()
        mesh.points, mesh.uvs, mesh.faces = self.points[:], self.uvs[:], [f[:] for f in self.faces]
        mesh.groups, mesh.origin = self.groups[:], self.origin[:]
        return mesh

    def diagonal(self):
        return math.dist([min(c) for c in zip(*self.points)], [max(c) for c in zip(*self.points)])

    # ---- Changes ----

    def shuffled(self, seed=1):
        rng = random.Random(seed)
        mesh = self.copy()
        order = list(range(len(self.points)))
        rng.shuffle(order)
        place = {old: new for new, old in enumerate(order)}
        mesh.points = [self.points[i] for i in order]
        mesh.origin = [self.origin[i] for i in order]
        faces = [([(place[p], t) for p, t in f], g) for f, g in zip(self.faces, self.groups)]
        rng.shuffle(faces)
        mesh.faces, mesh.groups = [f for f, _ in faces], [g for _, g in faces]
        return mesh

    def subdivided(self):
        mesh = self.copy()
        mesh.faces, mesh.groups = [], []
        middle, middle_uv = {}, {}

        def between(a, b):
            p = tuple(sorted((a[0], b[0])))
            if p not in middle:
                middle[p] = len(mesh.points)
                mesh.points.append(tuple((x + y) / 2 for x, y in zip(self.points[p[0]], self.points[p[1]])))
                mesh.origin.append(None)
            if a[1] is None:
                return middle[p], None
            t = tuple(sorted((a[1], b[1])))
            if t not in middle_uv:
                middle_uv[t] = len(mesh.uvs)
                mesh.uvs.append(tuple((x + y) / 2 for x, y in zip(self.uvs[t[0]], self.uvs[t[1]])))
            return middle[p], middle_uv[t]

        for face, group in zip(self.faces, self.groups):
            n = len(face)
            edges = [between(face[i], face[(i + 1) % n]) for i in range(n)]
            if n == 3:
                for i in range(3):
                    mesh.faces.append([face[i], edges[i], edges[i - 1]])
                mesh.faces.append(edges)
            else:
                center = (len(mesh.points), None if face[0][1] is None else len(mesh.uvs))
                mesh.points.append(tuple(sum(self.points[c[0]][k] for c in face) / n for k in range(3)))
                mesh.origin.append(None)
                if face[0][1] is not None:
                    mesh.uvs.append(tuple(sum(self.uvs[c[1]][k] for c in face) / n for k in range(2)))
                for i in range(n):
                    mesh.faces.append([face[i], edges[i], center, edges[i - 1]])
            mesh.groups += [group] * (len(mesh.faces) - len(mesh.groups))
        return mesh

    def shaken(self, part, seed=1):
        rng = random.Random(seed)
        mesh = self.copy()
        reach = part * self.diagonal()
        mesh.points = [tuple(c + rng.uniform(-reach, reach) for c in p) for p in self.points]
        return mesh

    def mapped(self, function):
        mesh = self.copy()
        mesh.points = [tuple(function(p)) for p in self.points]
        return mesh

    def without(self, uvs=False, groups=True):
        mesh = self.copy()
        if uvs:
            mesh.uvs, mesh.faces = [], [[(p, None) for p, _ in f] for f in self.faces]
        if groups:
            mesh.groups = ["" for _ in self.groups]
        return mesh

    def thinned(self, part):
        """Shortest edges collapsed onto one of their ends until `part` of the points is left; loses UVs and groups."""
        triangles = {}
        around = {}
        for face in self.faces:
            for k in range(1, len(face) - 1):
                corners = [face[0][0], face[k][0], face[k + 1][0]]
                number = len(triangles)
                triangles[number] = corners
                for c in corners:
                    around.setdefault(c, set()).add(number)
        points = self.points

        def normal(corners):
            a, b, c = (points[i] for i in corners)
            u, v = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(a, c)]
            return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]

        def ring(v):
            return {c for t in around[v] for c in triangles[t]} - {v}

        def border(v):
            return any(sum(w in triangles[t] for t in around[v]) != 2 for w in ring(v))

        heap = []

        def push(v):
            for w in ring(v):
                heapq.heappush(heap, (math.dist(points[v], points[w]), v, w))
        for v in list(around):
            push(v)
        left = len(around)
        wanted = part * left
        while left > wanted and heap:
            _, gone, kept = heapq.heappop(heap)
            if gone not in around or kept not in around or kept not in ring(gone) or border(gone):
                continue
            if len(ring(gone) & ring(kept)) != 2:
                continue
            moved = [t for t in around[gone] if kept not in triangles[t]]
            turns = False
            for t in moved:
                before = normal(triangles[t])
                after = normal([kept if c == gone else c for c in triangles[t]])
                dot = sum(x * y for x, y in zip(before, after))
                if dot <= 0.5 * math.sqrt(sum(x * x for x in before) * sum(x * x for x in after)):
                    turns = True
            if turns:
                continue
            for t in list(around[gone]):
                if kept in triangles[t]:
                    for c in triangles[t]:
                        around[c].discard(t)
                    del triangles[t]
                else:
                    triangles[t] = [kept if c == gone else c for c in triangles[t]]
                    around[kept].add(t)
            del around[gone]
            left -= 1
            push(kept)
        number = {v: i for i, v in enumerate(sorted(around))}
        mesh = Mesh()
        mesh.points = [points[v] for v in sorted(around)]
        mesh.origin = [self.origin[v] for v in sorted(around)]
        mesh.faces = [[(number[c], None) for c in corners] for corners in triangles.values()]
        mesh.groups = ["" for _ in mesh.faces]
        return mesh

    # ---- Formats ----

    def obj(self):
        lines = ["o head"]
        lines += ["v %.9g %.9g %.9g" % p for p in self.points] + ["vt %.9g %.9g" % t for t in self.uvs]
        group = ""
        for face, name in zip(self.faces, self.groups):
            if name != group:
                lines.append(name)
                group = name
            lines.append("f " + " ".join(str(p + 1) if t is None else f"{p + 1}/{t + 1}" for p, t in face))
        return "\n".join(lines) + "\n"

    def ply(self):
        lines = ["ply", "format ascii 1.0", f"element vertex {len(self.points)}", "property float x",
                 "property float y", "property float z", f"element face {len(self.faces)}",
                 "property list uchar int vertex_indices", "end_header"]
        lines += ["%.9g %.9g %.9g" % p for p in self.points]
        lines += [" ".join(map(str, [len(f)] + [p for p, _ in f])) for f in self.faces]
        return "\n".join(lines) + "\n"

    def corners(self):
        """Corners that differ in UV become vertices of their own, as glTF wants; origin as in the points."""
        number, points, uvs, origin, triangles = {}, [], [], [], []
        for face in self.faces:
            row = []
            for corner in face:
                if corner not in number:
                    number[corner] = len(points)
                    points.append(self.points[corner[0]])
                    uvs.append(self.uvs[corner[1]] if corner[1] is not None else (0, 0))
                    origin.append(self.origin[corner[0]])
                row.append(number[corner])
            triangles += [(row[0], row[k], row[k + 1]) for k in range(1, len(row) - 1)]
        return points, uvs, origin, triangles

    def glb(self):
        points, uvs, _, triangles = self.corners()
        chunks = [b"".join(struct.pack("<3f", *p) for p in points),
                  b"".join(struct.pack("<2f", u, 1 - v) for u, v in uvs),
                  b"".join(struct.pack("<3I", *t) for t in triangles)]
        views, at = [], 0
        for chunk in chunks:
            views.append({"buffer": 0, "byteOffset": at, "byteLength": len(chunk)})
            at += len(chunk)
        gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                "meshes": [{"name": "head", "primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1},
                                                            "indices": 2}]}],
                "buffers": [{"byteLength": at}], "bufferViews": views,
                "accessors": [{"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3",
                               "min": [min(c) for c in zip(*points)], "max": [max(c) for c in zip(*points)]},
                              {"bufferView": 1, "componentType": 5126, "count": len(uvs), "type": "VEC2"},
                              {"bufferView": 2, "componentType": 5125, "count": 3 * len(triangles), "type": "SCALAR"}]}
        text = json.dumps(gltf).encode()
        text += b" " * (-len(text) % 4)
        data = b"".join(chunks)
        data += b"\0" * (-len(data) % 4)
        return (struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(data)) +
                struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data)

    def fbx(self):
        """ASCII FBX, as exporters of old wrote it: one mesh with UVs."""
        index = [(-p - 1 if k == len(f) - 1 else p) for f in self.faces for k, (p, _) in enumerate(f)]
        uv_index = [t for f in self.faces for _, t in f]
        numbers = lambda values: ",".join("%.9g" % x for x in values)  # noqa: E731
        return f"""; FBX 7.3.0 project file
FBXHeaderExtension:  {{
	FBXHeaderVersion: 1003
	FBXVersion: 7300
}}
GlobalSettings:  {{
	Version: 1000
	Properties70:  {{
		P: "UpAxis", "int", "Integer", "",1
		P: "UpAxisSign", "int", "Integer", "",1
		P: "FrontAxis", "int", "Integer", "",2
		P: "FrontAxisSign", "int", "Integer", "",1
		P: "CoordAxis", "int", "Integer", "",0
		P: "CoordAxisSign", "int", "Integer", "",1
		P: "UnitScaleFactor", "double", "Number", "",1
	}}
}}
Definitions:  {{
	Version: 100
	Count: 2
	ObjectType: "Model" {{
		Count: 1
	}}
	ObjectType: "Geometry" {{
		Count: 1
	}}
}}
Objects:  {{
	Geometry: 1000, "Geometry::head", "Mesh" {{
		Vertices: *{3 * len(self.points)} {{
			a: {numbers(c for p in self.points for c in p)}
		}}
		PolygonVertexIndex: *{len(index)} {{
			a: {",".join(map(str, index))}
		}}
		GeometryVersion: 124
		LayerElementUV: 0 {{
			Version: 101
			Name: "map1"
			MappingInformationType: "ByPolygonVertex"
			ReferenceInformationType: "IndexToDirect"
			UV: *{2 * len(self.uvs)} {{
				a: {numbers(c for t in self.uvs for c in t)}
			}}
			UVIndex: *{len(uv_index)} {{
				a: {",".join(map(str, uv_index))}
			}}
		}}
		Layer: 0 {{
			Version: 100
			LayerElement:  {{
				Type: "LayerElementUV"
				TypedIndex: 0
			}}
		}}
	}}
	Model: 2000, "Model::head", "Mesh" {{
		Version: 232
	}}
}}
Connections:  {{
	C: "OO",2000,0
	C: "OO",1000,2000
}}
"""


HEAD = {
    "sinew_recipe": 2, "source": "head.obj",
    "settings": {"import.unit": "dm", "tetrahedra.vertices": 1500, "clusters.overlap_metres": 0.012},
    "masks": {"lips": {"group": "lip_*"},
              "chin": {"sphere": [0, 0.58, 0.11], "radius": 0.025, "falloff": 0.02},
              "nose": {"group": "nose"},
              "brow.R": {"strokes": "brow.json"},
              "brow.L": {"mirror": "brow.R", "plane": "x"},
              "mouth": {"grow": "lips", "by": 0.004},
              "cheek.L": {"disc": [0.04, 0.645, 0.105], "radius": 0.018, "falloff": 0.012},
              "jaw": {"minus": [{"or": [{"group": "jaw"}, "chin"]}, "lips"]},
              "ears": {"values": "ears.json"}},
    "clusters": [{"name": name, "from": name} for name in
                 ("nose", "brow.R", "brow.L", "mouth", "cheek.L", "jaw", "ears")] +
                [{"name": "rest", "from": {"rest": True}}],
    "pins": [{"name": "skull", "from": {"half_space": [0, 0, 0.0], "normal": [0, 0, -1], "falloff": 0.02}},
             {"name": "neck", "from": {"box": [[-0.2, 0.5, -0.1], [0.2, 0.56, 0.2]], "falloff": 0.01}}],
}
STROKES = {"strokes": [{"points": [[-0.01, 0.71, 0.13], [-0.04, 0.715, 0.12]], "radius": 0.008, "falloff": 0.008}]}


class Weights:
    """Of a package at its source vertices: shares of clusters, weights of masks."""

    def __init__(self, package):
        r = package.records
        of_physical = [{} for _ in r["PVTX"]]
        for c in r["CLUS"]:
            for vertex, _, share in r["MEMB"][c[4]:c[4] + c[5]]:
                name = package.text(c[0], c[1])
                of_physical[vertex][name] = of_physical[vertex].get(name, 0) + share
        of_visual = [{} for _ in r["VPOS"]]
        for m in r["MASK"]:
            for vertex, weight in r["MSKV"][m[2]:m[2] + m[3]]:
                of_visual[vertex][package.text(m[0], m[1])] = weight
        self.clusters, self.masks, self.place = {}, {}, {}
        origin = r["INFO"][0][:3]
        for v, (source, _) in enumerate(r["VSRC"]):
            tetrahedron, *w = r["ATBC"][v]
            w.append(1 - sum(w))
            sums = {}
            for corner, weight in zip(r["TETS"][tetrahedron], w):
                for name, share in of_physical[corner].items():
                    sums[name] = sums.get(name, 0) + weight * share
            self.clusters[source] = sums
            self.masks[source] = of_visual[v]
            self.place[source] = tuple(round(o + x, 5) for o, x in zip(origin, r["VPOS"][v]))


def difference(mine, other, pairs):
    """Root mean square difference of weights over the places where each lies in either, and the worst name's."""
    sums = {}
    for a, b in pairs:
        for name in mine[a].keys() | other[b].keys():
            x, y = mine[a].get(name, 0), other[b].get(name, 0)
            if x > 0.02 or y > 0.02:
                total = sums.setdefault(name, [0, 0])
                total[0] += (x - y) ** 2
                total[1] += 1
    each = {name: math.sqrt(s / n) for name, (s, n) in sums.items()}
    return math.sqrt(sum(s for s, _ in sums.values()) / sum(n for _, n in sums.values())), each


class Folder(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def write(self, name, content):
        path = self.path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content if isinstance(content, str) else json.dumps(content, indent=1))
        return path

    def bake(self, recipe):
        package = self.path / "out.sinew"
        result = run("bake", recipe, "-o", package, "--set", "field.functions=0")  # weights know nothing of them
        self.assertEqual(result.returncode, 0, result.stderr)
        return read_package.Package(package.read_bytes())

    def transfer(self, recipe, source, *arguments):
        result = run("author", recipe, "transfer", source, "--json", *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)


class Head(Folder):
    def original(self):
        head = Mesh.read(MODELS / "makehuman_head.obj")
        self.write("head.obj", head.obj())
        self.write("brow.json", STROKES)
        # Painted by number, as no other format or order of vertices can keep it.
        ear = lambda p: max(0, min(1, (abs(p[0]) - 0.6) * 10))  # noqa: E731
        self.write("ears.json", [round(ear(p), 4) for p in head.points])
        return head, self.write("head.json", HEAD)

    def test_weights_agree_whatever_changed(self):
        head, recipe = self.original()
        reference = Weights(self.bake(recipe))
        variants = {
            "shuffled": ("obj", head.shuffled()),
            "subdivided": ("obj", head.subdivided()),
            "subdivided, no groups or UVs": ("obj", head.subdivided().without(uvs=True)),
            "every vertex moved by 0.3 % of the size": ("obj", head.shaken(0.003).without()),
            "decimated to half, no groups or UVs": ("obj", head.thinned(0.5)),
            "glTF, triangles, no groups": ("glb", head.mapped(lambda p: [c / 10 for c in p])),
            "PLY, no groups or UVs": ("ply", head),
            "FBX in cm, no groups": ("fbx", head.mapped(lambda p: [c * 10 for c in p])),
            "100 times, z up": ("obj", head.mapped(lambda p: (100 * p[0], -100 * p[2], 100 * p[1]))),
            "1.3 times, turned 40 degrees, moved": ("obj", head.without().mapped(
                lambda p: (1.3 * (0.766044443 * p[0] + 0.6427876097 * p[2]) + 5, 1.3 * p[1] - 3,
                           1.3 * (-0.6427876097 * p[0] + 0.766044443 * p[2])))),
        }
        rows = []
        for number, (what, (kind, mesh)) in enumerate(variants.items()):
            with self.subTest(what):
                source = self.write(f"new{number}.{kind}", getattr(mesh, kind)())
                carried = self.path / f"carried{number}.json"
                report = self.transfer(recipe, source, "-o", carried)
                weights = Weights(self.bake(carried))
                origin = mesh.corners()[2] if kind == "glb" else mesh.origin
                if kind == "fbx":  # its reader numbers vertices anew: by place
                    vertex_at = {p: v for v, p in reference.place.items()}
                    origin = [vertex_at.get(weights.place.get(v)) for v in range(max(weights.place) + 1)]
                pairs = [(o, v) for v, o in enumerate(origin) if o is not None and o in reference.masks and
                         v in weights.masks]
                self.assertGreater(len(pairs), 2000)
                masks, each_mask = difference(reference.masks, weights.masks, pairs)
                clusters, each_cluster = difference(reference.clusters, weights.clusters, pairs)
                rows.append((what, masks, each_mask, clusters, each_cluster, report))
                self.assertEqual(each_mask.keys(), HEAD["masks"].keys())
                self.assertEqual(each_cluster.keys(), {c["name"] for c in HEAD["clusters"]})
                self.assertLess(masks, 0.02, each_mask)
                # Tetrahedra are made anew; where the surface or its place is another one, they are quite others.
                anew = "every vertex moved", "decimated", "1.3 times"
                self.assertLess(clusters, 0.1 if what.startswith(anew) else 0.05)
        if TABLE:
            with open(TABLE, "w") as out:
                for what, masks, each_mask, clusters, each_cluster, report in rows:
                    words = [s["name"] for s in report["selections"] if not s["stored"]]
                    print(what, "|", len(words), "of", len(report["selections"]), "| %.1e m | %.2f %% | %.2f %% |" %
                          (max(s["largest_metres"] for s in report["selections"]), 100 * masks, 100 * clusters),
                          "; ".join(report["notes"]), file=out)
                    print("    ", {k: round(v, 4) for k, v in each_mask.items()}, {
                        k: round(v, 4) for k, v in each_cluster.items()}, "stored:",
                          [s["kind"][0] + " " + s["name"] for s in report["selections"] if s["stored"]], file=out)


    def test_undo_brings_the_old_recipe_back(self):
        head, recipe = self.original()
        before = recipe.read_text()
        source = self.write("new.ply", head.shuffled(2).ply())
        report = self.transfer(recipe, source)
        self.assertEqual(pathlib.Path(report["mask_file"]).name, "head.masks.json")
        after = json.loads(recipe.read_text())
        self.assertEqual(after["source"], "new.ply")
        self.assertEqual(after["masks"]["ears"], {"stored": "head.masks.json", "mask": "ears"})
        self.assertEqual(after["masks"]["mouth"], HEAD["masks"]["mouth"])  # of words, though its lips are stored
        # Points of a mask file do not care about order.
        report = self.transfer(recipe, self.write("newer.ply", head.shuffled(3).ply()))
        self.assertIsNone(report["mask_file"])
        # One that needs a new file leaves the old one, which undo needs.
        report = self.transfer(recipe, self.write("larger.ply", head.mapped(lambda p: [1.1 * c for c in p]).ply()))
        self.assertEqual(pathlib.Path(report["mask_file"]).name, "head.masks.2.json")
        for _ in range(3):
            self.assertEqual(run("author", recipe, "undo").returncode, 0)
        self.assertEqual(recipe.read_text(), before)

    def test_the_same_file_changed(self):
        head, recipe = self.original()
        refused = run("author", recipe, "transfer", self.path / "head.obj")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--old", refused.stderr)
        (self.path / "head.obj").rename(self.path / "before.obj")
        self.write("head.obj", head.shuffled().obj())
        report = self.transfer(recipe, self.path / "head.obj", "--old", self.path / "before.obj")
        self.assertEqual([s["name"] for s in report["selections"] if s["stored"]], ["ears"])

    def refused(self, recipe, source, *words):
        before = sorted(p.name for p in self.path.iterdir())
        text = recipe.read_text()
        result = run("author", recipe, "transfer", source)
        self.assertEqual(result.returncode, 3, result.stdout)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        self.assertEqual(recipe.read_text(), text)
        self.assertEqual(sorted(p.name for p in self.path.iterdir()), before)

    def test_refuses_what_is_not_there(self):
        head, recipe = self.original()
        self.refused(recipe, self.write("torus.obj", (TESTS / "assets" / "generated" / "torus.obj").read_text()), "of its surface",
                     "another model")
        # The ears cut off.
        cut = head.without()
        kept = [f for f in cut.faces if all(abs(cut.points[p][0]) < 0.6 for p, _ in f)]
        cut.faces, cut.groups = kept, ["" for _ in kept]
        self.refused(recipe, self.write("cut.obj", cut.obj()), "mask ears", "remove ears")

    def test_parts_that_ride_along(self):
        head, recipe = self.original()
        parts = [{"name": "eye.L", "from": {"group": "eye_l"}, "attach": "rigid", "to": "rest"},
                 {"name": "eye.R", "from": {"group": "eye_r"}, "attach": "rigid",
                  "to": {"half_space": [0, 0, 0], "normal": [0, 0, -1]}}]
        self.write("head.json", {**HEAD, "parts": parts})
        self.transfer(recipe, self.write("new.ply", head.shuffled(2).ply()))
        carried = json.loads(recipe.read_text())["parts"]
        self.assertEqual(carried[0]["from"], {"stored": "head.masks.json", "mask": "eye.L"})
        self.assertEqual(carried[0]["to"], "rest")
        self.assertEqual(carried[1]["to"], parts[1]["to"])
        self.bake(recipe)

    def test_recipe_in_another_folder(self):
        _, recipe = self.original()
        (self.path / "new").mkdir()
        report = self.transfer(recipe, self.write("new/head.obj", Mesh.read(self.path / "head.obj").obj()), "-o",
                               self.path / "new" / "head.json")
        carried = json.loads((self.path / "new" / "head.json").read_text())
        self.assertEqual(carried["project"], "..")
        self.assertEqual(carried["masks"]["brow.R"], {"strokes": "../brow.json"})
        self.assertTrue(all(not s["stored"] for s in report["selections"]))
        self.assertEqual(json.loads(recipe.read_text()), HEAD)


class WhoIsWho(Folder):
    def ask(self, *question, code=0):
        result = run("inspect", self.path / "out.sinew", *question, "--json")
        self.assertEqual(result.returncode, code, result.stderr)
        return json.loads(result.stdout) if code == 0 else result.stderr

    def test_by_number_and_by_name(self):
        self.write("head.obj", Mesh.read(MODELS / "makehuman_head.obj").obj())
        package = self.bake(self.write("head.json", {
            "sinew_recipe": 2, "source": "head.obj", "settings": {"import.unit": "dm", "tetrahedra.vertices": 600},
            "masks": {"tip": {"sphere": [0, 0.66, 0.15], "radius": 0.02, "falloff": 0.01}},
            "clusters": [{"name": "nose", "from": "tip", "channel": "sneeze"}, {"name": "rest", "from": {"rest": True}}],
            "pins": [{"name": "skull", "from": {"half_space": [0, 0, 0], "normal": [0, 0, -1]}}]}))
        r = package.records
        mask = dict(r["MSKV"])
        source = next(s for s in range(len(r["SVTX"])) if r["SVTX"][s][2] > 1 and
                      r["SVLS"][r["SVTX"][s][1]][0] in mask)
        answer = self.ask("--vertex", f"source:{source}")
        welded, first, count = r["SVTX"][source]
        visual = [v for (v,) in r["SVLS"][first:first + count]]
        self.assertEqual([v["vertex"] for v in answer["visual"]], visual)
        self.assertEqual(answer["source"], [{"vertex": source, "mesh": "head", "vertex_in_mesh": source}])
        for v in answer["visual"]:
            self.assertEqual((v["source"], v["welded"]), (source, welded))
            tetrahedron, *weights = r["ATBC"][v["vertex"]]
            self.assertEqual(v["attachment"]["tetrahedron"], tetrahedron)
            self.assertEqual(v["attachment"]["physical"], list(r["TETS"][tetrahedron]))
            self.assertAlmostEqual(sum(v["attachment"]["weights"]), 1, 5)
            self.assertEqual([(m["name"], m["weight"] > 0) for m in v["masks"]], [("tip", True)])
            self.assertIn("body", v["groups"])
        self.assertEqual(self.ask("--vertex", f"welded:{welded}")["source"], answer["source"])
        self.assertEqual(self.ask("--vertex", f"head:{source}")["visual"], answer["visual"])
        physical = answer["physical"][0]
        self.assertAlmostEqual(sum(c["share"] for c in physical["clusters"]), 1, 3)
        back = self.ask("--vertex", f"physical:{physical['vertex']}")
        self.assertIn(visual[0], [v["vertex"] for v in back["visual"]])
        for v in back["visual"]:
            self.assertIn(physical["vertex"], v["attachment"]["physical"])

        named = self.ask("--name", "tip")["masks"][0]
        self.assertEqual(dict(zip(named["visual"], named["weights"])).keys(), mask.keys())
        held = r["PSTV"][r["PSET"][0][5]:r["PSET"][0][5] + r["PSET"][0][6]]
        self.assertEqual(self.ask("--name", "skull")["pin_sets"][0]["physical"], [v for (v,) in held])
        self.assertEqual(self.ask("--name", "sneeze")["channels"], [{"number": 0, "clusters": ["nose"]}])
        members = self.ask("--name", "nose")
        self.assertEqual(set(members) - {"asked"}, {"clusters", "groups"})
        self.assertIn("counted from 0", self.ask("--vertex", "source:999999", code=2))
        self.assertIn("Did you mean skull?", self.ask("--name", "skul", code=2))
        self.assertIn("Write it as in", self.ask("--vertex", "12", code=2))


class Others(Folder):
    def carried(self, recipe, source):
        report = self.transfer(self.write("recipe.json", recipe), source, "-o", self.path / "carried.json")
        self.bake(self.path / "carried.json")
        return {s["name"]: s for s in report["selections"]}

    def bare(self, source):
        """The drawn surface alone, as OBJ, its vertices in reverse order."""
        package = self.bake(source)
        r = package.records
        origin = r["INFO"][0][:3]
        last = len(r["VPOS"])
        return self.write("bare.obj", "".join("v %.9g %.9g %.9g\n" % tuple(o + x for o, x in zip(origin, p))
                                              for p in reversed(r["VPOS"])) +
                          "".join("f %d %d %d\n" % tuple(last - i for i in t) for t in r["VTRI"]))

    def check_stored(self, name, selection):
        source = self.write(name, (MODELS / name).read_bytes())
        found = self.carried({"sinew_recipe": 2, "source": name, "clusters": [
            {"name": "some", "from": selection}, {"name": "rest", "from": {"rest": True}}]}, self.bare(source))["some"]
        self.assertTrue(found["stored"])
        self.assertAlmostEqual(found["new_area"] / found["old_area"], 1, 3)

    def test_a_painted_penguin_loses_its_colours(self):
        self.check_stored("penguin_painted.ply", {"color": "r"})

    def test_a_rigged_hand_loses_its_bones(self):
        self.check_stored("hand_rigged.glb", {"bone": "*index*"})

    def test_what_selects_nothing_is_not_all_carried_over(self):
        cow = Mesh.read(TESTS.parent / "samples" / "assets" / "spot" / "spot.obj")
        self.write("spot.obj", cow.obj())
        recipe = self.write("r.json", {"sinew_recipe": 3, "source": "spot.obj",
                                       "masks": {"far": {"sphere": [9, 9, 9], "radius": 0.1}, "some": {"half_space": [0, 0, 0], "normal": [1, 0, 0]}}})
        result = run("author", recipe, "transfer", self.write("new.obj", cow.shuffled().obj()))
        self.assertEqual(result.returncode, 0, result.stderr)
        line = {words[1]: words for words in map(str.split, result.stdout.splitlines()) if words[:1] == ["mask"] and len(words) > 8}
        self.assertEqual(line["far"][-1], "nothing")
        self.assertEqual(line["some"][-1], "%")
        self.assertIn("mask far selects nothing", result.stdout)

    def test_a_cow_scaled_and_thinned(self):
        cow = Mesh.read(TESTS.parent / "samples" / "assets" / "spot" / "spot.obj")
        self.write("spot.obj", cow.obj())
        thin = cow.thinned(0.5).mapped(lambda p: [3 * c for c in p])
        found = self.carried({"sinew_recipe": 2, "source": "spot.obj", "clusters": [
            {"name": "head", "from": {"sphere": [0, 0.55, -0.6], "radius": 0.35, "falloff": 0.1}},
            {"name": "rest", "from": {"rest": True}, "overlap": 0.1}]}, self.write("thin.obj", thin.obj()))
        self.assertFalse(found["head"]["stored"])
        self.assertAlmostEqual(found["head"]["new_area"] / found["head"]["old_area"], 1, 1)  # of the scale of the new one
        carried = json.loads((self.path / "carried.json").read_text())["clusters"]
        self.assertAlmostEqual(carried[0]["from"]["radius"], 1.05, 3)
        self.assertAlmostEqual(carried[1]["settings"]["overlap"], 0.3, 3)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--table", help="where to write a table of all figures")
    options, rest = parser.parse_known_args()
    SINEW, TABLE = options.sinew, options.table
    unittest.main(argv=[sys.argv[0], *rest])
