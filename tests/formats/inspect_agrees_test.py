#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""inspect_agrees_test.py SINEW: the program and the Python reader say the same of the golden package."""
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import read_package  # noqa: E402

GOLDEN = os.path.join(HERE, "golden", "sample_v1.sinew")


def main():
    printed = subprocess.run([sys.argv[1], "inspect", GOLDEN, "--json"], capture_output=True, text=True, check=True)
    of_program = json.loads(printed.stdout)
    with open(GOLDEN, "rb") as file:
        of_reader = read_package.Package(file.read()).summary()
    differing = [key for key, value in of_reader.items() if of_program.get(key) != value]
    for key in differing:
        print(f"{key}: sinew says {of_program.get(key)}, read_package.py says {of_reader[key]}", file=sys.stderr)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
