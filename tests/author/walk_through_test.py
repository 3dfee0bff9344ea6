#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk-through of docs/authoring.md, run as written in an empty folder: a person types no more than what stands there."""
import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

SINEW = None
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
ROOT = pathlib.Path(__file__).resolve().parents[2]
PICTURES = ("region.png", "weights.png", "pins.png", "smile.png")


def blocks(title):
    """Shell blocks of one section of the page."""
    text = (ROOT / "docs" / "authoring.md").read_text()
    section = re.search(rf"^## {re.escape(title)}$(.*?)^## ", text, re.M | re.S).group(1)
    return re.findall(r"^```sh\n(.*?)^```$", section, re.M | re.S)


class WalkThrough(unittest.TestCase):
    def test_runs_as_written(self):
        script = "".join(blocks("A face, step by step"))
        self.assertGreater(script.count("sinew "), 25)
        with tempfile.TemporaryDirectory() as name:
            folder, tools = pathlib.Path(name) / "face", pathlib.Path(name) / "bin"
            folder.mkdir()
            tools.mkdir()
            (tools / "sinew").symlink_to(SINEW)
            environment = dict(os.environ, SINEW=str(ROOT), PATH=f"{tools}{os.pathsep}{os.environ['PATH']}")
            # A window is opened in tests/studio; here the command need only be there.
            self.assertIn("\nsinew view face.sinew --scene smile.json\n", script)
            script = script.replace("\nsinew view face.sinew", "\nsinew view --help > help.txt # face.sinew")
            done = subprocess.run(["bash", "-e"], input=script, cwd=folder, env=environment, capture_output=True, text=True, timeout=500 * SLOWNESS)
            if "OpenGL" in done.stderr:
                self.skipTest("no OpenGL here")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(done.stderr, "")
            for picture in PICTURES:
                self.assertGreater((folder / picture).stat().st_size, 20000, picture)
            self.smiles(folder)
            keep = os.environ.get("SINEW_KEEP_PICTURES")  # a folder: how the page's pictures are made
            for picture in PICTURES if keep else ():
                shutil.copy(folder / picture, keep)

    def smiles(self, folder):
        """Both corners of the mouth go up and out by millimetres, and `check` has nothing to say."""
        def run(*arguments):
            return subprocess.run([SINEW, *arguments], cwd=folder, check=True, capture_output=True, text=True).stdout

        findings = json.loads(run("check", "face.sinew", "--json"))["findings"]
        self.assertEqual([f for f in findings if f["severity"] != "info"], [])
        poses = []
        for seconds in ("0.0166", "1"):
            run("simulate", "face.sinew", "--scene", "smile.json", "--seconds", seconds, "--export", "pose.obj", "--frame", "scene")
            poses.append([tuple(map(float, line.split()[1:4])) for line in (folder / "pose.obj").read_text().splitlines() if line.startswith("v ")])
        for side in (1, -1):
            corner = (side * 0.0241, 0.6203, 0.1306)
            v = min(range(len(poses[0])), key=lambda i: sum((a - b) ** 2 for a, b in zip(poses[0][i], corner)))
            x, y, _ = (b - a for a, b in zip(poses[0][v], poses[1][v]))
            self.assertGreater(side * x, 0.002)
            self.assertGreater(y, 0.002)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    options, rest = parser.parse_known_args()
    SINEW = str(pathlib.Path(options.sinew).resolve())
    unittest.main(argv=[sys.argv[0], *rest])
