#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Writes l_bar.obj: an L of two arms with a rounded square section, bent to a quarter circle, as one closed tube.
Metres. All rounding is in steps of 7.5 degrees, so that is the angle between neighbouring faces, around and along.

python3 make.py > l_bar.obj"""
import math

HALF, ROUND = 0.15, 0.08   # half width and edge radius of the section
ARM, BEND = 0.9, 0.3       # length from the corner of the centre lines, radius of the centre line's bend
STEPS = 12                 # of a quarter turn
RING = 0.04                # distance of rings along the arms
FLAT = 3                   # pieces of a flat side
CAP = 0.85                 # of the section: a ring on the end faces, so that shading turns evenly there


def section():
    """Points of the section, counter-clockwise."""
    for side in range(4):
        points = [(HALF, (2 * k / FLAT - 1) * (HALF - ROUND)) for k in range(FLAT)]
        points += [(HALF - ROUND + ROUND * math.cos(t), HALF - ROUND + ROUND * math.sin(t))
                   for t in (0.5 * math.pi * k / STEPS for k in range(STEPS))]
        for x, y in points:
            for _ in range(side):
                x, y = -y, x
            yield x, y


def path():
    """Places on the centre line with the direction across it that points out of the bend; its corner is the origin."""
    straight = ARM - BEND
    n = round(straight / RING)
    for i in range(n):
        yield ARM - i * straight / n, 0.0, 0.0, -1.0
    for i in range(STEPS + 1):
        t = 0.5 * math.pi * i / STEPS
        yield BEND - BEND * math.sin(t), BEND - BEND * math.cos(t), -math.sin(t), -math.cos(t)
    for i in range(1, n + 1):
        yield 0.0, BEND + i * straight / n, -1.0, 0.0


def main():
    lines = ["# made by make.py, CC0", "o l_bar"]
    places = [(place, 1.0) for place in path()]
    places = [(places[0][0], CAP)] + places + [(places[-1][0], CAP)]
    for (x, y, nx, ny), scale in places:
        lines += ["v %.6f %.6f %.6f" % (x + scale * a * nx, y + scale * a * ny, scale * b) for a, b in section()]
    around, rings = 4 * (FLAT + STEPS), len(places)
    at = lambda ring, i: ring * around + i % around + 1  # noqa: E731
    for ring in range(rings - 1):
        lines += ["f %d %d %d %d" % (at(ring, i), at(ring, i + 1), at(ring + 1, i + 1), at(ring + 1, i))
                  for i in range(around)]
    lines.append("f " + " ".join(str(at(0, i)) for i in reversed(range(around))))
    lines.append("f " + " ".join(str(at(rings - 1, i)) for i in range(around)))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
