#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""`sinew check` keeps its word: what it passes bakes, and what it does not pass does not bake. Draws recipes over small
meshes: settings within the ranges that the recipe's schema declares, clusters, pins, parts and thickness from drawn
selections. Seeds are fixed: a failure repeats, alone with --only. Standard library only.

    check_agrees_test.py --sinew PROGRAM [--rounds N] [--data DIR] [--only ROUND] [--keep DIR]
"""
import argparse
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
SLOWNESS = float(os.environ.get("SINEW_TEST_SLOWNESS", "1"))  # of this build
SECONDS = 120 * SLOWNESS
LARGEST = 1_500_000  # bytes of a mesh: the rounds are many
# Costs, not faults: a million vertices or 256 functions bake for minutes, and bounds on the import process fail it by
# chance.
MOST = {"tetrahedra.vertices": 5000, "field.functions": 48, "field.samples": 8, "field.points": 1024}
LEAST = {"import.memory_mb": 512, "import.seconds": 10}


def models(folders):
    endings = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".fbx", ".mesh"}
    found = {}
    for folder in folders:
        for file in sorted(folder.rglob("*")):
            if file.suffix in endings and "bad_input" not in file.parts and file.stat().st_size < LARGEST:
                found.setdefault(file.name, file)
    return [found[name] for name in sorted(found)]


def number(draw, low, high, default):
    """Ends, the default's neighbourhood, or any order of magnitude between."""
    kind = draw.random()
    if kind < 0.1:
        return draw.choice([low, high])
    if kind < 0.4 and default:
        return min(high, max(low, default * 10 ** draw.uniform(-1, 1)))
    if kind < 0.6:
        return draw.uniform(low, high)
    least = max(low, high * 1e-12)
    return least * (high / least) ** draw.random()


def value(draw, key, declared):
    if "enum" in declared:
        return draw.choice(declared["enum"])
    if "const" in declared:
        return declared["const"]
    if "anyOf" in declared:
        return value(draw, key, draw.choice(declared["anyOf"]))
    if declared.get("type") == "boolean":
        return draw.random() < 0.5
    if "minimum" in declared:
        low, high = max(declared["minimum"], LEAST.get(key, 0)), min(declared["maximum"], MOST.get(key, 1e300))
        drawn = number(draw, low, high, declared.get("default"))
        return round(drawn) if declared["type"] == "integer" else drawn
    if key.endswith("grid"):
        return draw.choice(["auto", [draw.randint(1, 64) for _ in range(3)]])
    if key.endswith("limit_curve"):
        return draw.choice(["", "4:4,9:5", "3:3,1000:3"])
    if key.endswith("unit"):
        return draw.choice(["auto", "m", "dm", "cm", "mm", "in", "ft", "1e-6", "1000", "1e9"])
    if key.endswith("up"):
        return draw.choice(["auto", "y", "z"])
    if key.endswith("front"):
        return draw.choice(["auto", "x", "-x", "y", "-y", "z", "-z"])
    if key.endswith("needs"):
        names = declared["pattern"].split("(")[2].split(")")[0].split("|")
        return draw.choice(["all", "none", ",".join(draw.sample(names, draw.randint(1, len(names))))])
    raise SystemExit(f"no way to draw {key}: {declared}")


def settings(draw, declared, most):
    return {key: value(draw, key, declared[key]) for key in draw.sample(sorted(declared), draw.randint(0, most))}


class Selections:
    def __init__(self, draw, about):
        self.draw = draw
        self.low, self.high = about["bounds"]["min"], about["bounds"]["max"]
        self.size = max(b - a for a, b in zip(self.low, self.high))
        self.groups = [group for mesh in about["meshes"] for group in mesh["groups"]]
        self.names = []

    def point(self):
        return [self.draw.uniform(a - 0.1 * self.size, b + 0.1 * self.size) for a, b in zip(self.low, self.high)]

    def length(self):
        return self.size * 10 ** self.draw.uniform(-1.5, 0.3)

    def one(self, depth=0):
        draw = self.draw
        if depth == 0 and draw.random() < 0.5:
            return {"or": [self.one(1), {"half_space": [(a + b) / 2 for a, b in zip(self.low, self.high)],
                                         "normal": [draw.gauss(0, 1) for _ in range(3)]}]}
        leaves = ["all", "half_space", "sphere", "box", "capsule", "part", "disc"] + ["group"] * (3 * bool(self.groups))
        leaves += ["name"] if self.names else []
        kind = draw.choice(leaves if depth == 2 else leaves + ["and", "or", "not", "minus", "soften", "grow", "shrink"])
        if kind == "all":
            return {"all": True}
        if kind == "name":
            return draw.choice(self.names)
        if kind == "group":
            return {"group": draw.choice(self.groups)}
        if kind == "half_space":
            return {"half_space": self.point(), "normal": [draw.gauss(0, 1) for _ in range(3)],
                    "falloff": draw.choice([0, self.length()])}
        if kind == "sphere":
            return {"sphere": self.point(), "radius": self.length(), "falloff": draw.choice([0, self.length()])}
        if kind == "box":
            a, b = self.point(), self.point()
            return {"box": [[min(p) for p in zip(a, b)], [max(p) for p in zip(a, b)]]}
        if kind == "capsule":
            return {"capsule": [self.point(), self.point()], "radius": self.length()}
        if kind == "disc":
            return {"disc": self.point(), "radius": self.length()}
        if kind == "part":
            return {"part": draw.choice([0, self.point(), self.point(), self.point()])}
        if kind in ("and", "or", "minus"):
            return {kind: [self.one(depth + 1) for _ in range(2)]}
        if kind == "not":
            return {"not": self.one(depth + 1)}
        return {kind: self.one(depth + 1), "by": self.length()}


