#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The face of samples/gallery/face: it bakes, its muscles make the expressions that its scenes are named after, and they are drawn.

Lengths are parts of the head's height."""
import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
FACE = pathlib.Path(__file__).resolve().parents[2] / "samples" / "gallery" / "face"
HEAD = pathlib.Path(__file__).resolve().parents[1] / "assets" / "models" / "makehuman_head.obj"
HEIGHT = 0.249  # m, of the head


def run(*arguments):
    done = subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=120 * SLOWNESS)
    if done.returncode != 0:
        raise AssertionError(f"sinew {' '.join(map(str, arguments))}: {done.returncode}\n{done.stderr}")
    return done.stdout


def read_points(path):
    return [tuple(map(float, line.split()[1:4])) for line in path.read_text().splitlines() if line.startswith("v ")]


def read_source():
    """Points of the source in metres, its faces with the names of their groups, and the points of each group."""
    points, faces, groups, current = [], [], {}, []
    for line in HEAD.read_text().splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == "v":
            points.append(tuple(float(x) / 10 for x in words[1:4]))
        elif words[0] == "g":
            current = words[1:]
        elif words[0] == "f":
            face = [int(w.split("/")[0]) - 1 for w in words[1:]]
            faces.append((face, current))
            for name in current:
                groups.setdefault(name, set()).update(face)
    return points, faces, {name: [points[i] for i in sorted(members)] for name, members in groups.items()}


def edges_of(face):
    return zip(face, face[1:] + face[:1])


def normal_of(face, points):
    """Newell's, not unit."""
    n = [0, 0, 0]
    for i, j in edges_of(face):
        a, b = points[i], points[j]
        for k in range(3):
            n[k] += (a[(k + 1) % 3] - b[(k + 1) % 3]) * (a[(k + 2) % 3] + b[(k + 2) % 3])
    return n


def angle(a, b):
    """Between two vectors, degrees."""
    lengths = (sum(x * x for x in a) * sum(x * x for x in b)) ** 0.5
    return math.degrees(math.acos(max(-1, min(1, sum(x * y for x, y in zip(a, b)) / lengths))))


