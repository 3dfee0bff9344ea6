#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes skin_patch.obj: a flat square sheet, its outside up. Metres.

python3 make.py > skin_patch.obj"""

SIDE, CELLS = 1.0, 36


def main():
    lines = ["# made by make.py, CC0", "o skin_patch"]
    steps = range(CELLS + 1)
    lines += ["v %.6f 0 %.6f" % (SIDE * (i / CELLS - 0.5), SIDE * (j / CELLS - 0.5)) for j in steps for i in steps]
    at = lambda i, j: j * (CELLS + 1) + i + 1  # noqa: E731
    lines += ["f %d %d %d %d" % (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j))
              for j in range(CELLS) for i in range(CELLS)]
    print("\n".join(lines))


if __name__ == "__main__":
    main()
