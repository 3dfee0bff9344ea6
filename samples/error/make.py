#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes bar.obj, cube.obj and skin_patch.obj: boxes evenly meshed, the bar along z. Metres.

python3 make.py"""

BOXES = {  # cells along x, y, z, and their sizes
    "bar": ((3, 3, 12), (0.05, 0.05, 0.05)),
    "cube": ((5, 5, 5), (0.05, 0.05, 0.05)),
    "skin_patch": ((24, 1, 24), (1 / 24, 0.06, 1 / 24)),
}


def box(cells):
    """Faces by their corners, whole numbers of cells, outside first."""
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cells[axis]):
            for i in range(cells[u]):
                for j in range(cells[v]):
                    face = []
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        corner = [0, 0, 0]
                        corner[axis], corner[u], corner[v] = side, i + a, j + b
                        face.append(tuple(corner))
                    yield face if side else face[::-1]


def main():
    for name, (cells, sizes) in BOXES.items():
        faces = list(box(cells))
        numbers = {corner: i + 1 for i, corner in enumerate(sorted({c for face in faces for c in face}))}
        lines = ["# made by make.py, CC0", "o " + name]
        lines += ["v %g %g %g" % tuple(size * (x - n / 2) for size, x, n in zip(sizes, corner, cells)) for corner in numbers]
        lines += ["f %d %d %d %d" % tuple(numbers[c] for c in face) for face in faces]
        with open(name + ".obj", "w") as file:
            file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