class Face(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.package = pathlib.Path(cls.folder.name) / "face.sinew"
        report = pathlib.Path(cls.folder.name) / "report.json"
        run("bake", FACE / "recipe.json", "-o", cls.package, "--report", report)
        cls.report = json.loads(report.read_text())
        cls.about = json.loads(run("inspect", cls.package, "--json"))
        cls.rest = cls.pose("rest", 0.05)
        cls.points, cls.faces, cls.groups = read_source()
        cls.moved = {name: cls.pose(name, seconds)
                     for name, seconds in (("smile", 1.2), ("frown", 1.2), ("jaw_drop", 1.2), ("blink", 0.35))}
        near = {tuple(round(1e4 * x) for x in p): i for i, p in enumerate(cls.rest)}
        neighbours = [(x, y, z) for x in (0, -1, 1) for y in (0, -1, 1) for z in (0, -1, 1)]
        cls.visual = []
        for point in cls.points:
            at = [round(1e4 * p) for p in point]
            keys = (tuple(a + d for a, d in zip(at, by)) for by in neighbours)
            cls.visual.append(next(near[k] for k in keys if k in near))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    @classmethod
    def pose(cls, scene, seconds):
        out = pathlib.Path(cls.folder.name) / f"{scene}.obj"
        run("simulate", cls.package, "--scene", FACE / f"{scene}.json", "--seconds", seconds, "--export", out, "--frame", "scene")
        return read_points(out)

    def source(self, pose):
        """Points of the source in a pose, in its numbering."""
        return [pose[v] for v in self.visual]

    def vertex(self, place):
        """The visual vertex at a point of the source."""
        squared = [sum((a - b) ** 2 for a, b in zip(x, place)) for x in self.rest]
        found = min(range(len(squared)), key=squared.__getitem__)
        self.assertLess(squared[found] ** 0.5, 1e-5, place)
        return found

    def motion(self, scene, place):
        v = self.vertex(place)
        return [(a - b) / HEIGHT for a, b in zip(self.moved[scene][v], self.rest[v])]

    def extreme(self, group, key, near=None):
        candidates = [p for p in self.groups[group] if near is None or abs(p[0] - near) < 0.003]
        return max(candidates, key=key)

    @staticmethod
    def mirrored(place):
        return (-place[0], place[1], place[2])

    def both(self, scene, place):
        """Motion of a point and of its mirror image, the latter mirrored back."""
        left, right = self.motion(scene, place), self.motion(scene, self.mirrored(place))
        right[0] = -right[0]
        size = sum(x * x for x in left) ** 0.5
        for a, b in zip(left, right):
            self.assertAlmostEqual(a, b, delta=0.15 * size, msg=f"{scene}: the two sides differ")
        return [(a + b) / 2 for a, b in zip(left, right)]

    def corner(self):
        return self.extreme("lip_upper", lambda p: p[0])

    def test_has_its_muscles_and_pins(self):
        names = self.about["channels"]
        self.assertGreaterEqual(len(names), 24)
        for name in ("frontalis", "corrugator", "orbicularis_oculi_upper", "orbicularis_oculi_lower", "levator_labii", "zygomaticus_major",
                     "zygomaticus_minor", "risorius", "buccinator", "masseter", "depressor_anguli_oris", "depressor_labii", "mentalis"):
            self.assertIn(name + ".L", names)
            self.assertIn(name + ".R", names)
        self.assertIn("orbicularis_oris_upper", names)
        self.assertEqual({p["target"] for p in self.about["pin_sets"]}, {"skull", "jaw", "lids", "lids_lower"})

    def test_check_is_clean(self):
        findings = json.loads(run("check", self.package, "--json"))["findings"]
        self.assertEqual([f for f in findings if f["severity"] != "info"], [])

    def test_costs_little(self):
        """A frame costs what functions times samples cost: 0.2 ms of one core for these."""
        fields = self.report["fields"]
        self.assertEqual(len(fields), 1)
        self.assertLessEqual(fields[0]["held"]["functions"], 80)
        self.assertLessEqual(fields[0]["held"]["samples"], 400)
        self.assertLessEqual(fields[0]["free"]["functions"], 32)
        for scene in self.moved:
            self.assertEqual(json.loads((FACE / f"{scene}.json").read_text())["iterations"], 1)

    def test_says_what_each_part_of_it_costs(self):
        # Numbers of 16 bits are too coarse for skin of a millimetre: without `exact` it keeps those of 32.
        cost = json.loads(run("inspect", self.package, "--cost", "--json"))
        self.assertEqual([need["bytes"] for need in cost["needs"] if need["need"] == "exact"], [0])
        self.assertLess(cost["none"]["bytes"], 0.8 * cost["bytes"])
        self.assertGreater(cost["times"]["load_none_us"], 0)

    def test_no_jags_about_the_lips(self):
        near = [face for face, _ in self.faces
                if all(abs(self.points[i][0]) < 0.036 and 0.6 < self.points[i][1] < 0.636 and self.points[i][2] > 0.118 for i in face)]
        beside = {}
        for number, face in enumerate(near):
            for a, b in edges_of(face):
                beside.setdefault((min(a, b), max(a, b)), []).append(number)
        pairs = [p for p in beside.values() if len(p) == 2]
        self.assertGreater(len(pairs), 500)

        def sharpest(pose):
            points = self.source(pose)
            normals = [normal_of(face, points) for face in near]
            return max(angle(normals[a], normals[b]) for a, b in pairs)

        rest = sharpest(self.rest)
        for scene in ("smile", "frown", "jaw_drop"):
            self.assertLess(sharpest(self.moved[scene]), 1.2 * rest, scene)

    def test_smile(self):
        x, y, _ = self.both("smile", self.corner())
        self.assertGreater(y, 0.015)  # up
        self.assertGreater(x, 0.015)  # outward
        cheek = min(self.groups["cheek_l"], key=lambda p: math.dist(p, (0.04, 0.643, 0.122)))
        self.assertGreater(self.both("smile", cheek)[1], 0.005)
        self.assertLess(abs(self.motion("smile", max(self.groups["nose"], key=lambda p: p[2]))[1]), 0.01)

    def test_frown(self):
        ridge = [p for p in self.groups["brow_l"] if 0.008 < p[0] < 0.038 and 0.7 < p[1] < 0.712]
        brow = [self.motion("frown", p) for p in ridge]
        mirrored = [self.motion("frown", self.mirrored(p)) for p in ridge]
        for side, inward in ((brow, -1), (mirrored, 1)):
            self.assertGreater(inward * sum(m[0] for m in side) / len(side), 0.004)  # together
            self.assertLess(sum(m[1] for m in side) / len(side), -0.002)            # down
        self.assertLess(self.both("frown", self.corner())[1], -0.01)

    def test_jaw_drop(self):
        middle = [p for p in self.groups["lip_lower"] if abs(p[0]) < 1e-4]
        lower = self.motion("jaw_drop", max(middle, key=lambda p: p[2]))
        upper = self.motion("jaw_drop", max((p for p in self.groups["lip_upper"] if abs(p[0]) < 1e-4), key=lambda p: p[2]))
        chin = self.motion("jaw_drop", min((p for p in self.groups["jaw"] if abs(p[0]) < 1e-4), key=lambda p: p[1] - p[2]))
        self.assertLess(lower[1], -0.06)
        self.assertLess(chin[1], -0.06)
        self.assertGreater(upper[1], -0.02)
        # An open mouth: upper lip, lower teeth, lower lip, from above; and not much wider than high.
        pose = self.moved["jaw_drop"]
        lip = pose[self.vertex(max(middle, key=lambda p: p[1]))][1]
        under = min((p for p in self.groups["lip_upper"] if abs(p[0]) < 1e-4), key=lambda p: p[1])
        teeth = max((p for p in self.groups["teeth_lower"] if abs(p[0]) < 0.006), key=lambda p: p[1])
        self.assertGreater(pose[self.vertex(teeth)][1], lip + 0.001)
        opening = pose[self.vertex(under)][1] - lip
        self.assertGreater(opening, pose[self.vertex(teeth)][1] - lip)
        self.assertGreater(opening, 0.25 * 2 * pose[self.vertex(self.corner())][0])
        # Teeth stay with their bones, as one piece.
        for group, moves in (("teeth_upper", False), ("teeth_lower", True)):
            a, b = min(self.groups[group]), max(self.groups[group])
            p, q = self.vertex(a), self.vertex(b)
            length = lambda pose: sum((s - t) ** 2 for s, t in zip(pose[p], pose[q])) ** 0.5  # noqa: E731
            self.assertAlmostEqual(length(self.moved["jaw_drop"]), length(self.rest), delta=1e-5)
            self.assertEqual(self.motion("jaw_drop", a)[1] < -0.01, moves)

    def lid_rims(self, side):
        """Edges of the lids that lie outside the eyeball."""
        sign = 1 if side == "l" else -1
        outside = lambda i: math.dist((sign * self.points[i][0], *self.points[i][1:]), (0.02885, 0.6795, 0.1115)) > 0.0158  # noqa: E731
        return [[edge for face, names in self.faces if f"eyelid_{lid}_{side}" in names for edge in edges_of(face) if all(map(outside, edge))]
                for lid in ("upper", "lower")]

    def test_blink(self):
        """The lids meet along the middle 80 % of their line; at rest they are open everywhere there."""
        for side, sign in (("l", 1), ("r", -1)):
            upper, lower = self.lid_rims(side)

            def opening(points, part):
                x = sign * (0.0165 + part * 0.0247)

                def heights(edges):
                    for i, j in edges:
                        a, b = points[i], points[j]
                        if min(a[0], b[0]) <= x <= max(a[0], b[0]) and a[0] != b[0]:
                            yield a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0])

                return min(heights(upper)) - max(heights(lower))

            open_lids, closed = self.source(self.rest), self.source(self.moved["blink"])
            for k in range(17):
                self.assertGreater(opening(open_lids, 0.1 + 0.05 * k), 0.004)
                self.assertLess(opening(closed, 0.1 + 0.05 * k), 0.0005, (side, k))

    def test_the_eyes_stay(self):
        for scene in self.moved:
            for group in ("eye_l", "eye_r"):
                for place in self.groups[group][::9]:
                    self.assertLess(max(map(abs, self.motion(scene, place))), 2e-3, scene)

    def test_faces_are_drawn(self):
        sheet = pathlib.Path(self.folder.name) / "face.png"
        scenes = [word for name in ("rest", "smile", "frown", "jaw_drop", "blink") for word in ("--scene", FACE / f"{name}.json")]
        try:
            run("render", self.package, "-o", sheet, *scenes, "--frames", 1, "--size", "240x280", "--overlay", "none")
        except AssertionError as failure:
            if "OpenGL" in str(failure):
                self.skipTest("no OpenGL here")
            raise
        self.assertGreater(sheet.stat().st_size, 20000)

    def test_wrong_scenes_name_line_and_cure(self):
        scene = pathlib.Path(self.folder.name) / "wrong.json"
        for text, says in (('{"sinew_scene": 1,\n"secnds": 1}', ("line 2", "seconds")),
                           ('{"sinew_scene": 1,\n"channels": {"zygomaticus_mayor.L": [[0, 1]]}}', ("line 2", "zygomaticus_major.L")),
                           ('{"sinew_scene": 1,\n\n"targets": {"jow": {"keys": [{"time": 0}]}}}', ("line 3", "jaw")),
                           ('{"sinew_scene": 1,\n"channels": {"procerus": [[1, 0], [0.5, 1]]}}', ("line 2", "Sort")),
                           ('{"sinew_scene": 1,\n"channels": {"procerus": [[0, 2]]}}', ("line 2", "0.0 to 1.0")),
                           ('{"sinew_scene": 2}', ("version 1",)), ('{"sinew_scene": 1', ("line 1",))):
            scene.write_text(text)
            out = pathlib.Path(self.folder.name) / "wrong.obj"
            done = subprocess.run([SINEW, "simulate", str(self.package), "--scene", str(scene), "--export", str(out)],
                                  capture_output=True, text=True, timeout=60 * SLOWNESS)
            self.assertEqual(done.returncode, 3, text)
            for part in ("wrong.json: ", *says):
                self.assertIn(part, done.stderr)
            self.assertFalse(out.exists())


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    options, rest = parser.parse_known_args()
    SINEW = options.sinew
    unittest.main(argv=[sys.argv[0], *rest])
