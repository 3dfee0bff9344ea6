#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Holds the recipe's JSON Schema (`sinew help schema`) against the program, by a validator that knows nothing of it: all
recipes of the samples and all examples of docs/recipe-format.md pass both; recipes that are wrong in a key, a type or a
number are refused by both or by none. Seeds are fixed: a failure repeats. Needs python3-jsonschema.

    schema_test.py --sinew PROGRAM [--wrong N]
"""
import argparse
import copy
import json
import pathlib
import random
import subprocess
import sys
import tempfile

import jsonschema

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Of its words the program's complaints about what no schema knows: which names there are, and files.
BEYOND_A_SCHEMA = ("named", "direction that is not zero", "project")


def sample_recipes():
    found = []
    for file in sorted((ROOT / "samples").rglob("*.json")):
        value = json.loads(file.read_text())
        if isinstance(value, dict) and "sinew_recipe" in value:
            found.append((str(file.relative_to(ROOT)), value))
    return found


def example_recipes(schema):
    """Every example of docs/recipe-format.md in a recipe: a selection as a mask, an object in its list."""
    lists = {}
    for key, value in schema["$defs"]["recipe"]["properties"].items():
        if value.get("type") == "array":
            lists[value["items"]["$ref"].rsplit("/", 1)[1]] = key
    found, heading = [], ""
    for line in (ROOT / "docs/recipe-format.md").read_text().splitlines():
        heading = line if line.startswith("#") else heading
        if not line.startswith("{"):
            continue
        example, kind = json.loads(line), heading.split()[-1]
        recipe = {"sinew_recipe": 3, "source": "a.obj"}
        if "sinew_recipe" in example:
            recipe = example
        elif kind in lists:
            recipe[lists[kind]] = [example]
        else:
            recipe["masks"] = {"m": example}
        found.append((f"docs/recipe-format.md, {heading}", recipe))
    return found


def places(value, at=()):
    """All places below a value, as tuples of keys and numbers."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield at + (key,)
        yield from places(inner, at + (key,))


def parent_of(recipe, place):
    for key in place[:-1]:
        recipe = recipe[key]
    return recipe


def wronged(random_, recipe, settings):
    """A copy with one thing changed that may well be wrong, and what that was."""
    recipe = copy.deepcopy(recipe)
    place = random_.choice([p for p in places(recipe) if p not in (("sinew_recipe",), ("source",))])
    parent, key = parent_of(recipe, place), place[-1]
    edit = random_.randrange(7)
    if edit == 0 and isinstance(key, str):
        parent[key[:-1] + "?"] = parent.pop(key)
    elif edit == 1 and isinstance(parent, dict):
        del parent[key]
    elif edit == 2:
        parent[key] = random_.choice([None, True, -1e30, 1e30, "", "xyz", [], {}, [1, 2], {"a": 1}, 0.5])
    elif edit == 3 and isinstance(parent[key], dict):
        parent[key]["unknown"] = 1
    elif edit == 4 and isinstance(parent[key], (int, float)):
        parent[key] = -parent[key] - 1e4
    elif edit == 5:
        parent[key] = [parent[key]]
    else:
        name = random_.choice(sorted(settings))
        place = ("settings", name)
        recipe.setdefault("settings", {})[name] = random_.choice(
            [None, True, "on", 1, "1", -1, 1e13, 0.3, [1, 2, 3], [0, 1, 2], [1, 2], "2,2,2", "auto", "", "x", "mm", {}])
    return recipe, place


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--sinew", required=True)
    parser.add_argument("--wrong", type=int, default=120)
    arguments = parser.parse_args()
    schema = json.loads(subprocess.run([arguments.sinew, "help", "schema"], stdout=subprocess.PIPE, check=True).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    failures = []

    def by_schema(recipe):
        error = next(iter(validator.iter_errors(recipe)), None)
        return "" if error is None else f"{error.json_path}: {error.message[:200]}"

    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "r.json"

        def by_program(recipe):
            """Its complaint; the command reads the recipe, and no source."""
            file.write_text(json.dumps(recipe))
            done = subprocess.run([arguments.sinew, "author", str(file), "set", "/note=read"], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True, check=False)
            if done.returncode not in (0, 3):
                failures.append(f"exit {done.returncode} on {json.dumps(recipe)}")
            return "" if done.returncode == 0 else done.stderr.strip()

        right = sample_recipes() + example_recipes(schema)
        for name, recipe in right:
            for who, said in (("schema", by_schema(recipe)), ("program", by_program(recipe))):
                if said:
                    failures.append(f"{name}: refused by the {who}: {said}")

        random_ = random.Random(7)
        settings = schema["$defs"]["settings"]["properties"]
        both, tried = 0, 0
        while both < arguments.wrong and tried < 6 * arguments.wrong:
            tried += 1
            name, recipe = random_.choice(right)
            wrong, place = wronged(random_, recipe, settings)
            schema_says, program_says = by_schema(wrong), by_program(wrong)
            if bool(schema_says) == bool(program_says):
                both += bool(schema_says)
            elif not any(word in program_says for word in BEYOND_A_SCHEMA):
                failures.append(f"{name} changed at {place}: schema: {schema_says or 'fine'}; program: "
                                f"{program_says or 'fine'}\n    {json.dumps(wrong)[:600]}")
        if both < 100:
            failures.append(f"only {both} of {tried} recipes were wrong")
    for failure in failures:
        print("FAIL", failure)
    print(f"{len(right)} right recipes, {both} of {tried} changed ones refused by both, {len(failures)} failures")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
