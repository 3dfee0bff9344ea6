#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""inspect_agrees_test.py SINEW: the program and the Python reader say the same of the golden packages."""
import json
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import read_package  # noqa: E402

GOLDEN = [os.path.join(HERE, "golden", name + "_v2.sinew") for name in ("sample", "mechanics", "fields")]


def main():
    differing = 0
    for path in GOLDEN:
        printed = subprocess.run([sys.argv[1], "inspect", path, "--json"], capture_output=True, text=True, check=True)
        of_program = json.loads(printed.stdout)
        with open(path, "rb") as file:
            of_reader = read_package.Package(file.read()).summary()
        for key, value in of_reader.items():
            if of_program.get(key) != value:
                differing += 1
                print(f"{path}: {key}: sinew says {of_program.get(key)}, read_package.py says {value}", file=sys.stderr)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