def recipe(draw, schema, source, about):
    """What the drawn recipe holds."""
    whole = {"sinew_recipe": 2, "source": source}
    drawn = settings(draw, schema["settings"]["properties"], 6)
    if draw.random() < 0.3:
        drawn["tetrahedra.method"] = "shell"
    if draw.random() < 0.8:
        drawn.pop("import.unit", None)  # selections are drawn in the source's own
    drawn.setdefault("field.functions", 8)
    whole["settings"] = drawn
    selections = Selections(draw, about)
    if draw.random() < 0.5:
        whole["masks"] = {}
        for name in ("one", "two")[:draw.randint(1, 2)]:
            whole["masks"][name] = selections.one()
            selections.names.append(name)
    if draw.random() < 0.6:
        whole["clusters"] = []
        for i in range(draw.randint(1, 4)):
            cluster = {"name": f"cluster{i}", "from": selections.one()}
            if draw.random() < 0.6:
                cluster["settings"] = settings(draw, schema["cluster_settings"]["properties"], 4)
            if draw.random() < 0.3:
                cluster["overlap"] = draw.choice([0, selections.length()])
            kind = draw.random()
            if kind < 0.3:
                cluster["split"] = draw.uniform(0.05, 1) * selections.size
            elif kind < 0.6:
                cluster.update(channel=f"channel{i}", contraction=draw.uniform(0, 0.9))
            whole["clusters"].append(cluster)
    if draw.random() < 0.4:
        whole["pins"] = [{"name": f"pin{i}", "from": selections.one(), "target": draw.choice(["world", "cluster0", "x"])}
                         for i in range(draw.randint(1, 3))]
    for key, low, high in (("stiffness", 0, 1), ("thickness", 0.01, 100)):
        if draw.random() < 0.25:
            whole[key] = [{"from": selections.one(), "value": number(draw, low, high, 0.5)}]
    if draw.random() < 0.1:
        whole["parts"] = [{"name": "rider", "from": selections.one(), "attach": draw.choice(["rigid", "follow"])}]
    return whole


def run(*command):
    """exit code (None: not within time), stdout, stderr"""
    try:
        result = subprocess.run([str(c) for c in command], capture_output=True, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return None, "", "not within %d s" % SECONDS
    return result.returncode, result.stdout.decode("utf-8", "replace"), result.stderr.decode("utf-8", "replace")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True, type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--data", type=pathlib.Path, help="a folder of more meshes")
    parser.add_argument("--only", type=int, help="this round alone")
    parser.add_argument("--keep", type=pathlib.Path, help="where recipes that failed are kept")
    arguments = parser.parse_args()
    sinew = arguments.sinew.resolve()
    schema = json.loads(run(sinew, "help", "schema")[1])["$defs"]
    folders = [ROOT / "tests/assets", ROOT / "samples/assets"] + ([arguments.data] if arguments.data else [])
    bodies = models(folders)
    counts, failures, slowest = {True: 0, False: 0}, [], []
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        os.environ["XDG_CACHE_HOME"] = str(folder / "cache")
        about = {}
        for i in range(arguments.rounds) if arguments.only is None else [arguments.only]:
            draw = random.Random(i)
            model = draw.choice(bodies)
            copy = folder / f"source_{model.name}"
            if model not in about:
                copy.write_bytes(model.read_bytes())
                code, out, _ = run(sinew, "inspect", copy, "--json")
                # A source that cannot be opened has no bounds to draw in.
                about[model] = json.loads(out) if code == 0 else {"bounds": {"min": [0] * 3, "max": [1] * 3}, "meshes": []}
            file = folder / "recipe.json"
            file.write_text(json.dumps(recipe(draw, schema, copy.name, about[model]), indent=1))
            start = time.monotonic()
            check, out, check_error = run(sinew, "check", file, "--json")
            baked, _, bake_error = run(sinew, "bake", file, "-o", folder / "x.sinew", "--quiet")
            slowest.append((time.monotonic() - start, i, model.name))
            errors = [f["message"] for f in json.loads(out)["findings"] if f["severity"] == "error"] if check in (0, 1) else []
            fault = ""
            if check not in (0, 1, 2, 3) or baked not in (0, 2, 3):
                fault = "an exit code that no input may cause"
            elif (check == 0) != (baked == 0):
                fault = "check and bake disagree"
            counts[check == 0] += 1
            if fault:
                failures.append(i)
                print(f"round {i} ({model.name}): {fault}: check {check} {errors} {check_error.strip()[-300:]}, bake {baked} "
                      f"{bake_error.strip()[-300:]}", flush=True)
                if arguments.keep:
                    arguments.keep.mkdir(parents=True, exist_ok=True)
                    shutil.copy(file, arguments.keep / f"round{i}.json")
                    shutil.copy(copy, arguments.keep)
    print(f"{counts[True]} recipes passed and {counts[False]} refused, {len(failures)} failures {failures}; slowest:",
          ", ".join(f"{s:.1f} s round {i} ({name})" for s, i, name in sorted(slowest)[:-4:-1]))
    # Both verdicts have to occur, or agreement says nothing.
    if arguments.only is None and min(counts.values()) < arguments.rounds // 20:
        print("the draw is one-sided")
        return 1
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
