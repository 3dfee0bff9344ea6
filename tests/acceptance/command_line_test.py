#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The program's contract as a caller sees it: exit codes, one line on stderr, JSON and nothing else, no partial output,
an interrupted bake that leaves nothing behind, a package that is refused whatever byte of it changes."""
import argparse
import json
import math
import os
import pathlib
import random
import shlex
import signal
import subprocess
import tempfile
import time
import unittest
import zlib

SINEW = None
SPOT = None


def run(*arguments, **options):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=120, **options)


class CommandLine(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.folder.name)

    def tearDown(self):
        self.folder.cleanup()

    def bake(self, *arguments, name="spot.sinew"):
        package = self.path / name
        result = run("bake", SPOT, "-o", package, *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return package

    def assert_refused(self, result, code, *words):
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertEqual(result.stdout, "")
        self.assertTrue(result.stderr.startswith("sinew: "), result.stderr)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_usage_errors_exit_2(self):
        self.assert_refused(run(), 2)
        self.assert_refused(run("bake"), 2)
        self.assert_refused(run("bak", SPOT), 2, "no verb 'bak'", "Did you mean bake?")
        self.assert_refused(run("bake", SPOT, "-o", ""), 2, "empty")
        for report in ("both", "../" + self.path.name + "/both"):
            self.assert_refused(run("bake", SPOT, "-o", "both", "--report", report, cwd=self.path), 2, "where the package goes")
        self.assert_refused(run("bake", SPOT, "-o", self.path / "x.sinew", "--set", "clusters.overlop=1"), 2, "clusters.overlap")
        self.assert_refused(run("bake", SPOT, "-o", self.path / "no" / "x.sinew"), 2, "does not exist")
        package = self.bake()
        self.assert_refused(run("simulate", package, "--scene", "dance"), 2, "squash")
        self.assert_refused(run("simulate", package, "--step", "0"), 2)
        for option in ("--step", "--seconds", "--gravity"):
            for number in ("nan", "inf"):
                self.assert_refused(run("simulate", package, option, number), 2, option, number)
        for number in ("-9.81", "1000.1"):
            self.assert_refused(run("simulate", package, f"--gravity={number}"), 2, "--gravity", number, "0 to 1000")
        for number in ("0", "1000"):
            self.assertEqual(run("simulate", package, f"--gravity={number}", "--seconds", "0.02").returncode, 0)
        self.assertEqual([p.name for p in self.path.iterdir()], ["spot.sinew"])

    def test_what_is_not_written_whole_is_no_file(self):
        package = self.bake()
        for name in ("v.mp4", "p.png", "q.sinew"):
            with self.subTest(name):
                arguments = ["bake", SPOT, "-o"] if name == "q.sinew" else ["render", package, "-o"]
                words = [str(SINEW), *map(str, arguments), str(self.path / name)]
                if name == "v.mp4":
                    words += ["--seconds", "1"]
                # A file may have 8 blocks of 512 bytes, as on a disk that is full.
                shell = "trap '' XFSZ; ulimit -f 8; exec " + " ".join(shlex.quote(w) for w in words)
                result = subprocess.run(["sh", "-c", shell], capture_output=True, text=True)
                self.assertEqual(result.returncode, 4, result.stderr)
                self.assertIn(name, result.stderr.strip().splitlines()[-1])
                self.assertEqual([p.name for p in self.path.iterdir()], ["spot.sinew"])

    def test_output_that_is_not_written_whole_exits_4(self):
        package = self.bake()
        for words in (["inspect", package, "--json"], ["inspect", package], ["check", package], ["check", SPOT, "--json"],
                      ["help", "settings", "--markdown"], ["--version"], ["inspect", "--help"],
                      ["simulate", package, "--seconds", "0.02"], ["bake", SPOT, "-o", package]):
            with self.subTest(" ".join(map(str, words))), open("/dev/full", "w") as full:
                result = subprocess.run([SINEW, *map(str, words)], stdout=full, stderr=subprocess.PIPE, text=True, timeout=120)
                self.assertEqual(result.returncode, 4, result.stderr)
                said = [line for line in result.stderr.strip().splitlines() if line.startswith("sinew: ")]
                self.assertEqual(len(said), 1, result.stderr)
                self.assertIn("standard output", said[0])
        # What is refused says that alone.
        with open("/dev/full", "w") as full:
            result = subprocess.run([SINEW, "inspect", self.path / "none.obj"], stdout=full, stderr=subprocess.PIPE, text=True)
        self.assertEqual(result.returncode, 3)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)

    def test_what_a_killed_run_left_is_removed_by_the_next(self):
        left = self.path / ".spot.sinew.tmpAbC123.sinew"
        left.write_text("half")
        other = self.path / ".spot.sinew.tmp.sinew"
        other.write_text("the user's")
        self.bake()
        self.assertFalse(left.exists())
        self.assertTrue(other.exists())

    def test_what_floats_cannot_weigh_exits_3(self):
        corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        for size, material, word in ((1e-16, 1000, "too small"), (5e11, 1e5, "too large")):
            mesh = self.path / "cube.obj"
            mesh.write_text("".join("v %g %g %g\n" % tuple(size * c for c in corner) for corner in corners) +
                            "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n")
            result = run("bake", mesh, "-o", self.path / "x.sinew", "--quiet", "--set", f"material.density={material}")
            self.assert_refused(result, 3, "cube.obj", word, "--unit")
        self.assertFalse((self.path / "x.sinew").exists())

    def test_help_and_version_exit_0(self):
        self.assertEqual(run("--version").returncode, 0)
        self.assertIn("bake", run("--help").stdout)
        self.assertIn("--report", run("help", "bake").stdout)
        self.assertIn("tetrahedra.method", run("help", "settings").stdout)

    def test_missing_and_foreign_files_exit_3(self):
        self.assert_refused(run("bake", self.path / "none.obj", "-o", self.path / "x.sinew"), 3, "none.obj")
        text = self.path / "notes.txt"
        text.write_text("hello")
        self.assert_refused(run("bake", text, "-o", self.path / "x.sinew"), 3, "notes.txt")
        fake = self.path / "fake.sinew"
        fake.write_bytes(b"hello" * 100)
        for verb in (["inspect"], ["simulate"], ["check"], ["render", "-o", self.path / "x.png"]):
            self.assert_refused(run(verb[0], fake, *verb[1:]), 3, "fake.sinew")
        self.assertFalse((self.path / "x.sinew").exists())
        self.assertFalse((self.path / "x.png").exists())

    def test_an_export_at_rest_is_the_source(self):
        points = lambda text: sorted({tuple(round(float(x), 4) for x in line.split()[1:4])  # noqa: E731
                                      for line in text.splitlines() if line.startswith("v ")})
        # In centimetres, z up, far from the origin.
        text = "".join(f"v {100 * x + 300:.5f} {-100 * z + 20:.5f} {100 * y - 50:.5f}\n" if key == "v" else line + "\n"
                       for line in pathlib.Path(SPOT).read_text().splitlines()
                       for key, x, y, z in [(line.split()[0], *map(float, line.split()[1:4])) if line.startswith("v ") else ("", 0, 0, 0)]
                       if line.startswith(("v ", "f ", "vt ")))
        (self.path / "cow.obj").write_text(text)
        package, out = self.path / "cow.sinew", self.path / "out.obj"
        done = run("bake", self.path / "cow.obj", "-o", package, "--set", "import.unit=cm", "--set", "import.up=z",
                   "--set", "tetrahedra.vertices=300")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(run("simulate", package, "--scene", "rest", "--seconds", "0.02", "--export", out).returncode, 0)
        source, exported = points(text), points(out.read_text())
        self.assertEqual(len(source), len(exported))
        self.assertLess(max(math.dist(a, b) for a, b in zip(source, exported)), 2e-3)  # cm
        self.assertEqual(run("simulate", package, "--scene", "rest", "--seconds", "0.02", "--export", out, "--frame", "scene").returncode, 0)
        scene = points(out.read_text())
        span = lambda of: [max(p[k] for p in of) - min(p[k] for p in of) for k in range(3)]  # noqa: E731
        self.assertTrue(all(abs(100 * a - b) < 0.05 for a, b in zip(span(scene), [span(source)[k] for k in (0, 2, 1)])))
        self.assertTrue(0 <= min(p[1] for p in scene) < 0.3)  # on the scene's ground
        # A file's scene in its coordinates, and all that a cut leaves.
        file = self.path / "cut.json"
        file.write_text(json.dumps({"sinew_scene": 1, "seconds": 0.1, "ground": -1.3,
                                    "cuts": [{"time": 0.05, "point": [3, 0, -0.2], "normal": [1, 0.2, 0]}]}))
        self.assertEqual(run("simulate", package, "--scene", file, "--export", out).returncode, 0)
        text = out.read_text()
        self.assertEqual(sum(line.startswith("o ") for line in text.splitlines()), 2)
        at_source = points(text)
        self.assertTrue(all(abs(max(p[k] for p in at_source) - max(p[k] for p in source)) < 0.5 for k in range(3)))  # cm
        corners = [int(corner.split("/")[0]) for line in text.splitlines() if line.startswith("f ") for corner in line.split()[1:]]
        self.assertEqual(max(corners), sum(line.startswith("v ") for line in text.splitlines()))
        self.assertEqual(run("simulate", package, "--scene", file, "--export", out, "--frame", "scene").returncode, 0)
        there = points(out.read_text())
        self.assertLess(max(abs(max(p[k] for p in there) - max(s[k] for s in moved)) for k in range(3)
                            for moved in [[(x / 100, z / 100, -y / 100) for x, y, z in source]]), 0.01)

    def test_pipes_devices_and_folders_are_refused_at_once(self):
        package, out = self.bake(), self.path / "x.sinew"
        mask = self.path / "mask.json"
        mask.write_text(json.dumps({"sinew_recipe": 2, "source": os.path.relpath(SPOT, self.path),
                                    "project": os.path.relpath("/", self.path),
                                    "clusters": [{"name": "a", "from": {"image": "place.png"}}]}))
        for kind, make in (("pipe", os.mkfifo), ("device", lambda at: os.symlink("/dev/zero", at)), ("folder", os.mkdir)):
            for ending in ("obj", "glb", "json", "sinew", "png"):
                place = self.path / f"place.{ending}"
                make(place)
                calls = {"sinew": (["inspect", place], ["check", place], ["simulate", place]),
                         "json": (["bake", place, "-o", out], ["author", place, "show"], ["author", place, "set", "clusters.mode=rigid"],
                                  ["simulate", package, "--scene", place]),
                         "png": (["bake", mask, "-o", out],)}.get(ending, (["bake", place, "-o", out], ["check", place]))
                for call in calls:
                    with self.subTest(kind=kind, call=call):
                        self.assert_refused(run(*call), 3, place.name)
                (os.rmdir if kind == "folder" else os.unlink)(place)
        self.assertEqual(sorted(p.name for p in self.path.iterdir()), ["mask.json", "spot.sinew"])

    def test_what_is_read_is_never_written_over(self):
        source = self.path / "cow.obj"
        source.write_bytes(pathlib.Path(SPOT).read_bytes())
        recipe = self.path / "cow.json"
        recipe.write_text(json.dumps({"sinew_recipe": 2, "source": "cow.obj"}))
        link = self.path / "link.sinew"
        link.symlink_to("cow.obj")
        package = self.bake()
        scene = self.path / "scene.json"
        scene.write_text('{"sinew_scene": 1}')
        posed = self.path / "posed.obj"
        posed.symlink_to("scene.json")
        before = {p.name: p.read_bytes() for p in self.path.iterdir()}
        out = self.path / "x.sinew"
        self.assert_refused(run("bake", source, "-o", source), 2, "cow.obj", "destroy")
        self.assert_refused(run("bake", source, "-o", link), 2, "link.sinew", "destroy")
        self.assert_refused(run("bake", recipe, "-o", link), 2, "link.sinew", "destroy")
        self.assert_refused(run("bake", recipe, "-o", out, "--report", recipe), 2, "cow.json", "destroy")
        self.assert_refused(run("bake", recipe, "-o", out, "--report", "/dev/null"), 2, "/dev/null")
        self.assert_refused(run("check", source, "--render", source), 2, "cow.obj", "destroy")
        self.assert_refused(run("simulate", package, "--scene", scene, "--export", posed), 2, "posed.obj", "destroy")
        self.assertEqual({p.name: p.read_bytes() for p in self.path.iterdir()}, before)

    def test_check_finds_what_bake_refuses(self):
        line = self.path / "line.obj"
        line.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
        wrong = "no triangle has an area, so there is nothing to fill"
        self.assert_refused(run("bake", line, "-o", self.path / "line.sinew", "--quiet"), 3, wrong)
        result = run("check", line, "--json")
        self.assertEqual(result.returncode, 1, result.stderr)
        report = json.loads(result.stdout)
        self.assertFalse(report["ok"])
        self.assertIn(wrong, [f["message"] for f in report["findings"] if f["severity"] == "error"])

    def boxes(self, name, places, cells=8):
        """Writes a file of boxes: {group: (low corner, size)}, each side in cells x cells faces."""
        text, count = "", 0
        for group, (low, size) in places.items():
            text += f"g {group}\n"
            for k in range(3):
                for side in (0, 1):
                    first, u, v = count + 1, (k + 1) % 3, (k + 2) % 3
                    for j in range(cells + 1):
                        for i in range(cells + 1):
                            at = list(low)
                            at[k] += side * size[k]
                            at[u] += size[u] * i / cells
                            at[v] += size[v] * j / cells
                            text += "v %.9g %.9g %.9g\n" % tuple(at)
                    for j in range(cells):
                        for i in range(cells):
                            a = first + j * (cells + 1) + i
                            face = [a, a + 1, a + cells + 2, a + cells + 1]
                            text += "f %d %d %d %d\n" % tuple(face if side else face[::-1])
                    count += (cells + 1) ** 2
        file = self.path / name
        file.write_text(text)
        return file

    def findings(self, *arguments):
        result = run("check", *arguments, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return {finding["id"]: finding for finding in json.loads(result.stdout)["findings"]}

    def test_check_warns_of_what_bake_warns_of(self):
        plate = self.boxes("plate.obj", {"plate": ((0, 0, 0), (1, 1, 0.01))})
        result = run("bake", plate, "-o", self.path / "plate.sinew", "--json")
        warned = [f for f in json.loads(result.stdout)["findings"] if f["severity"] == "warning"]
        self.assertIn("tetrahedra-volume", [f["id"] for f in warned])
        found = self.findings(plate)
        for finding in warned:
            self.assertEqual(found[finding["id"]]["message"], finding["message"])
        listed = json.loads(run("check", plate, "--json").stdout)["findings"]
        self.assertEqual(len({json.dumps(f) for f in listed}), len(listed))

    def test_check_looks_at_what_the_recipe_has_filled(self):
        head = self.boxes("head.obj", {"head": ((0, 0, 0), (1, 1, 1)), "eye": ((0.3, 0.3, 1.002), (0.4, 0.4, 0.3))})
        self.assertIn("near-pieces", self.findings(head))
        recipe = self.path / "head.json"
        recipe.write_text(json.dumps({"sinew_recipe": 2, "source": "head.obj",
                                      "parts": [{"name": "eye", "from": {"group": "eye"}, "attach": "rigid"}]}))
        found = self.findings(recipe)
        for gone in ("near-pieces", "several-pieces", "several-parts"):
            self.assertNotIn(gone, found)

    def test_an_open_garment_may_be_a_shell(self):
        shirt = self.path / "shirt.obj"
        ring = [(math.cos(2 * math.pi * i / 40), math.sin(2 * math.pi * i / 40)) for i in range(40)]
        shirt.write_text("".join("v %g %g %g\n" % (0.3 * x, 0.015 * j, 0.3 * z) for j in range(21) for x, z in ring) +
                         "".join("f %d %d %d %d\n" % (40 * j + i + 1, 40 * j + i + 41, 40 * j + (i + 1) % 40 + 41, 40 * j + (i + 1) % 40 + 1)
                                 for j in range(20) for i in range(40)))
        out = self.path / "x.sinew"
        self.assertIn("tetrahedra.method=shell", self.findings(shirt)["open-boundary"]["cure"])
        few = ("--set", "tetrahedra.vertices=600", "--quiet")
        refused = run("bake", shirt, "-o", out, *few, "--set", "tetrahedra.method=delaunay")
        self.assert_refused(refused, 3, "delaunay cannot fill", "tetrahedra.method=shell")
        self.assertEqual(run("bake", shirt, "-o", out, *few, "--set", "tetrahedra.method=shell").returncode, 0)

    def test_what_is_too_small_for_fields_exits_3(self):
        box = self.boxes("box.obj", {"box": ((0, 0, 0), (2, 2, 2))}, 2)
        for unit, code in (("1e-9", 3), ("1e-6", 0)):
            arguments = ("--set", f"import.unit={unit}", "--set", "tetrahedra.vertices=60")
            baked = run("bake", box, "-o", self.path / "x.sinew", "--quiet", *arguments)
            checked = run("check", box, *arguments)
            self.assertEqual(baked.returncode, code, baked.stderr)
            self.assertEqual(checked.returncode, 1 if code else 0, checked.stdout)
        self.assert_refused(run("bake", box, "-o", self.path / "y.sinew", "--unit", "1e-9"), 3, "too small", "--unit")

    def test_mistyped_options_name_the_one_that_was_meant(self):
        for words, meant in ((["bake", SPOT, "--o", "out"], "-o,--output"), (["bake", SPOT, "--out=x"], "-o,--output"),
                             (["bake", SPOT, "-o", "x.sinew", "--treads", "2"], "--threads"),
                             (["simulate", "x.sinew", "--iteration", "2"], "--iterations")):
            self.assert_refused(run(*words), 2, f"no option '{[w for w in map(str, words) if w.startswith('--')][0].split('=')[0]}'",
                                f"Did you mean {meant}?", f"sinew {words[0]} --help")
        self.assert_refused(run("bake", SPOT), 2, "required")

    def test_without_a_display_it_says_how_to_go_on(self):
        bare = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
        package = self.bake()
        self.assert_refused(run("view", self.path / "nope.sinew", env=bare), 3, "nope.sinew")
        self.assert_refused(run("studio", self.path / "nope.sinew", env=bare), 3, "nope.sinew")
        for verb in ("view", "studio"):
            self.assert_refused(run(verb, package, env=bare), 4, "no display", f"sinew render {package} -o picture.png", "ssh -X")
        recipe = self.path / "cow.json"
        recipe.write_text(json.dumps({"sinew_recipe": 2, "source": os.path.relpath(SPOT, self.path), "project": os.path.relpath("/", self.path)}))
        self.assert_refused(run("studio", recipe, env=bare), 4, f"sinew bake {recipe} -o OUT.sinew && sinew render OUT.sinew")

    def test_a_picture_names_all_packages(self):
        mesh = self.boxes("box.obj", {"box": ((0, 0, 0), (1, 1, 1))}, 2)
        packages = []
        for name in ("one", "two"):
            (self.path / f"{name}.obj").write_bytes(mesh.read_bytes())
            packages.append(self.path / f"{name}.sinew")
            arguments = ("--set", "tetrahedra.vertices=60", "--quiet")
            self.assertEqual(run("bake", self.path / f"{name}.obj", "-o", packages[-1], *arguments).returncode, 0)
        pictures = []
        for other in packages:
            picture = self.path / "sheet.png"
            result = run("render", packages[0], other, "-o", picture, "--scene", "stack", "--frames", "2", "--seconds", "0.1", "--overlay", "none")
            self.assertEqual(result.returncode, 0, result.stderr)
            pictures.append(picture.read_bytes())
        self.assertTrue(pictures[0] != pictures[1])

    def test_outputs_replace_only_what_sinew_wrote(self):
        package, report, scene = self.bake(), self.path / "report.json", self.path / "scene.json"
        scene.write_text('{"sinew_scene": 1}')
        mine = {"mine.obj": "v 0 0 0\n", "mine.png": "a texture", "mine.mp4": "a film", "mine.json": '{"sinew_recipe": 2}', "mine.html": "a page"}
        for name, text in mine.items():
            (self.path / name).write_text(text)

        def outputs(stem):
            yield "obj", ("simulate", package, "--scene", "rest", "--seconds", "0.02", "--export", self.path / f"{stem}.obj")
            yield "png", ("render", package, "-o", self.path / f"{stem}.png", "--scene", "rest", "--frames", "1", "--overlay", "none")
            yield "png", ("check", SPOT, "--render", self.path / f"{stem}.png")
            yield "mp4", ("render", package, "-o", self.path / f"{stem}.mp4", "--seconds", "0.1")
            yield "json", ("bake", SPOT, "-o", package, "--quiet", "--report", self.path / f"{stem}.json")
        for ending, call in outputs("mine"):
            self.assert_refused(run(*call), 2, f"mine.{ending}", "not written by sinew", "Name another file")
        self.assert_refused(run("study", "error", package, "--html", self.path / "mine.html"), 2, "mine.html", "not written by sinew")
        for name, text in mine.items():
            self.assertEqual((self.path / name).read_text(), text)
        # What it wrote, and a file that holds nothing, it writes over.
        (self.path / "new.obj").touch()
        for ending, call in [*outputs("new"), *outputs("new")]:
            result = run(*call)
            self.assertEqual(result.returncode, 0, result.stderr)
        png = (self.path / "new.png").read_bytes()
        at, chunks = 8, []
        while at < len(png):
            length = int.from_bytes(png[at:at + 4], "big")
            self.assertEqual(zlib.crc32(png[at + 4:at + 8 + length]), int.from_bytes(png[at + 8 + length:at + 12 + length], "big"))
            chunks.append(png[at + 4:at + 8])
            at += 12 + length
        self.assertEqual((chunks[0], chunks[1], chunks[-1]), (b"IHDR", b"tEXt", b"IEND"))

    def test_outputs_are_named_like_what_they_are(self):
        names = ("mine.glb", "other.OBJ", "a.ply", "a.stl", "a.off", "a.gltf", "a.fbx", "a.dae", "a.mesh", "skin.png", "skin.JPG")
        (self.path / "mine.glb").write_bytes(b"made by hand")
        (self.path / "notes").write_bytes(b"made by hand")
        (self.path / "link.sinew").symlink_to("mine.glb")
        before = {p.name: p.read_bytes() for p in self.path.iterdir()}
        for name in names:
            self.assert_refused(run("bake", SPOT, "-o", self.path / name), 2, name, pathlib.Path(name).stem + ".sinew")
        self.assert_refused(run("bake", SPOT, "-o", self.path / "notes"), 2, "notes: is no Sinew package", "ends in .sinew")
        self.assert_refused(run("bake", SPOT, "-o", self.path / "link.sinew"), 2, "link.sinew: is no Sinew package")
        self.assert_refused(run("bake", SPOT, "-o", self.path / "a.sinew", "--report", self.path / "mine.glb"), 2, "mine.glb", ".json")
        self.assert_refused(run("check", SPOT, "--render", self.path / "mine.glb"), 2, "mine.glb", ".png")
        self.assert_refused(run("render", SPOT, "-o", self.path / "mine.glb"), 2, "mine.glb", ".png")
        self.assertEqual({p.name: p.read_bytes() for p in self.path.iterdir()}, before)
        # Any other name will do, and what is a package, or a broken one by its name, is baked again.
        (self.path / "broken.sinew").write_bytes(b"half a package")
        for name in ("plain", "plain", "a.pkg", "broken.sinew"):
            self.bake("--quiet", name=name)
        self.assert_refused(run("simulate", self.path / "plain", "--export", self.path / "mine.glb"), 2, "mine.glb", ".obj")

    def test_no_advice_to_bake_over_what_is_no_package(self):
        mesh, notes = self.path / "cow.obj", self.path / "notes"
        mesh.write_bytes(pathlib.Path(SPOT).read_bytes())
        notes.write_text("hello")
        result = run("simulate", mesh)
        self.assert_refused(result, 3, "not a Sinew package", f"sinew bake {mesh} -o {self.path / 'cow.sinew'}.")
        result = run("simulate", notes)
        self.assert_refused(result, 3, "sinew bake SOURCE -o OUT.sinew")
        self.assertNotIn("-o " + str(notes), result.stderr)
        package = self.bake()
        package.write_bytes(package.read_bytes()[:-1])
        self.assert_refused(run("simulate", package), 3, f"Bake it again: sinew bake SOURCE -o {package}.")

    def test_a_link_stays_a_link(self):
        link = self.path / "latest.sinew"
        link.symlink_to("versions/1.sinew")
        (self.path / "versions").mkdir()
        self.bake(name="latest.sinew")
        self.assertTrue(link.is_symlink())
        self.assertEqual(link.read_bytes(), (self.path / "versions" / "1.sinew").read_bytes())

    def test_file_names_that_are_not_utf8(self):
        source = os.fsdecode(os.fsencode(self.path / "cow") + b"\xff.obj")
        package = os.fsdecode(os.fsencode(self.path / "cow") + b"\xff.sinew")
        pathlib.Path(source).write_bytes(pathlib.Path(SPOT).read_bytes())
        for call in (["bake", source, "-o", package], ["inspect", package], ["inspect", source], ["check", source],
                     ["simulate", package, "--seconds", "0.1"]):
            with self.subTest(call=call[0]):
                result = run(*call, "--json")
                self.assertEqual(result.returncode, 0, result.stderr)
                json.loads(result.stdout)
        self.assert_refused(run("author", self.path / "a.json", "new", source), 2, "UTF-8")

    def test_a_recipe_bakes_like_its_settings(self):
        recipe = self.path / "cow.json"
        recipe.write_text(json.dumps({"sinew_recipe": 1, "source": os.path.relpath(SPOT, self.path),
                                      "settings": {"tetrahedra.vertices": 400}}))
        out = self.path / "recipe.sinew"
        self.assertEqual(run("bake", recipe, "-o", out).returncode, 0)
        self.assertEqual(out.read_bytes(), self.bake("--set", "tetrahedra.vertices=400").read_bytes())

    def test_the_report_tells_what_the_package_holds(self):
        report_file = self.path / "report.json"
        package = self.bake("--report", report_file)
        report = json.loads(report_file.read_text())
        inspect = json.loads(run("inspect", package, "--json").stdout)
        self.assertEqual(report["physical_vertices"], inspect["physical_vertices"])
        self.assertEqual(report["clusters"], len(inspect["clusters"]))
        self.assertEqual(report["visual"]["source_vertices"], inspect["source_vertices"])
        self.assertEqual(report["package_bytes"], package.stat().st_size)
        self.assertLessEqual(sum(s["bytes"] for s in inspect["sections"]), inspect["bytes"])
        stages = [s["name"] for s in report["stages"]]
        self.assertEqual(stages, ["import", "topology", "tetrahedra", "clusters", "attachment", "fields", "package", "write"])
        for stage in report["stages"]:
            self.assertGreaterEqual(stage["seconds"], 0)
            self.assertGreater(stage["peak_megabytes"], 1)

    def test_what_is_drawn_meets_the_ground(self):
        # A pole of 3 m with four cloths, which have no tetrahedra: what touches is what is drawn.
        corners = [(x, y, z) for x in (0, 0.1) for y in (0, 3) for z in (0, 0.1)]
        cloth = []
        for dx, dz in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            cloth += [(0.05 + r * dx, y, 0.05 + r * dz) for r, y in ((0.05, 2), (1, 2), (1, 2.9), (0.05, 2.9))]
        mesh = self.path / "flag.obj"
        mesh.write_text("".join("v %g %g %g\n" % corner for corner in corners + cloth) +
                        "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n" + "".join("f %d %d %d %d\n" % tuple(range(n, n + 4)) for n in (9, 13, 17, 21)))
        package = self.path / "flag.sinew"
        result = run("bake", mesh, "-o", package, "--no-cache")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("[large-sheets]", result.stdout)
        measures = json.loads(run("simulate", package, "--scene", "drop", "--json").stdout)
        self.assertGreaterEqual(measures["lowest_visual"], -1e-6)
        # Clusters meet it with their physical vertices alone, and simulate says how far down the rest reaches.
        averaged = json.loads(run("simulate", package, "--scene", "drop", "--solver", "report", "--json").stdout)
        self.assertGreaterEqual(averaged["lowest"], -1e-6)
        self.assertLess(averaged["lowest_visual"], -0.05)

    def bake_block(self):
        """A stiff cube that stands on y = 0. Returns the source and the package."""
        corners = [(x, y, z) for x in (-0.5, 0.5) for y in (0, 1) for z in (-0.5, 0.5)]
        mesh = self.path / "block.obj"
        mesh.write_text("".join("v %g %g %g\n" % corner for corner in corners) +
                        "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n")
        package = self.path / "block.sinew"
        hertz = [f"--set=clusters.{motion}_hz=100" for motion in ("stretch", "bend", "twist")]
        self.assertEqual(run("bake", mesh, "-o", package, "--no-cache", *hertz).returncode, 0)
        return mesh, package

    def test_scenes_that_cut(self):
        package = self.bake_block()[1]
        measures = json.loads(run("simulate", package, "--scene", "cut", "--json").stdout)
        self.assertEqual(measures["bodies"]["count"], 2)
        # A wedge of this stiffness jams between the other part and the ground, where it hums (docs/decisions/0018-cut.md).
        self.assertLess(measures["bodies"]["rms_speed_m_s"], 5e-3)
        scene = self.path / "twice.json"
        plane = '{"time": 0.05, "point": [0, %g, 0], "normal": [0, 2, 0]}, {"time": 0.1, "point": [0.1, 0, 0], "normal": [1, 0.2, 0]}'
        scene.write_text('{"sinew_scene": 1, "seconds": 0.2, "cuts": [' + plane % 0.4 + "]}")
        measures = json.loads(run("simulate", package, "--scene", scene, "--json").stdout)
        self.assertEqual(measures["bodies"]["count"], 4)
        picture = self.path / "twice.png"
        self.assertEqual(run("render", package, "--scene", scene, "--frames", "3", "-o", picture).returncode, 0)
        scene.write_text('{"sinew_scene": 1, "seconds": 0.2, "cuts": [' + plane % 9 + "]}")
        self.assert_refused(run("simulate", package, "--scene", scene), 3, "cannot be cut", "Move the plane")
        scene.write_text('{"sinew_scene": 1, "cuts": [{"time": 1, "normal": [0, 0, 0]}]}')
        self.assert_refused(run("simulate", package, "--scene", scene), 3, "a plane needs a direction")

    def test_scenes_that_act_on_a_body(self):
        package = self.bake_block()[1]
        scene, out = self.path / "act.json", self.path / "act.obj"

        def middle(**keys):
            """Mean place of the block's vertices at the end; 1 m cube of 1000 kg, its middle at 0, 0.5, 0."""
            scene.write_text(json.dumps({"sinew_scene": 1, **keys}))
            result = run("simulate", package, "--scene", scene, "--export", out)
            self.assertEqual(result.returncode, 0, result.stderr)
            places = [[float(x) for x in line.split()[1:4]] for line in out.read_text().splitlines() if line.startswith("v ")]
            return [sum(axis) / len(places) for axis in zip(*places)]

        # 1 m/s for half a second, then a metre per second squared for one; the air takes a little.
        for at in ({}, {"at": [-0.5, 0.5, 0]}):
            x, y, z = middle(seconds=0.6, impulses=[{"time": 0.1, "impulse": [1000, 0, 0], **at}])
            self.assertAlmostEqual(x, 0.5, delta=0.015)
            self.assertAlmostEqual(y, 0.5, delta=1e-3)
            z = middle(seconds=1, forces=[{"keys": [{"time": 0, "force": [0, 0, 1000]}], **({"at": [0, 0.5, -0.5]} if at else {})}])[2]
            self.assertAlmostEqual(z, 0.4683, delta=0.005)  # t / c - (1 - exp(-c t)) / c^2 in air of c = 0.2 / s
        # In thick air it falls at g over the damping; a file's step length is taken, unless --step says another.
        self.assertAlmostEqual(middle(seconds=1, gravity=9.81, damping=10, step=0.005)[1], 0.5 - 0.883, delta=0.01)
        played = lambda *more: json.loads(run("simulate", package, "--scene", scene, "--json", *more).stdout)
        self.assertEqual((played()["step_seconds"], played()["steps"]), (0.005, 200))
        self.assertEqual(played("--step", "0.01")["steps"], 100)
        lifted = {"at": [0, 1, 0], "keys": [{"time": 0}, {"time": 0.5, "move": [0, 1, 0]}]}
        self.assertAlmostEqual(middle(seconds=3, gravity=9.81, picks=[{**lifted, "lock": True}])[1], 1.5, delta=0.1)
        self.assertLess(middle(seconds=3, gravity=9.81, picks=[{**lifted, "release": 1}])[1], -5)
        # A sphere that comes to 0 with a radius of 0.3 leaves the block no place before 0.8.
        ways = [{"time": 0, "at": [-2, 0.5, 0]}, {"time": 1, "at": [0, 0.5, 0]}]
        self.assertGreater(middle(seconds=1, pushes=[{"radius": 0.3, "keys": ways}])[0], 0.79)
        # rho c a u^2 / 2 = 360 N at first, for 6 m^2 at 10 m/s.
        x = middle(seconds=1, drag=1, wind=[{"time": 0, "velocity": [10, 0, 0]}])[0]
        self.assertGreater(x, 0.12)
        self.assertLess(x, 0.5 * 0.37)
        self.assertAlmostEqual(middle(seconds=1, drag=1)[0], 0, delta=1e-4)
        for keys, said in (({"picks": [{"keys": []}]}, "a pick needs a place"), ({"pushes": [{"keys": ways}]}, "a sphere needs a radius"),
                           ({"damping": -1}, "Legal: 0.0 to 10000.0"), ({"deformation_damping_ratio": 2}, "Legal: 0.0 to 1.0"),
                           ({"step": 0}, "Legal: "), ({"stiffness": "soft"}, "needs a number"), ({"deformation_damping": 0.1}, "deformation_damping_ratio"),
                           ({"impulses": [{"time": 0}]}, "an impulse needs"), ({"wind": [{"velocity": [0, 0, 0]}]}, "a keyframe needs a time"),
                           ({"levels": [{"time": 0}]}, "a level needs"), ({"levels": [{"time": 1, "level": 1}, {"time": 0, "level": 0}]}, "earlier")):
            scene.write_text(json.dumps({"sinew_scene": 1, **keys}))
            self.assert_refused(run("simulate", package, "--scene", scene), 3, said)

    def test_a_scene_changes_the_level_of_detail(self):
        mesh = self.bake_block()[0]
        package, scene = self.path / "levels.sinew", self.path / "levels.json"
        self.assertEqual(run("bake", mesh, "-o", package, "--set", "field.levels=2").returncode, 0)
        fields = json.loads(run("inspect", package, "--json").stdout)["fields"]
        self.assertEqual([(f["level"], f["functions"]) for f in fields], [(0, 32), (1, 16), (2, 8)])
        places = []
        for levels in ([], [{"time": 0.2, "level": 2}, {"time": 0.6, "level": 1}]):
            scene.write_text(json.dumps({"sinew_scene": 1, "seconds": 1, "gravity": 9.81, "ground": -0.2, "levels": levels}))
            places.append(json.loads(run("simulate", package, "--scene", scene, "--json").stdout))
        self.assertNotEqual(*(p["state_hash"] for p in places))
        self.assertAlmostEqual(*(p["lowest_visual"] for p in places), delta=0.01)

    def test_scenes_of_several_bodies_end_asleep(self):
        mesh, package = self.bake_block()
        even, uneven = "0.016667", "0.016667,0.004167"
        seconds = {"stack": "6", "pyramid": "6", "stairs": "6", "pile": "12"}
        for scene, count, low, high, sequences in (("stack", 10, 9.8, 10.02, (even, uneven)), ("pyramid", 10, 3.95, 4.01, (even, uneven)),
                                                   ("stairs", 6, 0.4, 6, (even, uneven)), ("pile", 60, 1, 6, (even,)),
                                                   (self.heap_scene(mesh), 27, 1, 6, (even, uneven))):
            for steps in sequences:
                measures = json.loads(run("simulate", package, "--scene", scene, "--seconds", seconds.get(scene, "8"),
                                          "--step", steps, "--json").stdout)
                bodies = measures["bodies"]
                self.assertEqual((bodies["count"], bodies["asleep"]), (count, count), (scene, steps))
                self.assertGreater(bodies["height_m"], low, (scene, steps))
                self.assertLess(bodies["height_m"], high, (scene, steps))
        picture = self.path / "pile.png"
        self.assertEqual(run("render", package, "--scene", "rest", "--scene", "pile", "--frames", "2", "-o", picture).returncode, 0)
        self.assert_refused(run("simulate", package, "--scene", "stack", "--solver", "report"), 2, "report", "--scene")
        apart = self.path / "apart.sinew"
        self.assertEqual(run("bake", mesh, "-o", apart, "--no-cache", "--set=field.distances=0").returncode, 0)
        self.assert_refused(run("simulate", apart, "--scene", "stack"), 3, "field.distances")

    def test_scenes_with_colliders(self):
        package = self.bake_block()[1]
        scene, out = self.path / "colliders.json", self.path / "out.obj"
        square = {"points": [[-3, 0, -3], [3, 0, -3], [3, 0, 3], [-3, 0, 3], [-3, -1, -3], [3, -1, -3], [3, -1, 3], [-3, -1, 3]]}
        shapes = (({"plane": {}}, 0), ({"sphere": {"radius": 50}, "at": [0, -50, 0]}, 0),
                  ({"capsule": {"radius": 20, "half_length": 5}, "at": [0, -25, 0]}, 0),
                  ({"box": {"half_size": [2, 1, 2]}, "at": [0, -1, 0]}, 0), ({"hull": square}, 0),
                  ({"mesh": {"points": square["points"][:4], "triangles": [[0, 2, 1], [0, 3, 2]]}}, 0),
                  ({"heights": {"columns": 2, "cell": 4, "heights": [0, 0, 0, 0]}, "at": [-2, 0, -2]}, 0),
                  ({"box": {"half_size": [2, 1, 2]}, "at": [0, -1, 0],
                    "keys": [{"time": 0}, {"time": 1, "move": [0, 0.5, 0]}]}, 0.5))
        for shape, lowest in shapes:
            scene.write_text(json.dumps({"sinew_scene": 1, "seconds": 3, "gravity": 9.81, "colliders": [shape]}))
            done = run("simulate", package, "--scene", scene, "--export", out)
            self.assertEqual(done.returncode, 0, done.stderr)
            low = min(float(line.split()[2]) for line in out.read_text().splitlines() if line.startswith("v "))
            self.assertAlmostEqual(low, lowest, delta=0.02, msg=str(shape))
        picture = self.path / "colliders.png"
        self.assertEqual(run("render", package, "--scene", scene, "--frames", "2", "-o", picture).returncode, 0)
        # Two bodies of two packages on a ground of their own height: one falls onto the other.
        other = self.bake_box("other", 1, 0.5, 1)
        scene.write_text(json.dumps({"sinew_scene": 1, "seconds": 4, "gravity": 9.81, "ground": -1, "bodies": [
            {"move": [0, -1, 0]}, {"package": 1, "move": [-0.5, 0.1, -0.5], "turn": 3, "axis": [0, 1, 0]}]}))
        bodies = json.loads(run("simulate", package, other, "--scene", scene, "--json").stdout)["bodies"]
        self.assertEqual((bodies["count"], bodies["asleep"]), (2, 2))
        self.assertAlmostEqual(bodies["height_m"], 1.5, delta=0.05)
        self.assert_refused(run("simulate", package, "--scene", scene), 3, "no such package", "line")
        mixed = json.loads(run("simulate", package, other, "--scene", "stairs", "--json").stdout)["bodies"]
        self.assertEqual((mixed["count"], mixed["asleep"]), (6, 6))
        self.assert_refused(run("simulate", package, other, "--scene", "drop"), 2, "one body", "pile")
        # What falls into a box of colliders stays in it.
        walls = [{"box": {"half_size": [0.1, 1, 1.2] if x else [1.2, 1, 0.1]}, "at": [x, 0.5, z]} for x, z in ((-1, 0), (1, 0), (0, -1), (0, 1))]
        scene.write_text(json.dumps({"sinew_scene": 1, "seconds": 3, "gravity": 9.81, "ground": 0, "colliders": walls, "bodies": [
            {"move": [0, 0.2, 0], "velocity": [6, 0, 5], "turn": 20, "axis": [1, 1, 0]}]}))
        self.assertEqual(run("simulate", package, "--scene", scene, "--export", out).returncode, 0)
        for line in out.read_text().splitlines():
            if line.startswith("v "):
                x, y, z = map(float, line.split()[1:4])
                self.assertLess(max(abs(x), abs(z)), 0.92)
                self.assertGreater(y, -0.02)
        for keys, said in (({"colliders": [{}]}, "one shape"), ({"colliders": [{"sphere": {}}]}, "radius"),
                           ({"colliders": [{"sphere": {"radius": -1}}]}, "number"),
                           ({"colliders": [{"box": {"half_size": [1, 0, 1]}}]}, "half_size"),
                           ({"colliders": [{"hull": {"points": [[0, 0, 0]]}}]}, "4 to 64"),
                           ({"colliders": [{"hull": {"points": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}}]}, "hull"),
                           ({"colliders": [{"mesh": {"points": [[0, 0, 0]] * 3, "triangles": [[0, 1, 3]]}}]}, "corner"),
                           ({"colliders": [{"heights": {"columns": 2, "cell": 1, "heights": [0]}}]}, "rows"),
                           ({"colliders": [{"plane": {}, "frction": 1}]}, "friction"), ({"bodies": []}, "no body"),
                           ({"colliders": [{"plane": {}, "axis": [0, 1, 0]}]}, "no keys"),
                           ({"ground": "low"}, "number")):
            scene.write_text(json.dumps({"sinew_scene": 1, **keys}))
            self.assert_refused(run("simulate", package, "--scene", scene), 3, said)

    def heap_scene(self, mesh):
        """A scene file of 27 bodies in random orientations that fall onto open ground, three by three by three."""
        places = [[float(x) for x in line.split()[1:]] for line in mesh.read_text().splitlines() if line.startswith("v ")]
        low, high = ([side(p[a] for p in places) for a in range(3)] for side in (min, max))
        diagonal = math.dist(low, high)
        pitch, bodies = 1.05 * diagonal, []
        for i in range(27):
            a, b = 2.3999632 * i, 1.5 * 2.3999632 * i
            # Turned by b about x, then by a about z.
            w, x, y, z = (math.cos(a / 2) * math.cos(b / 2), math.cos(a / 2) * math.sin(b / 2),
                          math.sin(a / 2) * math.sin(b / 2), math.sin(a / 2) * math.cos(b / 2))
            layer, length = i // 9, math.hypot(x, y, z)
            bodies.append({"axis": [x, y, z] if length > 1e-9 else [1, 0, 0], "turn": math.degrees(2 * math.atan2(length, w)),
                           "move": [(i % 3 - 1 + 0.15 * layer) * pitch, 0.6 * diagonal + layer * pitch, (i // 3 % 3 - 1 - 0.1 * layer) * pitch]})
        scene = self.path / "heap.json"
        scene.write_text(json.dumps({"sinew_scene": 1, "seconds": 6, "gravity": 9.81 * diagonal, "ground": (low[1] + high[1]) / 2, "bodies": bodies}))
        return scene

    def bake_box(self, name, x, y, z):
        corners = [(i * x, j * y, k * z) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        mesh, package = self.path / (name + ".obj"), self.path / (name + ".sinew")
        mesh.write_text("".join("v %g %g %g\n" % corner for corner in corners) +
                        "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n")
        self.assertEqual(run("bake", mesh, "-o", package, "--no-cache").returncode, 0)
        return package

    def test_what_falls_flat_does_not_hover(self):
        # The first sheet comes so near to the ground that its next step presses in no more than a hair.
        package = self.bake_box("sheet", 2, 0.01, 2)
        for step in ("0.016667", "0.0163", "0.0153"):
            measures = json.loads(run("simulate", package, "--scene", "pile", "--seconds", "3", "--step", step, "--json").stdout)
            self.assertLess(measures["lowest_visual"], 1e-4, step)

    def test_pile_of_thin_bodies_ends_asleep(self):
        # Fins spring farther in a step than contacts reach.
        vertices, faces = [], []
        rings, corners = 12, 16
        for i in range(rings + 1):
            a = math.pi * i / rings
            for j in range(corners):
                b = 2 * math.pi * j / corners
                vertices.append((-0.5 * math.cos(a), 0.12 * math.sin(a) * math.cos(b), 0.07 * math.sin(a) * math.sin(b)))
        at = lambda i, j: i * corners + j % corners + 1
        for i in range(rings):
            for j in range(corners):
                if i < rings - 1:
                    faces.append((at(i, j), at(i + 1, j), at(i + 1, j + 1)))
                if i > 0:
                    faces.append((at(i, j), at(i + 1, j + 1), at(i, j + 1)))
        for outline in (((0.42, -0.03), (0.7, -0.2), (0.62, 0), (0.7, 0.2), (0.42, 0.03)),
                        ((-0.1, 0.08), (0.2, 0.08), (0.25, 0.24), (0, 0.2))):
            first, count = len(vertices) + 1, len(outline)
            vertices += [(x, y, z) for z in (-0.008, 0.008) for x, y in outline]
            for j in range(1, count - 1):
                faces.append((first, first + j + 1, first + j))
                faces.append((first + count, first + count + j, first + count + j + 1))
            for j in range(count):
                a, b = first + j, first + (j + 1) % count
                faces += [(a, b, b + count), (a, b + count, a + count)]
        mesh, package = self.path / "fish.obj", self.path / "fish.sinew"
        mesh.write_text("".join("v %g %g %g\n" % v for v in vertices) + "".join("f %d %d %d\n" % f for f in faces))
        self.assertEqual(run("bake", mesh, "-o", package, "--no-cache").returncode, 0)
        # How a heap falls is chance: of 20 draws 3 do not sleep after 12 seconds. So several are judged.
        heap, asleep = self.heap_scene(mesh), []
        scene = json.loads(heap.read_text())
        for draw in range(6):
            for i, body in enumerate(scene["bodies"]):
                body["turn"] += 7 * (1 + i % 3) if draw else 0
            heap.write_text(json.dumps(scene))
            steps = ("0.016667", "0.004167", "0.016667,0.004167")[draw % 3]
            measures = json.loads(run("simulate", package, "--scene", heap, "--seconds", "12", "--step", steps, "--json").stdout)["bodies"]
            self.assertEqual(measures["count"], 27)
            self.assertLess(measures["rms_speed_m_s"], 3e-3)
            asleep.append(measures["asleep"])
        self.assertGreaterEqual(asleep.count(27), 5, asleep)

    def test_pieces_of_one_name_are_told_apart(self):
        corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        mesh = self.path / "chest.obj"
        mesh.write_text("".join("v %g %g %g\n" % (x + 3 * n, y, z) for n in (0, 1) for x, y, z in corners) +
                        "".join("f %d %d %d %d\n" % tuple(v + 8 * n for v in face) for n in (0, 1) for face in
                                ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))))
        result = run("bake", mesh, "-o", self.path / "chest.sinew", "--no-cache")
        lines = [line.split(":")[0].split(maxsplit=1)[1] for line in result.stdout.splitlines() if line.startswith("  piece ")]
        self.assertEqual(lines, ["chest 1", "chest 2"])

    def test_sheets_keep_no_volume_unless_told_to(self):
        source = self.path / "sheet.obj"
        points = [f"v {x} 0 {z}\n" for z in range(6) for x in range(6)]
        faces = [f"f {6 * z + x + 1} {6 * z + x + 2} {6 * z + x + 8} {6 * z + x + 7}\n" for z in range(5) for x in range(5)]
        source.write_text("".join(points + faces))
        for settings, of_sheet, of_solid in (((), "none", "principal"), (("--set", "clusters.volume=cube_root"), "cube_root", "cube_root")):
            for mesh, wanted in ((source, of_sheet), (SPOT, of_solid)):
                package = self.path / "volume.sinew"
                self.assertEqual(run("bake", mesh, "-o", package, *settings).returncode, 0)
                mechanics = json.loads(run("inspect", package, "--json").stdout)["mechanics"]
                self.assertEqual({m["volume"] for m in mechanics}, {wanted})

    def test_json_is_one_document_and_says_what_the_contract_says(self):
        package = self.bake()
        result = run("simulate", package, "--scene", "rest", "--seconds", "1", "--json")
        keys = json.loads(result.stdout)
        for key in ("scene", "steps", "step_seconds", "wall_seconds", "microseconds_per_step", "finite", "rest_error",
                    "rms_speed", "volume_ratio", "state_hash"):
            self.assertIn(key, keys)
        self.assertEqual(keys["steps"], 60)
        self.assertLess(keys["rest_error"]["max"], 1e-5)
        source = json.loads(run("inspect", SPOT, "--json").stdout)
        for key in ("meshes", "bounds", "components", "boundary_edges", "non_manifold_edges", "degenerate_triangles", "closed"):
            self.assertIn(key, source)
        self.assertTrue(source["closed"])
        self.assertEqual(source["source_vertices"], 2930)

    def test_threads_change_nothing(self):
        package = self.bake()
        hashes = {json.loads(run("simulate", package, "--scene", "drop", "--seconds", "2", "--threads", n, "--json").stdout)["state_hash"]
                  for n in (1, 2, 3)}
        self.assertEqual(len(hashes), 1)

    def test_other_settings_give_another_body(self):
        sizes = [json.loads(run("inspect", self.bake("--set", f"tetrahedra.vertices={n}", name=f"{n}.sinew"), "--json").stdout)
                 ["physical_vertices"] for n in (300, 3000)]
        self.assertLess(sizes[0], 600)
        self.assertGreater(sizes[1], 1800)

    def test_a_changed_or_cut_package_is_refused(self):
        whole = self.bake("--set", "tetrahedra.vertices=100").read_bytes()
        rng = random.Random(5)
        broken = self.path / "broken.sinew"
        for _ in range(40):
            data = bytearray(whole)
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
            broken.write_bytes(bytes(data))
            self.assert_refused(run("inspect", broken), 3)
        for _ in range(10):
            broken.write_bytes(whole[:rng.randrange(len(whole))])
            self.assert_refused(run("inspect", broken), 3)

    def test_an_interrupted_bake_leaves_nothing(self):
        for delay in (0.005, 0.02, 0.05, 0.1, 0.15):
            process = subprocess.Popen([SINEW, "bake", SPOT, "-o", str(self.path / "x.sinew"), "--set", "tetrahedra.vertices=20000"],
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(delay)
            process.send_signal(signal.SIGINT)
            process.wait(timeout=60)
            left = [p.name for p in self.path.iterdir()]
            self.assertIn(left, ([], ["x.sinew"]))
            if left:  # it was faster than the signal: then the package must be whole
                self.assertEqual(run("inspect", self.path / "x.sinew").returncode, 0)
                (self.path / "x.sinew").unlink()

    def test_a_full_disk_or_forbidden_folder_is_a_system_failure(self):
        if os.path.exists("/dev/full"):
            self.assertEqual(run("bake", SPOT, "-o", "/dev/full/x.sinew").returncode, 2)
        folder = self.path / "locked"
        folder.mkdir()
        package = self.bake()
        if os.geteuid() == 0:
            return  # root may write anywhere
        folder.chmod(0o500)
        self.assert_refused(run("bake", SPOT, "-o", folder / "x.sinew"), 4)
        self.assertTrue(package.exists())


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--spot", required=True)
    arguments, rest = parser.parse_known_args()
    SINEW, SPOT = os.path.abspath(arguments.sinew), os.path.abspath(arguments.spot)
    unittest.main(argv=["command_line_test", *rest], verbosity=2)
