#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The L-bar of samples/gallery/l_bar, pulled straight: no kink in the corner, however its clusters meet."""
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


class LBar(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        folder = pathlib.Path(cls.folder.name)
        cls.packages = {name: folder / f"{name}.sinew" for name in ("recipe", "boxes")}
        for name, package in cls.packages.items():
            done = run("bake", BAR / f"{name}.json", "-o", package)
            if done.returncode != 0:
                raise AssertionError(done.stderr)
        cls.picture = folder / "bar.png"
        done = run("study", "kinks", *cls.packages.values(), "--scene", BAR / "straight.json", "--mask", "corner",
                   "--arms", "arm.x", "arm.y", "--picture", cls.picture, "--json")
        if done.returncode != 0:
            raise AssertionError(done.stderr)
        blended, boxes = json.loads(done.stdout)["results"]
        cls.blended, cls.boxes = blended, boxes

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_source_is_what_the_script_makes(self):
        made = subprocess.run([sys.executable, BAR / "make.py"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(made, (BAR / "l_bar.obj").read_text())

    def test_it_is_an_l_of_even_rounding_at_rest(self):
        for result in (self.blended, self.boxes):
            self.assertAlmostEqual(result["rest_degrees"], 7.5, delta=0.05)
            self.assertAlmostEqual(result["rest_bend_degrees"], 90, delta=0.1)

    def test_it_is_straight_and_without_a_kink(self):
        for result in (self.blended, self.boxes):
            self.assertLessEqual(result["ratio"], 1.3)
            self.assertLessEqual(result["posed_bend_degrees"], 15)

    def test_clusters_of_one_material_are_no_matter(self):
        self.assertAlmostEqual(self.blended["posed_degrees"], self.boxes["posed_degrees"], delta=0.1)
        self.assertAlmostEqual(self.blended["posed_bend_degrees"], self.boxes["posed_bend_degrees"], delta=0.1)

    def test_matched_one_by_one_clusters_kink(self):
        done = run("study", "kinks", *self.packages.values(), "--scene", BAR / "straight.json", "--mask", "corner",
                   "--solver", "report", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        for result in json.loads(done.stdout)["results"]:
            self.assertGreater(result["ratio"], 2)

    def test_more_iterations_are_the_same_shape(self):
        done = run("study", "kinks", self.packages["recipe"], "--scene", BAR / "straight.json", "--mask", "corner",
                   "--iterations", "16", "--json")
        self.assertEqual(done.returncode, 0, done.stderr)
        result, = json.loads(done.stdout)["results"]
        self.assertAlmostEqual(result["posed_degrees"], self.blended["posed_degrees"], delta=0.1)

    def test_it_is_drawn(self):
        self.assertEqual(self.picture.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")

    def test_an_unknown_mask_is_named(self):
        done = run("study", "kinks", self.packages["recipe"], "--scene", BAR / "straight.json", "--mask", "cornr")
        self.assertEqual(done.returncode, 3)
        self.assertEqual(done.stdout, "")
        self.assertEqual(done.stderr.strip(),
                         f"sinew: {self.packages['recipe']}: has no mask 'cornr'. Did you mean corner?")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    arguments, rest = parser.parse_known_args()
    SINEW = arguments.sinew
    unittest.main(argv=[sys.argv[0], *rest])
