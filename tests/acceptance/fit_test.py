#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Bakes that fit: needs, budgets of time and bytes, largest error, and what inspect says of costs."""
import argparse
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
SPOT = None
SMALL = ["--set", "tetrahedra.vertices=150", "--no-cache"]


class Fit(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.temporary.name)
        self.package = self.path / "spot.sinew"

    def tearDown(self):
        self.temporary.cleanup()

    def run_sinew(self, *arguments):
        return subprocess.run([SINEW, *map(str, arguments)], capture_output=True, text=True, timeout=600 * SLOWNESS)

    def bake(self, *arguments):
        result = self.run_sinew("bake", SPOT, "-o", self.package, "--json", *SMALL, *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def refusal(self, *arguments):
        result = self.run_sinew("bake", SPOT, "-o", self.path / "not.sinew", *SMALL, *arguments)
        self.assertNotEqual(result.returncode, 0)
        self.assertEqual(result.stdout, "")
        self.assertFalse((self.path / "not.sinew").exists())
        return result.returncode, result.stderr

    def test_nothing_extra_is_less_than_half_and_sound(self):
        everything = self.bake()["package_bytes"]
        report = self.bake("--needs", "none")
        self.assertEqual(report["package_bytes"], self.package.stat().st_size)
        self.assertLess(2 * report["package_bytes"], everything)
        self.assertLess(report["left_out"]["drawn_difference"], 1e-3)
        self.assertEqual(self.run_sinew("check", self.package).returncode, 0)
        still = self.run_sinew("simulate", self.package, "--scene", "hang", "--seconds", "0.5", "--json")
        self.assertEqual(still.returncode, 0, still.stderr)

    def test_auto_leaves_out_what_goes_unseen_and_says_what_it_changes(self):
        everything = self.bake()["package_bytes"]
        report = self.bake("--needs", "auto")
        left = report["left_out"]
        self.assertLess(report["package_bytes"], everything)
        needs = left["needs"].split(",")
        for need in ("contact", "pins", "normals", "uvs", "textures"):
            self.assertIn(need, needs)
        self.assertNotIn("exact", needs)
        for unseen in left["unseen"]:
            self.assertLessEqual(unseen["change"], unseen["bound"])
            self.assertGreater(unseen["bytes"], 0)
        self.assertLessEqual(left["drawn_difference"], 1e-3)
        self.assertEqual(self.run_sinew("check", self.package).returncode, 0)
        report = self.bake("--needs", "auto,cut,normals")
        self.assertEqual(report["left_out"]["needs"], "cut,normals")

    def test_a_scene_file_says_what_it_needs(self):
        scene = self.path / "cuts.json"
        scene.write_text(json.dumps({"sinew_scene": 1, "ground": -1,
                                     "cuts": [{"time": 0.1, "point": [0, 0, 0], "normal": [1, 0, 0]}]}))
        report = self.bake("--needs", scene)
        needs = report["left_out"]["needs"].split(",")
        self.assertIn("contact", needs)
        self.assertIn("cut", needs)
        self.assertNotIn("exact", needs)
        played = self.run_sinew("simulate", self.package, "--scene", scene, "--seconds", "0.3", "--json")
        self.assertEqual(played.returncode, 0, played.stderr)

    def test_costs_are_those_of_the_file_and_of_leaving_out(self):
        self.bake()
        result = self.run_sinew("inspect", self.package, "--cost", "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        cost = json.loads(result.stdout)
        self.assertEqual(cost["bytes"], self.package.stat().st_size)
        self.assertGreater(cost["times"]["step_in_the_air_us"], 0)
        saved = {need["need"]: need["bytes"] for need in cost["needs"]}
        report = self.bake("--needs", "all")
        for need in ("identity", "contact", "normals", "exact"):
            kept = ",".join(other for other in saved if other not in (need, "contact,cut"))
            less = self.bake("--needs", kept)["package_bytes"]
            # The settings in the package's texts name its needs.
            self.assertAlmostEqual(report["package_bytes"] - less, saved[need], delta=256, msg=need)
        self.bake("--needs", "none")
        least = json.loads(self.run_sinew("inspect", self.package, "--cost", "--json").stdout)
        self.assertEqual(least["bytes"], self.package.stat().st_size)

    def test_the_finest_that_fits_is_taken(self):
        report = self.bake("--budget-bytes", "250k", "--needs", "contact,normals")
        tries = report["budget"]["tries"]
        chosen = report["budget"]["chosen"]
        self.assertLessEqual(self.package.stat().st_size, 250000)
        self.assertEqual(chosen["bytes"], self.package.stat().st_size)
        for other in tries:
            if other["functions"] > chosen["functions"]:
                self.assertGreater(other["bytes"], 250000)
        self.assertTrue(any(other["functions"] > chosen["functions"] for other in tries))
        self.assertGreater(chosen["bytes"], 200000)

    def test_the_cheapest_within_an_error_is_taken(self):
        report = self.bake("--max-error", "10%")
        chosen = report["budget"]["chosen"]
        self.assertLessEqual(chosen["error"], 0.1)
        less = [other for other in report["budget"]["tries"] if other["functions"] < chosen["functions"]]
        self.assertTrue(less)
        self.assertTrue(all(other["error"] > 0.1 for other in less))

    def test_the_same_costs_choose_the_same(self):
        costs = self.path / "costs.json"
        first = self.bake("--budget", "60ms", "--cost-file", costs)["budget"]
        kept = self.package.read_bytes()
        known = json.loads(costs.read_text())
        self.assertGreater(len(known), 1)
        # A slower machine's file: what is measured here no longer counts.
        slower = {key: {"step": 1000 * times["step"], "drawn": 0} for key, times in known.items()}
        costs.write_text(json.dumps(slower))
        second = self.bake("--budget", "60ms", "--cost-file", costs)["budget"]
        again = self.bake("--budget", "60ms", "--cost-file", costs)["budget"]
        self.assertEqual(second["chosen"], again["chosen"])
        self.assertLess(second["chosen"]["functions"], first["chosen"]["functions"])
        self.assertNotEqual(kept, self.package.read_bytes())

    def test_meshes_get_coarser_until_one_fits(self):
        few = ["--needs", "none", "--set", "field.functions=8", "--set"]
        coarse, fine = (self.bake(*few, f"tetrahedra.vertices={count}") for count in (20, 80))
        self.assertLess(coarse["package_bytes"], fine["package_bytes"])
        budget = (coarse["package_bytes"] + fine["package_bytes"]) // 2
        report = self.bake("--needs", "none", "--budget-bytes", budget)
        self.assertLessEqual(report["package_bytes"], budget)
        self.assertLess(report["physical_vertices"], fine["physical_vertices"])

    def test_what_cannot_be_is_refused_with_figures(self):
        code, message = self.refusal("--max-error", "10%", "--budget-bytes", "50k")
        self.assertEqual(code, 3)
        self.assertIn("exceeds the budget", message)
        code, message = self.refusal("--budget-bytes", "1k")
        self.assertEqual(code, 3)
        self.assertIn("8 functions", message)
        for arguments in (("--budget", "5"), ("--budget", "-1ms"), ("--budget-bytes", "x"), ("--max-error", "0%"),
                          ("--needs", "contacts"), ("--cost-file", str(self.path / "c.json"))):
            code, message = self.refusal(*arguments)
            self.assertEqual(code, 2, message)
        (self.path / "bad.json").write_text('{"a": 1}')
        code, message = self.refusal("--budget", "1ms", "--cost-file", self.path / "bad.json")
        self.assertEqual(code, 3)
        self.assertIn("bad.json", message)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--spot", type=pathlib.Path, required=True)
    options, rest = parser.parse_known_args()
    SINEW, SPOT = options.sinew, options.spot
    unittest.main(argv=[__file__, *rest])
