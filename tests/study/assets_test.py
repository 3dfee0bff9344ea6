#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sinew study assets` on a package of its own baking: what it reports, and what it refuses."""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
BAR = pathlib.Path(__file__).resolve().parents[2] / "samples" / "gallery" / "l_bar"


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=300 * SLOWNESS)


class Assets(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.package = pathlib.Path(cls.folder.name) / "bar.sinew"
        done = run("bake", BAR / "l_bar.obj", "-o", cls.package, "--set", "tetrahedra.vertices=400")
        if done.returncode != 0:
            raise AssertionError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_every_scene_is_judged_by_a_reference_that_has_come_to_rest(self):
        done = run("study", "assets", self.package, "--scenes", "lean,press,pins", "--target", "2,0.5%", "--seconds",
                   "2", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = json.loads(done.stdout)["results"]
        self.assertEqual([row["scene"] for row in rows], ["lean", "lean", "press", "pins", "pins"])
        self.assertEqual([row["exists"] for row in rows], [True, True, True, False, False])
        for row in rows[:3]:
            self.assertEqual(row["package"], "bar")
            self.assertLess(row["reference"]["residual"], 1e-5)
            self.assertTrue(row["finite"])
            self.assertGreaterEqual(row["error_rms"], 0)
            self.assertGreater(row["microseconds_per_step"], 0)
        for row, target in zip(rows, (0.02, 0.005)):
            self.assertAlmostEqual(row["reference"]["rms_displacement"], target, delta=0.005 * target)
            self.assertTrue(row["reference"]["stable"])
        self.assertEqual(rows[2]["gravity"], 0)
        self.assertTrue(rows[2]["reference"]["stable"])

    def test_what_the_bake_did_not_foresee_gives_way_as_the_body_does(self):
        # A head on a thin stem, which is held at its end: springs of one firmness know nothing of the stem.
        outline = [(-.07, 0), (.07, 0), (.07, .5), (.5, .5), (.5, .9), (-.5, .9), (-.5, .5), (-.07, .5)]
        faces = [(0, 1, 2), (0, 2, 7), (2, 3, 4), (2, 4, 5), (2, 5, 7), (5, 6, 7)]
        lines = [f"v {x} {y} {z}" for z in (-.1, .1) for x, y in outline]
        for a, b, c in faces:
            lines += [f"f {a + 9} {b + 9} {c + 9}", f"f {c + 1} {b + 1} {a + 1}"]
        for i in range(8):
            j = (i + 1) % 8
            lines += [f"f {i + 1} {j + 1} {j + 9}", f"f {i + 1} {j + 9} {i + 9}"]
        folder = self.package.parent
        (folder / "stem.obj").write_text("\n".join(lines) + "\n")
        error = {}
        for modes in (0, 96):
            package = folder / f"stem{modes}.sinew"
            done = run("bake", folder / "stem.obj", "-o", package, "--set", "tetrahedra.vertices=700", "--set",
                       f"field.residual_modes={modes}")
            self.assertEqual(done.returncode, 0, done.stderr)
            done = run("study", "assets", package, "--scenes", "lean", "--target", "5", "--json")
            self.assertEqual(done.returncode, 0, done.stderr)
            error[modes] = json.loads(done.stdout)["results"][0]["error_rms"]
        self.assertLess(error[96], 0.04)
        self.assertGreater(error[0], 0.15)

    def test_the_table_has_a_line_a_row(self):
        done = run("study", "assets", self.package, "--scenes", "hang", "--target", "1", "--seconds", "0.5")
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stdout.splitlines()
        self.assertTrue(lines[0].startswith("package"))
        self.assertTrue(lines[1].startswith("bar"))

    def test_a_target_that_is_none_is_a_mistake_of_usage(self):
        for target in ("0", "80", "much", "-1"):
            done = run("study", "assets", self.package, f"--target={target}")
            self.assertEqual(done.returncode, 2, target)
            self.assertIn("--target", done.stderr)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    options, rest = parser.parse_known_args()
    SINEW = options.sinew
    unittest.main(argv=[sys.argv[0], *rest])
