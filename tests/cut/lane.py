#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Bakes every mesh and recipe of folders and cuts it by random planes and quadrilaterals (cut_lane): closed, volumes and masses right, or refused.

    lane.py --sinew PROGRAM --lane CUT_LANE [--planes N] [--steps N] [--keep DIR] FOLDER...

N planes in all and as many that end, shared evenly by the packages. --keep: where packages stay, for the next time. Exit 1 on a fault.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

ENDINGS = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".fbx", ".mesh"}


def is_source(path):
    return (path.suffix in ENDINGS or path.name == "recipe.json") and "bad_input" not in path.parts


def bake_all(program, folders, into):
    packages = []
    for folder in folders:
        for mesh in sorted(p for p in pathlib.Path(folder).rglob("*") if is_source(p)):
            package = into / f"{mesh.parent.name if mesh.stem == 'recipe' else mesh.stem}_{mesh.suffix[1:]}.sinew"
            if not package.exists():
                # What cannot be baked is judged by other tests.
                subprocess.run([program, "bake", str(mesh), "-o", str(package)], capture_output=True, check=False)
            if package.exists():
                packages.append(package)
    return packages


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--lane", required=True)
    parser.add_argument("--planes", type=int, default=300)
    parser.add_argument("--steps", type=int, default=0)
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("folders", nargs="+")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        into = options.keep or pathlib.Path(temporary)
        into.mkdir(parents=True, exist_ok=True)
        packages = bake_all(options.sinew, options.folders, into)
        if not packages:
            sys.exit("no mesh could be baked")
        each = -(-options.planes // len(packages))
        steps = ["--steps", str(options.steps)] if options.steps else []
        codes = [
            subprocess.run([options.lane, *steps, *slits, str(each), *map(str, packages)], check=False).returncode
            for slits in ([], ["--slits"])
        ]
        sys.exit(max(codes))


if __name__ == "__main__":
    main()
