#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""inspect_agrees_test.py SINEW: the program and the Python reader say the same of the golden packages, and
refuse and open the same of such with changed numbers under right checksums."""
import json
import os
import random
import struct
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import read_package  # noqa: E402
import read_package_test  # noqa: E402

GOLDEN = [os.path.join(HERE, "golden", name + "_v3.sinew") for name in ("sample", "mechanics", "fields")]


def changed(data, random_):
    """One or two numbers behind the table: other bits, another sign, another size."""
    data, start = bytearray(data), 64 + 64 * len(read_package_test.entries(data))
    for _ in range(random_.choice((1, 2))):
        at = start + 4 * random_.randrange((len(data) - start) // 4)
        word = struct.unpack_from("<I", data, at)[0]
        size = random_.randrange(256) << 23
        word = random_.choice((word ^ 1 << random_.randrange(32), word ^ 1 << 31, word & 0x807FFFFF | size, random_.getrandbits(32)))
        struct.pack_into("<I", data, at, word)
    read_package_test.reseal(data)
    return bytes(data)


def differing_of_changed(program, path, rounds):
    random_, opened, differing = random.Random(7), 0, 0
    with open(path, "rb") as file:
        sound = file.read()
    with tempfile.TemporaryDirectory() as folder:
        other = os.path.join(folder, "changed.sinew")
        for _ in range(rounds):
            data = changed(sound, random_)
            with open(other, "wb") as file:
                file.write(data)
            printed = subprocess.run([program, "inspect", other, "--json"], capture_output=True, text=True, check=False)
            reason = read_package_test.reason_of(data)
            opened += reason == ""
            if (printed.returncode == 0) != (reason == ""):
                differing += 1
                print(f"{path}, changed: sinew says {printed.stderr or 'nothing'}, read_package.py says {reason or 'nothing'}", file=sys.stderr)
    if not rounds / 25 < opened < rounds * 0.9:
        sys.exit(f"{path}: {opened} of {rounds} changed packages open: nothing is tested")
    return differing


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
        differing += differing_of_changed(sys.argv[1], path, 100)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
