#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The skin patch of samples/gallery/skin_patch against finite elements: the more functions, the nearer."""
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
SKIN = pathlib.Path(__file__).resolve().parents[2] / "samples" / "gallery" / "skin_patch"
CUBE = pathlib.Path(__file__).resolve().parents[1] / "assets" / "generated" / "cube.obj"


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=300 * SLOWNESS)


class SkinPatch(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.picture = pathlib.Path(cls.folder.name) / "skin.png"
        done = run("study", "pull", SKIN / "recipe.json", "--pull", "0,0.05,0", "--clusters", "1,10", "--functions", "32,64",
                   "--iterations", "1,4", "--seconds", 2, "--picture", cls.picture, "--json")
        if done.returncode != 0:
            raise AssertionError(done.stderr)
        cls.study = json.loads(done.stdout)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_source_is_what_the_script_makes(self):
        made = subprocess.run([sys.executable, SKIN / "make.py"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(made, (SKIN / "skin_patch.obj").read_text())

    def test_the_reference_has_settled(self):
        reference = self.study["reference"]
        self.assertLess(reference["change_rms"], 0.01)
        self.assertLess(reference["change_max"], 0.05)
        self.assertEqual(self.study["held_vertices"], 37 * 37)

    def rows_of(self, functions):
        return [row for row in self.study["results"] if row["functions"] == functions]

    def test_more_functions_come_nearer(self):
        for coarse, fine in zip(self.rows_of(32), self.rows_of(64)):
            # What the mean is off is the tetrahedra's: what holds gives way alike.
            self.assertLess(fine["rms"], 1.02 * coarse["rms"])
            self.assertLess(fine["max"], 0.9 * coarse["max"])
            # Half of what a body that does not move is off.
            self.assertLess(coarse["rms"], 0.5)

    def test_clusters_and_iterations_are_no_matter(self):
        for functions in (32, 64):
            rows = self.rows_of(functions)
            self.assertEqual([row["clusters"] for row in rows], [1, 1, 100, 100])
            self.assertEqual([row["iterations"] for row in rows], [1, 4, 1, 4])
            for row in rows:
                self.assertAlmostEqual(row["rms"], rows[0]["rms"], delta=5e-4)
                self.assertAlmostEqual(row["max"], rows[0]["max"], delta=1e-3)

    def test_it_comes_to_rest(self):
        for row in self.study["results"]:
            self.assertLess(row["drift"], 1e-3)
            self.assertGreater(row["microseconds_per_step"], 0)

    def test_matched_one_by_one_it_takes_many_clusters(self):
        done = run("study", "pull", SKIN / "recipe.json", "--pull", "0,0.05,0", "--clusters", "1,2,5", "--functions", 8,
                   "--refinements", 1, "--solver", "report", "--seconds", 2, "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = json.loads(done.stdout)["results"]
        for coarse, fine in zip(rows, rows[1:]):
            self.assertLess(fine["rms"], 0.6 * coarse["rms"])

    def test_the_best_rows_are_marked(self):
        rows = self.study["results"]
        for row in rows:
            beaten = any(other["rms"] < row["rms"] and
                         other["microseconds_per_step"] < row["microseconds_per_step"] for other in rows)
            self.assertEqual(row["best"], not beaten)

    def test_it_is_drawn(self):
        self.assertEqual(self.picture.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")

    def test_where_nothing_is_free_nothing_is_pulled(self):
        picture = pathlib.Path(self.folder.name) / "cube.png"
        done = run("study", "pull", CUBE, "--pick", "0.5,0,0.5", "--finger", "1e-3", "--picture", picture)
        self.assertEqual(done.returncode, 3)
        self.assertEqual(done.stdout, "")
        self.assertEqual(done.stderr.strip(), f"sinew: {CUBE}: nothing is pulled: no free physical vertex is near the "
                                              "point. Raise --finger, or give --pick a point that nothing holds.")
        self.assertFalse(picture.exists())


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    arguments, rest = parser.parse_known_args()
    SINEW = arguments.sinew
    unittest.main(argv=[sys.argv[0], *rest])
