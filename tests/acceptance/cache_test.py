#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The cache of a bake's stages: a series of edits gives the same bytes with and without it, and only the stages that an
edit touches are made again; damaged, foreign and unwritable entries never matter."""
import argparse
import concurrent.futures
import json
import os
import pathlib
import stat
import subprocess
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
HEAD = None
GEOMETRY = ["tetrahedra", "places", "distances"]
ALL = ["tetrahedra", "places", "fields", "distances"]


class Cache(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self.temporary.name)
        self.cache = self.path / "cache" / "sinew"
        self.source = self.path / "head.obj"
        self.source.write_bytes(HEAD.read_bytes())
        self.recipe = {"sinew_recipe": 2, "source": "head.obj", "settings": {"tetrahedra.vertices": 400, "field.functions": 8},
                       "clusters": [{"name": "skull", "from": {"group": "head"}}, {"name": "jaw", "from": {"group": "jaw"}},
                                    {"name": "rest", "from": {"rest": True}}]}

    def tearDown(self):
        self.temporary.cleanup()

    def write_recipe(self):
        recipe, text = self.path / "head.json", json.dumps(self.recipe)
        if not recipe.exists() or recipe.read_text() != text:
            recipe.write_text(text)
        return recipe

    def run_bake(self, package, *arguments):
        recipe = self.write_recipe()
        environment = dict(os.environ, XDG_CACHE_HOME=str(self.path / "cache"))
        return subprocess.run([SINEW, "bake", recipe, "-o", package, "--json", *arguments], capture_output=True, text=True,
                              env=environment, timeout=300 * SLOWNESS)

    def bake(self, *arguments):
        """Bakes; returns the package's bytes and the report's word on the cache."""
        package = self.path / "head.sinew"
        result = self.run_bake(package, *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return package.read_bytes(), json.loads(result.stdout)["cache"]

    def check(self, cached):
        """One bake with the cache and one without: the same bytes; `cached` came from the cache, the rest was made."""
        package, report = self.bake()
        fresh, _ = self.bake("--no-cache")
        self.assertEqual(package, fresh)
        self.assertEqual([s["name"] for s in report["stages"]], ALL)
        self.assertEqual([s["name"] for s in report["stages"] if s["from_cache"]], cached)
        return package

    def test_a_series_of_edits_gives_the_same_bytes_both_ways(self):
        first = self.check([])
        self.assertEqual(self.check(ALL), first)
        self.recipe["settings"]["clusters.stretch_hz"] = 1.5  # stiffness
        stiff = self.check(GEOMETRY)
        self.assertNotEqual(stiff, first)
        self.recipe["clusters"].append({"name": "nose", "from": {"group": "nose"}})
        self.check(GEOMETRY)
        self.recipe["clusters"][1]["from"] = {"or": [{"group": "jaw"}, {"group": "cheek_*"}]}
        self.check(GEOMETRY)
        self.recipe["settings"]["material.density"] = 500
        self.check(GEOMETRY)
        self.recipe["settings"]["tetrahedra.vertices"] = 500
        self.check(["distances"])  # of a surface that is what it was
        self.recipe["parts"] = [{"name": "eye", "from": {"group": "eye_l"}}]  # something else is filled, the surface is the same
        self.check(["distances"])
        self.recipe["parts"][0]["attach"] = "follow"
        self.check(ALL)  # what it follows moves as it did
        del self.recipe["parts"]
        self.check(ALL)  # as before there were parts
        text = self.source.read_text()
        lines = text.split("\n")
        texture = next(i for i, line in enumerate(lines) if line.startswith("vt "))
        lines[texture] = "vt 0.5 0.25"
        self.source.write_text("\n".join(lines))
        self.check(ALL)  # geometry is what it was
        point = next(i for i, line in enumerate(lines) if line.startswith("v "))
        x, *rest = lines[point].split()[1:]
        lines[point] = " ".join(["v", str(float(x) + 1e-3), *rest])
        self.source.write_text("\n".join(lines))
        self.check([])
        self.source.write_text(text)
        del self.recipe["clusters"][-1]
        del self.recipe["settings"]["material.density"], self.recipe["settings"]["clusters.stretch_hz"]
        self.recipe["clusters"][1]["from"] = {"group": "jaw"}
        self.recipe["settings"]["tetrahedra.vertices"] = 400
        self.assertEqual(self.check(ALL), first)  # all undone: the first package again

    def test_damaged_entries_are_found_and_made_again(self):
        package, _ = self.bake()
        self.assertEqual(sorted(e.suffix for e in self.cache.iterdir()), [".distances", ".fields", ".functions", ".places", ".tetrahedra"])
        entries = sorted(e for e in self.cache.iterdir() if e.suffix != ".functions")  # only drafts read these
        whole = {e: e.read_bytes() for e in entries}
        for damage in (lambda b: b[:-1], lambda b: b[:20], lambda b: b"", lambda b: b + b"x",
                       lambda b: b[:len(b) // 2] + bytes([b[len(b) // 2] ^ 1]) + b[len(b) // 2 + 1:],
                       lambda b: b[:48] + bytes([b[48] ^ 4]) + b[49:]):
            for entry in entries:
                entry.write_bytes(damage(whole[entry]))
            again, report = self.bake()
            self.assertEqual(again, package)
            self.assertEqual(report["damaged_entries"], 4)
            self.assertFalse(any(s["from_cache"] for s in report["stages"]))
        # One entry in the place of the other.
        entries[0].write_bytes(whole[entries[1]])
        again, report = self.bake()
        self.assertEqual(again, package)
        self.assertEqual(report["damaged_entries"], 1)
        self.assertTrue(all(s["from_cache"] for s in self.bake()[1]["stages"]))

    def test_a_draft_has_new_materials_on_the_functions_of_an_earlier_bake(self):
        def draft():
            result = self.run_bake(self.path / "draft.sinew", "--draft")
            self.assertEqual(result.returncode, 0, result.stderr)
            return (self.path / "draft.sinew").read_bytes(), json.loads(result.stdout)

        whole, _ = self.bake()
        package, report = draft()  # nothing is newer than what is kept
        self.assertEqual(package, whole)
        self.assertNotIn("draft", report["fields"][0])
        self.recipe["clusters"][1]["settings"] = {"stretch_hz": 1}
        package, report = draft()
        self.assertTrue(report["fields"][0]["draft"])
        self.assertEqual([s["name"] for s in report["cache"]["stages"] if s["from_cache"]], ["tetrahedra", "places", "functions", "distances"])
        self.assertEqual(report["fields"][0]["free"]["residual_modes"], 0)
        self.assertNotEqual(package, whole)
        after, report = self.bake()  # a draft is never kept
        self.assertEqual(after, self.bake("--no-cache")[0])
        self.assertNotEqual(after, package)
        self.recipe["settings"]["tetrahedra.vertices"] = 500  # another shape: there is none to draft on
        _, report = draft()
        self.assertNotIn("draft", report["fields"][0])
        refused = self.run_bake(self.path / "x.sinew", "--draft", "--budget", "1ms")
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--budget", refused.stderr)

    def test_without_a_cache_nothing_is_kept(self):
        self.bake("--no-cache")
        self.assertFalse(self.cache.exists())

    def test_a_folder_that_cannot_be_written_is_no_cache(self):
        (self.path / "cache").write_text("in the way")
        package, report = self.bake()
        self.assertEqual(package, self.bake("--no-cache")[0])
        self.assertFalse(any(s["from_cache"] for s in report["stages"]))
        (self.path / "cache").unlink()
        self.cache.mkdir(parents=True)
        self.cache.chmod(stat.S_IRUSR | stat.S_IXUSR)
        self.assertEqual(self.bake()[0], package)
        self.cache.chmod(stat.S_IRWXU)

    def test_two_bakes_at_once_share_it(self):
        self.write_recipe()  # before any of them reads it
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            results = list(pool.map(lambda i: self.run_bake(self.path / f"{i}.sinew"), range(4)))
        self.assertEqual([r.returncode for r in results], [0] * 4, [r.stderr for r in results])
        self.assertEqual(len({(self.path / f"{i}.sinew").read_bytes() for i in range(4)}), 1)
        self.assertEqual(len(list(self.cache.iterdir())), 5)  # nothing half-written stays
        self.check(ALL)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--head", required=True, type=pathlib.Path)
    arguments, rest = parser.parse_known_args()
    SINEW, HEAD = arguments.sinew, arguments.head
    unittest.main(argv=[__file__, *rest])
