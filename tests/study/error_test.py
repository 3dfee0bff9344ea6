#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sinew study error` on a bar: its numbers make sense, its page is whole in itself, what it cannot take it refuses."""
import argparse
import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
BAR = pathlib.Path(__file__).resolve().parents[2] / "samples" / "gallery" / "l_bar"


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=300 * SLOWNESS)


class Error(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.page = pathlib.Path(cls.folder.name) / "bar.html"
        done = run("study", "error", BAR / "l_bar.obj", "--set", "tetrahedra.vertices=300", "--scene", "cantilever,release,feet",
                   "--functions", "6,32", "--vertices", 60, "--html", cls.page, "--json")
        if done.returncode != 0:
            raise AssertionError(done.stderr)
        cls.study = json.loads(done.stdout)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def rows(self, scene, method):
        return [row for row in self.study["scenes"][scene]["results"] if row["method"] == method]

    def test_gravity_moves_the_reference_about_as_asked(self):
        for scene in self.study["scenes"][:2]:
            self.assertTrue(scene["reference"]["quadratic"])
            # 2 % of the diagonal at rest; a swing about that, or one that dies away.
            self.assertGreater(scene["reference"]["rms_displacement"], 0.01)
            self.assertLess(scene["reference"]["rms_displacement"], 0.05)
            self.assertLess(scene["reference"]["change_shorter_steps"], 0.01)

    def test_more_functions_come_nearer(self):
        # Of short steps: long ones ring too low, whatever the shape.
        coarse, fine = (min(row["path"] for row in self.rows(0, "sinew")
                            if row["knobs"].startswith(f"{n} functions") and row["knobs"].endswith("4 steps"))
                        for n in (6, 32))
        self.assertLess(fine, coarse)
        self.assertLess(fine, 0.5)

    def test_what_is_let_go_swings_at_about_the_frequency_of_the_reference(self):
        self.assertGreater(self.study["scenes"][1]["reference"]["frequency_hz"], 1)
        for row in self.rows(1, "sinew"):
            if row["knobs"].startswith("32 functions"):
                self.assertAlmostEqual(row["frequency_ratio"], 1, delta=0.06 if row["knobs"].endswith("4 steps") else 0.2)

    def test_what_falls_on_the_ground_comes_to_the_rest_of_the_reference(self):
        reference = self.study["scenes"][2]["reference"]
        self.assertGreater(reference["largest_displacement"], 0.01)
        self.assertLess(reference["change_firmer_ground"], 0.1)
        for row in self.rows(2, "sinew"):
            if row["knobs"].startswith("32 functions, 4 iterations"):
                self.assertLess(row["end"], 0.1)
                self.assertLess(row["path"], 0.5)
        self.assertFalse(self.rows(2, "bullet fem, implicit"))
        self.assertTrue(any("Coulomb" in note for note in self.study["notes"]) or not self.rows(2, "bullet fem"))

    def test_every_method_was_tried(self):
        for scene in range(3):
            for method in ("sinew", "report", "xpbd", "stiffness warping"):
                self.assertTrue(any("path" in row for row in self.rows(scene, method)), method)

    def test_fronts_are_marked(self):
        for scene in self.study["scenes"]:
            rows = [row for row in scene["results"] if "path" in row]
            for row in rows:
                beaten = any((other["path"] < row["path"] and other["milliseconds_per_frame"] <= row["milliseconds_per_frame"]) or
                             (other["path"] <= row["path"] and other["milliseconds_per_frame"] < row["milliseconds_per_frame"])
                             for other in rows)
                self.assertEqual(row["front"], not beaten)

    def test_the_page_needs_nothing_else(self):
        page = self.page.read_text()
        self.assertFalse(re.search(r"(src|href)\s*=\s*['\"](?!data:)", page))
        self.assertNotIn("<script", page)
        self.assertEqual(page.count("data:image/png;base64,"), 3)
        self.assertEqual(page.count("aria-label='Error over time'"), 3)
        for word in ("nan", "inf "):
            self.assertNotIn(word, re.sub(r"base64,[^']*", "", page))

    def test_a_package_is_played_as_it_is(self):
        package = pathlib.Path(self.folder.name) / "bar.sinew"
        self.assertEqual(run("bake", BAR / "l_bar.obj", "-o", package, "--set", "tetrahedra.vertices=300").returncode, 0)
        done = run("study", "error", package, "--scene", "cantilever", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = json.loads(done.stdout)["scenes"][0]["results"]
        self.assertEqual({row["knobs"].split(",")[0] for row in rows if row["method"] == "sinew"}, {"32 functions"})
        self.assertEqual(len({row["vertices"] for row in rows}), 1)
        fine = min(row["path"] for row in self.rows(0, "sinew") if row["knobs"].startswith("32 functions"))
        self.assertAlmostEqual(min(row["path"] for row in rows if row["method"] == "sinew"), fine, delta=1e-3)

    def test_what_cannot_be_compared_is_refused(self):
        page = pathlib.Path(self.folder.name) / "none.html"
        package = pathlib.Path(self.folder.name) / "clusters.sinew"
        done = run("bake", BAR / "l_bar.obj", "-o", package, "--set", "attachment.method=clusters")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("study", "error", package, "--html", page)
        self.assertEqual(done.returncode, 3)
        self.assertIn("does not hang on tetrahedra", done.stderr)
        done = run("study", "error", package, "--set", "field.functions=4", "--html", page)
        self.assertEqual(done.returncode, 2)
        self.assertFalse(page.exists())


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    arguments, rest = parser.parse_known_args()
    SINEW = arguments.sinew
    unittest.main(argv=[__file__, *rest])
