#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the Python reader on the golden package and on broken variants of it."""
import json
import os
import struct
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import read_package  # noqa: E402

GOLDEN = os.path.join(HERE, "golden", "sample_v3.sinew")
MECHANICS = os.path.join(HERE, "golden", "mechanics_v3.sinew")
FIELDS = os.path.join(HERE, "golden", "fields_v3.sinew")
OLD = [os.path.join(HERE, "golden", f"sample_v{version}.sinew") for version in (1, 2)]  # as those versions had it
EXPECTED = os.path.join(HERE, "golden", "sample_v3.json")


def golden():
    with open(GOLDEN, "rb") as file:
        return bytearray(file.read())


def entries(data):
    count = struct.unpack_from("<I", data, 32)[0]
    return [64 + 64 * i for i in range(count)]


def reseal(data):
    for at in entries(data):
        offset, size = struct.unpack_from("<QQ", data, at + 8)
        struct.pack_into("<Q", data, at + 40, read_package.xxh3(bytes(data[offset:offset + (size + 63) // 64 * 64])))
    struct.pack_into("<Q", data, 40, 0)
    end = 64 + 64 * len(entries(data))
    struct.pack_into("<Q", data, 40, read_package.xxh3(bytes(data[:end])))


def entry_of(data, name):
    return next(at for at in entries(data) if data[at:at + 4] == name)


def start_of(data, name):
    return struct.unpack_from("<Q", data, entry_of(data, name) + 8)[0]


def without(data, names):
    """The package less some sections; the feature bits that go with them are cleared."""
    parts, features = [], struct.unpack_from("<Q", data, 16)[0]
    for at in entries(data):
        offset, size = struct.unpack_from("<QQ", data, at + 8)
        if data[at:at + 4] not in names:
            parts.append((bytearray(data[at:at + 64]), data[offset:offset + (size + 63) // 64 * 64]))
        elif (bit := read_package.SECTIONS[data[at:at + 4].decode()][3]) is not None:
            features &= ~(1 << bit)
    end = 64 + 64 * len(parts)
    for entry, part in parts:
        struct.pack_into("<Q", entry, 8, end)
        end += len(part)
    header = bytearray(data[:64])
    struct.pack_into("<QQI", header, 16, features, end, len(parts))
    result = header + b"".join(entry for entry, _ in parts) + b"".join(part for _, part in parts)
    reseal(result)
    return result


def reason_of(data):
    try:
        read_package.Package(bytes(data))
    except read_package.Refused as refused:
        return str(refused)
    return ""


class Checksum(unittest.TestCase):
    def test_every_length_class(self):
        with open(os.path.join(HERE, "golden", "xxh3.txt"), encoding="ascii") as file:
            lines = file.read().split("\n")[:-1]
        self.assertGreater(len(lines), 250)
        for line in lines:
            size, value = line.split()
            data = bytes(i * 131 % 251 for i in range(int(size)))
            self.assertEqual(f"{read_package.xxh3(data):016x}", value, f"of {size} bytes")


class Reader(unittest.TestCase):
    def run_reader(self, data):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a.sinew")
            with open(path, "wb") as file:
                file.write(data)
            return subprocess.run([sys.executable, os.path.join(HERE, "read_package.py"), path], capture_output=True,
                                  text=True, check=False)

    def test_golden_values(self):
        result = self.run_reader(golden())
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(EXPECTED, encoding="utf-8") as file:
            self.assertEqual(json.loads(result.stdout), json.load(file))

    def test_packed_values_are_those_unpacked(self):
        for name, plain in (("sample_packed", GOLDEN), ("fields_packed", FIELDS)):
            with open(os.path.join(HERE, "golden", name + "_v3.sinew"), "rb") as file:
                packed = read_package.Package(file.read())
            with open(plain, "rb") as file:
                package = read_package.Package(file.read())
            self.assertLess(packed.bytes, package.bytes)
            for section, records in package.records.items():
                self.assertEqual(len(packed.records[section]), len(records))
                block = read_package.PACKINGS.get(section, (0, 0, 0))[2]
                for one, other in zip(packed.records[section], records):
                    exact = len(other) - block  # infinite numbers among them
                    self.assertEqual(one[:exact], other[:exact], section)
                    bound = max(map(abs, other[exact:]), default=0) / 2**15
                    self.assertTrue(all(abs(a - b) <= bound for a, b in zip(one[exact:], other[exact:])), section)

    def test_program_refuses_with_exit_3_and_one_line(self):
        cut, flipped, appended, version = golden()[:-1], golden(), golden() + b"\0", golden()
        flipped[2000] ^= 1
        version[8] = 4
        for data in (b"", cut, flipped, appended, version):
            result = self.run_reader(data)
            self.assertEqual(result.returncode, 3)
            self.assertEqual(result.stdout, "")
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)

    def test_refuses_older_versions(self):
        for version, name in enumerate(OLD, 1):
            with open(name, "rb") as file:
                old = file.read()
            self.assertEqual(struct.unpack_from("<I", old, 8)[0], version)
            self.assertEqual(reason_of(old), f"format version {version}, this reader reads version 3: bake the package again")

    def test_refuses_every_cut(self):
        data = golden()
        for size in range(len(data)):
            self.assertNotEqual(reason_of(data[:size]), "", f"cut at {size}")

    def test_refuses_every_changed_byte(self):
        data = golden()
        for at in range(len(data)):
            data[at] ^= 0x80 if at % 2 else 0x01
            self.assertNotEqual(reason_of(data), "", f"byte {at}")
            data[at] ^= 0x80 if at % 2 else 0x01

    def test_refuses_broken_rules_under_right_checksums(self):
        nan = b"\0\0\xc0\x7f"
        none = b"\xff\xff\xff\xff"
        # (section, byte within it, new bytes): one of each kind of rule
        faults = [
            (b"INFO", 24, bytes(8)), (b"INFO", 56, nan), (b"INFO", 92, b"\1"), (b"INFO", 96, none),
            (b"BODY", 0, b"\1"), (b"BODY", 4, b"\4"), (b"BODY", 20, b"\1"), (b"PVTX", 4, nan), (b"PVTX", 12, bytes(4)),
            (b"TETS", 0, b"\5"), (b"TETS", 0, b"\1"), (b"CLUS", 8, b"\3"), (b"CLUS", 12, b"\1"), (b"CLUS", 16, b"\1"),
            (b"CLUS", 20, bytes(4)), (b"CLUS", 36, bytes(4)), (b"CLUS", 48, nan), (b"CLUS", 60, bytes(4)),
            (b"CLUS", 64, nan), (b"MEMB", 0, b"\1"), (b"MEMB", 4, nan), (b"MEMB", 8, bytes(4)), (b"AQQ9", 176, nan),
            (b"VPOS", 0, nan), (b"VNRM", 8, nan), (b"VUV0", 4, nan), (b"VTRI", 0, b"\6"), (b"VSUB", 8, b"\2"),
            (b"VSUB", 12, b"\1"), (b"VMAT", 8, nan), (b"VMAT", 24, b"\1"), (b"VMAT", 28, b"\2"), (b"VTEX", 16, b"\1"),
            (b"VTEX", 24, b"\1"), (b"ATBC", 0, b"\2"), (b"ATBC", 4, nan), (b"ATCR", 4, bytes(4)), (b"ATCW", 0, b"\2"),
            (b"ATCW", 4, nan), (b"VSRC", 0, b"\1"), (b"VSRC", 4, b"\6"), (b"SVTX", 0, b"\1"), (b"SVTX", 8, b"\2"),
            (b"SVLS", 0, b"\6"), (b"SMSH", 12, b"\5"), (b"GRUP", 12, b"\1"), (b"GRPV", 0, b"\5"),
        ]
        for name, offset, new in faults:
            data = golden()
            at = start_of(data, name) + offset
            self.assertNotEqual(data[at:at + len(new)], new)
            data[at:at + len(new)] = new
            reseal(data)
            self.assertNotEqual(reason_of(data), "", f"{name} byte {offset}")

    def test_numbers_are_bounded_by_what_the_package_states(self):
        # (section, byte within it, layout, new value, what is said): finite, and refused
        faults = [
            ("INFO", 0, "d", 1.1e15, "origin"), ("INFO", 24, "d", 1.1e18, "metres_per_unit"), ("INFO", 44, "f", 1.1e15, "bounds"),
            ("INFO", 56, "f", 1e3, "diagonal"), ("INFO", 60, "f", 6.1, "total_mass"), ("INFO", 64, "f", 1.1e18, "density"),
            ("INFO", 68, "f", 1.1e18, "physical_volume"), ("INFO", 72, "f", -1.1e18, "source_volume"),
            ("INFO", 76, "f", 1.1e18, "max_rest_error"), ("PVTX", 0, "f", 1e20, "rest_position"), ("PVTX", 12, "f", 1e3, "total_mass"),
            ("CLUS", 24, "f", 1e3, "rest_center"), ("CLUS", 36, "f", 1e3, "radius"), ("CLUS", 36, "f", 0.1, "outside the radius"),
            ("CLUS", 40, "f", 1e3, "mass"), ("CLUS", 52, "f", 1.1e18, "frequency"), 
            ("CLUS", 64, "f", 1.1e12, "a_qq"), ("CLUS", 64, "f", 1e5, "inverse"), ("AQQ9", 176, "f", 1.1e12, "inverse"),
            ("AQQ9", 176, "f", 1e6, "inverse"), ("VPOS", 4, "f", -1e3, "VPOS"), ("VNRM", 4, "f", 1.01, "VNRM"), ("VUV0", 4, "f", 1.1e9, "VUV0"),
            ("ATBC", 8, "f", 1.1e6, "ATBC"), ("ATCW", 4, "f", -0.1, "ATCW"),
        ]
        for name, offset, layout, value, reason in faults:
            data = golden()
            struct.pack_into("<" + layout, data, start_of(data, name.encode()) + offset, value)
            reseal(data)
            self.assertIn(reason, reason_of(data), f"{name} byte {offset}")
        with open(FIELDS, "rb") as file:
            sound = file.read()
        for name, offset in (("FPAK", 96), ("FPNT", 4)):
            data = bytearray(sound)
            struct.pack_into("<f", data, start_of(data, name.encode()) + offset, -1e3)
            reseal(data)
            self.assertIn(name + ", element 0", reason_of(data))

    def test_tethers_are_positive(self):
        def positive(matrix):
            return read_package.positive(matrix, [row[i] ** 0.5 for i, row in enumerate(matrix)])

        self.assertTrue(positive([[4, 2], [2, 1]]))
        self.assertTrue(positive([[4, 2.0001], [2.0001, 1]]))  # rounding
        self.assertFalse(positive([[4, 2.01], [2.01, 1]]))
        self.assertTrue(positive([[0, 0], [0, 1]]))
        self.assertFalse(positive([[0, 1e-6], [1e-6, 1]]))
        self.assertFalse(positive([[1, 0.9, 0], [0.9, 1, 0.9], [0, 0.9, 1]]))

    def test_mechanics(self):
        with open(MECHANICS, "rb") as file:
            sound = file.read()
        package = read_package.Package(sound)
        self.assertEqual(package.summary()["features"][-4:],
                         ["mechanics", "activation", "vertex_stiffness", "pin_weights"])
        self.assertEqual([package.text(*c) for c in package.records["CHAN"]], ["frown", "smile"])
        self.assertEqual(package.records["CMEC"][1][1:4], (0, 0.5, 1))
        nan, one = b"\0\0\xc0\x7f", b"\1\0\0\0"
        faults = [(b"CMEC", 0, b"\3"), (b"CMEC", 4, nan), (b"CMEC", 16, nan), (b"CMEC", 20, b"\0\0\0\x3f"),
                  (b"CMEC", 24, nan), (b"CMEC", 28, b"\7"), (b"CMEC", 32, bytes(4)), (b"CMEC", 36, nan),
                  (b"CMEC", 40, nan), (b"CMEC", 44, nan), (b"CMEC", 48, one), (b"CMEC", 52, one), (b"CMEC", 56, b"\3"),
                  (b"CMEC", 60, nan), (b"CMEC", 64, nan), (b"CMEC", 68, nan), (b"CMEC", 72, b"\0\0\x80\x3f"),
                  (b"CMEC", 84, b"\2"), (b"CMEC", 88, nan), (b"CMEC", 92, one), (b"CMEC", 96 + 52, one),
                  (b"CMEC", 96 + 48, b"\2"), (b"CURV", 12, b"\0\0\x60\x40"), (b"CURV", 24, nan), (b"CHAN", 4, nan),
                  (b"PSTF", 0, nan), (b"PPIN", 0, nan)]
        for name, offset, new in faults:
            data = bytearray(sound)
            at = start_of(data, name) + offset
            data[at:at + len(new)] = new
            reseal(data)
            self.assertNotEqual(reason_of(data), "", f"{name} byte {offset}")

    def test_fields(self):
        with open(FIELDS, "rb") as file:
            sound = file.read()
        package = read_package.Package(sound)
        summary = package.summary()
        self.assertEqual(summary["features"][-1], "fields")
        self.assertEqual([(f["held"], f["functions"], f["driven"], f["samples"]) for f in summary["fields"]],
                         [(False, 4, 0, 2), (True, 5, 4, 2)])
        # The formula of the page: the fourth vertex of the held field, its pin set moved by (0, 7, 0), turned about x
        # by a quarter.
        k, first = 5, package.records["FELD"][1][8]
        rows = [(0, 7, 0), (1, 0, 0), (0, 0, 1), (0, -1, 0)]
        inner = package.records["FFUN"][8]
        rows.append([inner[2] * (0, 7, 0)[c] + sum(inner[3 + a] * rows[1 + a][c] for a in range(3)) for c in range(3)])
        phi = [package.records["FVAL"][first + j][3] for j in range(k)]
        place = [sum(p * z[c] for p, z in zip(phi, rows)) for c in range(3)]
        for found, wanted in zip(place, (0, 6, 0)):  # of (0, 0, 1)
            self.assertAlmostEqual(found, wanted, places=5)
        # The fibre of "lower" in that field, turned along: of (0, 0.6, 0.8).
        _, cluster, first, tension = package.records["FFIB"][2]
        stretch = [sum(package.records["FFBV"][first + j][0] * z[c] for j, z in enumerate(rows)) for c in range(3)]
        for found, wanted in zip(stretch, (0, -0.8, 0.6)):
            self.assertAlmostEqual(found, wanted, places=5)
        self.assertEqual([package.records["FPAK"][p][48:51] for p in (0, 1)], [(0, read_package.NONE, read_package.NONE)] * 2)
        self.assertEqual(cluster, 0)
        self.assertAlmostEqual(tension, 0.375 * 2600 * (1 / 9 + 1 / 6), places=3)
        # The tethers of that field tie vertices 3 and 4 to the set, by 40 and 90 N/m: nothing as it is turned, and what two
        # springs have when the inner function moves alone.
        field, first = package.records["FTHR"][0]
        self.assertEqual((field, first, len(package.records["FTHV"])), (1, 0, k * k))
        t = [[v for v, in package.records["FTHV"][k * a:k * a + k]] for a in range(k)]
        for row in t:
            for c in range(3):
                self.assertAlmostEqual(sum(v * z[c] for v, z in zip(row, rows)), 0, places=3)
        held = package.records["FELD"][1][8]
        springs = sum(kappa * package.records["FVAL"][held + 4][v] ** 2 for v, kappa in ((3, 40), (4, 90)))
        self.assertAlmostEqual(t[4][4], springs, places=4)
        decays = [f[8] for f in package.records["FFUN"]]
        self.assertEqual(decays[4:8], [0] * 4)
        self.assertTrue(all(d > 0 for d in decays[:4] + decays[8:]))
        nan, one, tiny, none = b"\0\0\xc0\x7f", b"\1\0\0\0", b"\0\0\0\x0d", b"\xff\xff\xff\xff"
        negative, half = b"\0\0\x80\xbf", b"\0\0\0\x3f"
        faults = [(b"FELD", 0, one), (b"FELD", 4, one), (b"FELD", 8, bytes(4)), (b"FELD", 12, b"\4"), (b"FELD", 16, one),
                  (b"FELD", 20, one), (b"FELD", 24, bytes(4)), (b"FELD", 28, one), (b"FELD", 32, one),
                  (b"FELD", 36, one), (b"FELD", 40, one), (b"FELD", 44, one), (b"FELD", 48, one),
                  (b"FELD", 52, negative), (b"FELD", 56, nan), (b"FELD", 60, nan), (b"FELD", 64, one),
                  (b"FELD", 64 + 4, b"\2"), (b"FELD", 64 + 12, bytes(4)), (b"FELD", 64 + 12, b"\3"),
                  (b"FFUN", 0, negative), (b"FFUN", 4, nan), (b"FFUN", 8, half), (b"FFUN", 12, half),
                  (b"FFUN", 24, one), (b"FFUN", 28, one), (b"FFUN", 4 * 36 + 24, b"\2"), (b"FFUN", 5 * 36 + 24, bytes(4)),
                  (b"FFUN", 5 * 36 + 28, b"\2"), (b"FFUN", 8 * 36 + 24, one), (b"FPAK", 0, negative), (b"FPAK", 8, one),
                  (b"FPAK", 32, nan), (b"FPAK", 40, one), (b"FPAK", 64, negative), (b"FPAK", 96, nan),
                  (b"FPAK", 96 + 8, one), (b"FGRD", 0, half), (b"FGRD", 96, nan), (b"FGRD", 4 * 32 + 8, tiny),
                  (b"FVAL", 0, nan), (b"FVAL", 4, half), (b"FVAL", 32 + 20, tiny), (b"FPNT", 0, half),
                  (b"FPNT", 12, bytes(4)), (b"FPTV", 4, half), (b"FPTV", 4 * 32 + 4, tiny), (b"FMOD", 0, negative), (b"FMOD", 32, half),
                  (b"FMOD", 36, nan), (b"FMOD", 13 * 32 + 16, tiny),
                  (b"FFUN", 32, negative), (b"FFUN", 4 * 36 + 32, nan), (b"FPAK", 192, b"\2"), (b"FPAK", 192 + 8, bytes(4)),
                  (b"FPAK", 224 + 192 + 4, b"\xfe"), (b"FPAK", 224 + 192 + 28, one),
                  (b"FFIB", 0, b"\2"), (b"FFIB", 0, none), (b"FFIB", 0, one), (b"FFIB", 4, b"\2"), (b"FFIB", 4, none),
                  (b"FFIB", 8, one), (b"FFIB", 12, negative), (b"FFIB", 12, nan), (b"FFIB", 16 + 4, bytes(4)),
                  (b"FFIB", 16 + 8, bytes(4)), (b"FFIB", 2 * 16, bytes(4)), (b"FFIB", 2 * 16 + 4, one),
                  (b"FFBV", 0, nan), (b"FFBV", 0, half), (b"FFBV", 5 * 4, half), (b"FFBV", 8 * 4, half),
                  (b"FFBV", 12 * 4, nan), (b"CMEC", 72, bytes(12)), (b"CMEC", 76, b"\0\0\x80\x3f" + bytes(4)),
                  (b"CMEC", 84, none), (b"CMEC", 96 + 84, none),
                  (b"FTHR", 0, bytes(4)), (b"FTHR", 0, b"\2"), (b"FTHR", 0, none), (b"FTHR", 4, one),
                  (b"FTHV", 0, nan), (b"FTHV", 0, negative), (b"FTHV", 24 * 4, negative), (b"FTHV", 24 * 4, half),
                  (b"FTHV", 6 * 4, b"\0\0\x80\x7f"), (b"FTHV", 4, half), (b"FTHV", 23 * 4, nan),
                  (b"FTHV", 9 * 4, negative), (b"FTHV", 18 * 4, b"\0\0\xc0\x5f")]
        for name, offset, new in faults:
            data = bytearray(sound)
            at = start_of(data, name) + offset
            self.assertNotEqual(data[at:at + len(new)], new, f"{name} byte {offset}")
            data[at:at + len(new)] = new
            reseal(data)
            self.assertNotEqual(reason_of(data), "", f"{name} byte {offset}")

    def test_fields_without_what_they_name(self):
        with open(FIELDS, "rb") as file:
            sound = file.read()
        read_package.Package(sound)
        for names, reason in (((b"CMEC",), "section FPAK"), ((b"FFIB",), "section FFBV: needs section FFIB"),
                              ((b"FFBV",), "section FFIB"), ((b"FTHR",), "section FTHV: needs section FTHR"),
                              ((b"FTHV",), "section FTHR")):
            data = without(sound, names)
            self.assertIn(reason, reason_of(data))
        self.assertEqual(reason_of(without(sound, (b"FFIB", b"FFBV"))), "")
        self.assertEqual(reason_of(without(sound, (b"FTHR", b"FTHV"))), "")

    def test_tethers_that_pull_at_the_rest_shape(self):
        with open(FIELDS, "rb") as file:
            sound = file.read()
        at = start_of(sound, b"FTHV")

        def changed(change):
            data = bytearray(sound)
            values = list(struct.unpack_from("<25f", data, at))
            change(values)
            struct.pack_into("<25f", data, at, *values)
            reseal(data)
            return reason_of(data)

        def scale(values, where, factor):
            for i in where:
                values[i] *= factor

        self.assertEqual(changed(lambda v: None), "")
        self.assertEqual(changed(lambda v: scale(v, range(25), 3)), "")
        self.assertEqual(changed(lambda v: scale(v, range(25), 0)), "")
        for where in ((0,), (6,), (12,), (18,), (24,), (1, 5), (14, 22), (19, 23)):  # alike on both sides
            self.assertIn("pulls at the rest shape", changed(lambda v, w=where: scale(v, w, 1.01)), where)
        for where in ((4,), (5,), (23,)):  # on one side, less than what would pull
            self.assertIn("a value", changed(lambda v, w=where: scale(v, w, 1.00001)), where)
        self.assertIn("a value", changed(lambda v: scale(v, range(25), -1)))

    def test_fibre_in_two_parts(self):
        with open(FIELDS, "rb") as file:
            data = bytearray(file.read())
        fibres, values = start_of(data, b"FFIB"), start_of(data, b"FFBV")
        struct.pack_into("<I", data, fibres + 16 + 4, 0)
        data[values + 16:values + 32] = data[values:values + 16]
        reseal(data)
        self.assertEqual(reason_of(data), "")
        struct.pack_into("<I", data, fibres + 4, 1)  # descending
        reseal(data)
        self.assertIn("section FFIB: not by field and cluster", reason_of(data))

    def test_unknown_sections(self):
        data = golden()
        at = entry_of(data, b"VCOL")
        data[at:at + 4] = b"ZZZ9"
        reseal(data)
        self.assertEqual(reason_of(data), "")
        data[at + 4] = read_package.REQUIRED
        reseal(data)
        self.assertIn("ZZZ9", reason_of(data))


if __name__ == "__main__":
    unittest.main()
