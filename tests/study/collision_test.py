#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sinew study collision` on spot: what it counts, that chance repeats, and what it refuses."""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

SINEW = None
SPOT = pathlib.Path(__file__).resolve().parents[2] / "samples" / "assets" / "spot" / "spot.obj"


def run(*arguments):
    return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True)


class Collision(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.package = pathlib.Path(cls.folder.name) / "spot.sinew"
        done = run("bake", SPOT, "-o", cls.package, "--set", "tetrahedra.vertices=300")
        if done.returncode != 0:
            raise AssertionError(done.stderr)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def counts(self, *arguments):
        done = run("study", "collision", self.package, "--json", *arguments)
        self.assertEqual(done.returncode, 0, done.stderr)
        result = json.loads(done.stdout)
        for method in result["methods"]:
            method.pop("microseconds")
        return result

    def test_what_overlaps_is_seen_and_led_apart(self):
        result = self.counts("--pairs", 80)
        self.assertGreater(result["overlapping"], 20)
        self.assertGreater(result["apart"], 20)
        ours = result["methods"][0]
        self.assertEqual(ours["missed"], 0)
        self.assertEqual(ours["false"], 0)
        self.assertLessEqual(ours["wrong_way"], 0.1 * result["overlapping"])
        for method in result["methods"]:
            seen = method["missed"] + method["wrong_way"] + sum(method["right_by_depth"])
            self.assertEqual(seen, result["overlapping"], method)

    def test_the_same_seed_draws_the_same_pairs(self):
        self.assertEqual(self.counts("--pairs", 10, "--seed", 7), self.counts("--pairs", 10, "--seed", 7))

    def test_what_cannot_touch_is_refused(self):
        bare = pathlib.Path(self.folder.name) / "bare.sinew"
        done = run("bake", SPOT, "-o", bare, "--set", "tetrahedra.vertices=300", "--set", "field.distances=0")
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("study", "collision", bare)
        self.assertEqual(done.returncode, 3)
        self.assertIn("bare.sinew", done.stderr)
        self.assertIn("field.distances", done.stderr)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    options, rest = parser.parse_known_args()
    SINEW = options.sinew
    unittest.main(argv=[sys.argv[0], *rest])
