#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs `sinew bench --quick --json` and checks all of it that does not depend on time: that every line is there, that the
runtime's kernels agree with the Eigen reference, that threads and instruction sets do not change the state, that bounds
and ratios are what they are said to be. Whether a figure meets its limit is for a quiet machine, never for a test."""
import argparse
import json
import math
import subprocess
import unittest

SINEW = None

GROUPS = ("matching", "step", "output", "linearity", "threads", "determinism", "memory", "library", "open")
LINES = (
    [("matching", f"{mode} n={n}") for mode in ("linear", "quadratic") for n in (8, 32, 64, 216)]
    + [("output", "positions"), ("output", "positions and normals")]
    + [("linearity", f"exponent over {what}, {passes}") for what in ("vertices of a body", "bodies of 125 vertices")
       for passes in ("4 iterations", "1 iteration")]
    + [("linearity", "exponent over vertices of a body, of its bound")]
    + [("determinism", name) for name in ("1 thread", "2 threads", "3 threads", "8 threads", "instruction set sse42",
                                          "instruction set avx2", "instruction set avx512")]
    + [("memory", "an instance"), ("memory", "an instance, normals written"), ("memory", "scratch of a thread")]
    + [("library", "libsinew_runtime.so, stripped"), ("library", "libraries it needs beyond C and C++")]
    + [("open", "open and check a package"), ("open", "add an instance")]
)


def run(*arguments):
    return subprocess.run([SINEW, "bench", *arguments], capture_output=True, text=True, timeout=800)


class Bench(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        result = run("--quick", "--json")
        # 1: a limit was missed, which a quick run on a busy machine may.
        assert result.returncode in (0, 1), result.stderr
        cls.report = json.loads(result.stdout)
        cls.returncode = result.returncode
        cls.peers = [line for line in cls.report["results"] if line["name"].startswith("peer/")]
        own = [line for line in cls.report["results"] if not line["name"].startswith("peer/")]
        cls.lines = {(line["group"], line["name"].removeprefix(line["group"] + "/")): line for line in own}

    def test_every_line_is_there_once(self):
        self.assertEqual(len(self.lines) + len(self.peers), len(self.report["results"]))
        self.assertEqual(len({line["name"] for line in self.report["results"]}), len(self.report["results"]))
        for key in LINES:
            self.assertIn(key, self.lines)
        self.assertEqual(set(group for group, _ in self.lines), set(GROUPS))

    def test_peers_have_results_of_their_own(self):
        self.assertTrue(self.peers)
        for peer in self.peers:
            with self.subTest(name=peer["name"]):
                self.assertGreater(peer["value"], 0)
                self.assertTrue(peer["lower_is_better"])
                group, name = peer["name"].removeprefix("peer/").split("/", 1)
                name, library = name.rsplit(", ", 1)
                self.assertEqual(self.lines[group, name]["reference"], library)
                self.assertEqual(self.lines[group, name]["reference_value"], peer["value"])

    def test_machine(self):
        machine = self.report["machine"]
        self.assertGreater(machine["fma_gflops"], 0.1)
        copies = machine["copy_gigabytes_per_second"]
        self.assertGreaterEqual(len(copies), 6)
        self.assertEqual([c["bytes"] for c in copies], sorted(c["bytes"] for c in copies))
        for copy in copies:
            self.assertGreater(copy["one_thread"], 0)
            self.assertGreater(copy["two_threads"], 0)

    def test_figures_are_numbers_or_say_why_not(self):
        for (group, name), line in self.lines.items():
            with self.subTest(group=group, name=name):
                if line["value"] is None:
                    self.assertTrue(line["note"])
                    self.assertIsNone(line["passed"])
                else:
                    self.assertTrue(math.isfinite(line["value"]))
                    self.assertGreaterEqual(line["value"], 0)
                if "bound" in line:
                    self.assertAlmostEqual(line["ratio_to_bound"], line["value"] / line["bound"], delta=1e-6 * line["ratio_to_bound"])

    def test_kernels_agree_with_the_reference(self):
        agreements = [line for (_, name), line in self.lines.items() if name.endswith("distance from the reference")]
        # A world's step and at least one table of kernels, for each of eight shapes.
        self.assertGreaterEqual(len(agreements), 16)
        for line in agreements:
            with self.subTest(name=line["name"]):
                self.assertLess(line["value"], 2e-5)
                self.assertTrue(line["passed"])

    def test_state_is_the_same_for_threads_and_instruction_sets(self):
        states = set()
        for (group, name), line in self.lines.items():
            if group != "determinism" or line["unit"] != "differing states" or line["value"] is None:
                continue
            with self.subTest(name=name):
                self.assertEqual(line["value"], 0)
            states.add(line["note"])
        self.assertEqual(len(states), 1)

    def test_exit_code_says_whether_limits_hold(self):
        missed = [line["name"] for line in self.report["results"] if line.get("passed") is False]
        self.assertEqual(self.report["passed"], not missed)
        self.assertEqual(self.returncode, 1 if missed else 0)


class Usage(unittest.TestCase):
    def test_one_group(self):
        result = run("--quick", "--json", "--filter", "open")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual({line["group"] for line in json.loads(result.stdout)["results"]}, {"open"})

    def test_unknown_group_is_one_clear_line(self):
        result = run("--filter", "nothing")
        self.assertEqual(result.returncode, 2)
        self.assertEqual(result.stdout, "")
        self.assertEqual(len(result.stderr.strip().splitlines()), 1)
        self.assertIn("matching", result.stderr)

    def test_a_library_that_is_not_there(self):
        result = run("--quick", "--json", "--filter", "library", "--library", "no_such_file.so")
        self.assertEqual(result.returncode, 0, result.stderr)
        for line in json.loads(result.stdout)["results"]:
            self.assertIsNone(line["value"])
            self.assertIn("no_such_file.so", line["note"])


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    arguments, rest = parser.parse_known_args()
    SINEW = arguments.sinew
    unittest.main(argv=["bench_test.py", *rest])
