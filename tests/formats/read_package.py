#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""A second reader of packages, written from docs/package-format.md with the standard library only.

    read_package.py FILE.sinew

Prints what `sinew inspect --json` prints of the format. Exit codes: 0 done, 2 usage, 3 the file is not a sound package
(the reason is on stderr, one line), 4 the file cannot be read.
"""
import json
import math
import struct
import sys

MASK = (1 << 64) - 1
NONE = 0xFFFFFFFF
MOST = struct.unpack("<f", struct.pack("<f", 1e18))[0]  # of a number in the sections of fields

FAR = struct.unpack("<f", struct.pack("<f", 1e15))[0]  # of a place, metres

# ---- Checksum (section "Checksum" of the page) ----

SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671f"
    "cb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e"
)
P32_1, P32_2, P32_3 = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D
P64_1, P64_2, P64_3 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
P64_4, P64_5 = 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
PM1, PM2 = 0x165667919E3779F9, 0x9FB21C651E98DF25


def r32(data, at):
    return int.from_bytes(data[at:at + 4], "little")


def r64(data, at):
    return int.from_bytes(data[at:at + 8], "little")


def fold(a, b):
    product = a * b
    return (product & MASK) ^ (product >> 64)


def avalanche(h):
    h ^= h >> 37
    h = h * PM1 & MASK
    return h ^ (h >> 32)


def avalanche64(h):
    """Of the older XXH64; only inputs of 0 to 3 bytes end with it."""
    h ^= h >> 33
    h = h * P64_2 & MASK
    h ^= h >> 29
    h = h * P64_3 & MASK
    return h ^ (h >> 32)


def rotl(h, bits):
    return (h << bits | h >> (64 - bits)) & MASK


def xxh3_short(data):
    """0 to 16 bytes: no package needs them; from the xxHash specification."""
    n = len(data)
    if n == 0:
        return avalanche64(r64(SECRET, 56) ^ r64(SECRET, 64))
    if n <= 3:
        combined = data[0] << 16 | data[n >> 1] << 24 | data[-1] | n << 8
        return avalanche64(combined ^ r32(SECRET, 0) ^ r32(SECRET, 4))
    if n <= 8:
        h = (r32(data, n - 4) + (r32(data, 0) << 32)) ^ r64(SECRET, 8) ^ r64(SECRET, 16)
        h ^= rotl(h, 49) ^ rotl(h, 24)
        h = h * PM2 & MASK
        h ^= (h >> 35) + n
        h = h * PM2 & MASK
        return h ^ (h >> 28)
    low = r64(data, 0) ^ r64(SECRET, 24) ^ r64(SECRET, 32)
    high = r64(data, n - 8) ^ r64(SECRET, 40) ^ r64(SECRET, 48)
    swapped = int.from_bytes(low.to_bytes(8, "little"), "big")
    return avalanche((n + swapped + high + fold(low, high)) & MASK)


def xxh3_long(data):
    n = len(data)
    acc = [P32_3, P64_1, P64_2, P64_3, P64_4, P32_2, P64_5, P32_1]
    keys = [struct.unpack_from("<8Q", SECRET, 8 * t) for t in range(16)]
    scramble_key = struct.unpack_from("<8Q", SECRET, 128)

    def stripe(at, key):
        # The low 64 bits decide; the accumulators are cut to them when they are next read.
        v = struct.unpack_from("<8Q", data, at)
        for k in range(8):
            w = v[k] ^ key[k]
            acc[k ^ 1] += v[k]
            acc[k] += (w & 0xFFFFFFFF) * (w >> 32)

    blocks = (n - 1) // 1024
    for b in range(blocks):
        for t in range(16):
            stripe(1024 * b + 64 * t, keys[t])
        for k in range(8):
            a = acc[k] & MASK
            acc[k] = ((a ^ a >> 47) ^ scramble_key[k]) * P32_1 & MASK
    for t in range((n - 1 - 1024 * blocks) // 64):
        stripe(1024 * blocks + 64 * t, keys[t])
    stripe(n - 64, struct.unpack_from("<8Q", SECRET, 121))
    h = n * P64_1
    for k in range(4):
        h += fold(acc[2 * k] & MASK ^ r64(SECRET, 11 + 16 * k), acc[2 * k + 1] & MASK ^ r64(SECRET, 19 + 16 * k))
    return avalanche(h & MASK)


def xxh3(data):
    """XXH3-64, seed 0, of bytes of any length."""
    n = len(data)
    if n <= 16:
        return xxh3_short(data)
    if n > 240:
        return xxh3_long(data)

    def mix(i, j):
        return fold(r64(data, i) ^ r64(SECRET, j), r64(data, i + 8) ^ r64(SECRET, j + 8))

    h = n * P64_1
    if n <= 128:
        for k in range(4):
            if k == 0 or n > 32 * k:
                h += mix(16 * k, 32 * k) + mix(n - 16 * (k + 1), 32 * k + 16)
        return avalanche(h & MASK)
    h = avalanche((h + sum(mix(16 * k, 16 * k) for k in range(8))) & MASK)
    h += sum(mix(16 * k, 16 * (k - 8) + 3) for k in range(8, n // 16)) + mix(n - 16, 119)
    return avalanche(h & MASK)


# ---- Frame ----

class Refused(Exception):
    """The package breaks a rule of the page."""


HEADER = struct.Struct("<8sIIQQIIQ2Q")
ENTRY = struct.Struct("<IIQQQIIQ2Q")
MAGIC = b"SINEW\r\n\x1a"
FORMAT_VERSION = 3
REQUIRED, PACKED = 1, 2

# id: (layout of a record, required flag, always present, feature bit or None)
SECTIONS = {
    "INFO": ("<3dd3f3f8fII2I2I2I2I2I", 1, True, None),
    "STRS": ("<B", 1, False, None),
    "BODY": ("<6I2I", 1, True, None),
    "PVTX": ("<3ff", 1, True, None),
    "TETS": ("<4I", 1, False, 0),
    "CLUS": ("<2I4I3f6fI6f", 1, True, None),
    "MEMB": ("<Iff", 1, True, None),
    "AQQ9": ("<45f", 1, False, 1),
    "CMEC": ("<I3f3fI4f2II3f3fIfI", 1, False, 8),
    "CURV": ("<2f", 1, False, None),
    "CHAN": ("<2I", 1, False, 9),
    "PSTF": ("<f", 1, False, 10),
    "PPIN": ("<f", 1, False, 11),
    "PSET": ("<4I4I", 0, False, None),
    "PSTV": ("<I", 0, False, None),
    "PART": ("<2I4I", 0, False, None),
    "PRTV": ("<I", 0, False, None),
    "VPOS": ("<3f", 1, False, 2),
    "VNRM": ("<3f", 0, False, None),
    "VUV0": ("<2f", 0, False, None),
    "VCOL": ("<4B", 0, False, None),
    "VTRI": ("<3I", 1, False, 2),
    "VSUB": ("<2IIIII", 0, False, None),
    "VMAT": ("<2I4fII", 0, False, None),
    "VTEX": ("<2I2IQQ", 0, False, 7),
    "TEXB": ("<B", 0, False, None),
    "ATBC": ("<I3f", 1, False, 3),
    "ATCR": ("<2I", 1, False, 4),
    "ATCW": ("<If", 1, False, 4),
    "VSRC": ("<2I", 0, False, 5),
    "SVTX": ("<3I", 0, False, 5),
    "SVLS": ("<I", 0, False, 5),
    "SMSH": ("<2I2I", 0, False, 5),
    "GRUP": ("<2I2I", 0, False, 6),
    "GRPV": ("<I", 0, False, None),
    "MASK": ("<4I", 0, False, None),
    "MSKV": ("<If", 0, False, None),
    "FELD": ("<I2H11I3f", 1, False, 12),
    "FFUN": ("<2f4f2If", 1, False, 12),
    "FPAK": ("<48f8I", 1, False, 12),
    "FGRD": ("<8f", 1, False, 12),
    "FVAL": ("<8f", 1, False, 12),
    "FPNT": ("<4f", 1, False, None),
    "FPTV": ("<8f", 1, False, None),
    "FMOD": ("<8f", 1, False, 12),
    "FFIB": ("<3If", 1, False, None),
    "FFBV": ("<f", 1, False, None),
    "FTHR": ("<2I", 1, False, None),
    "FTHV": ("<f", 1, False, None),
    "FRES": ("<4If", 0, False, None),
    "FRSV": ("<h", 0, False, None),
    "FRSL": ("<f", 0, False, None),
    "DIST": ("<5I5f", 0, False, None),
    "DVAL": ("<h", 0, False, None),
}
# id: (indices, plain numbers, numbers of a block) of an element of a packed section, in this order
PACKINGS = {"TETS": (4, 0, 0), "MEMB": (1, 2, 0), "VPOS": (0, 0, 3), "VNRM": (0, 0, 3), "VUV0": (0, 0, 2), "VTRI": (3, 0, 0),
            "ATBC": (1, 0, 3), "ATCR": (2, 0, 0), "ATCW": (1, 1, 0), "VSRC": (2, 0, 0), "SVTX": (3, 0, 0), "SVLS": (1, 0, 0),
            "GRPV": (1, 0, 0), "MSKV": (1, 1, 0), "PSTV": (1, 0, 0), "PRTV": (1, 0, 0), "FGRD": (0, 0, 8), "FVAL": (0, 0, 8),
            "FPTV": (0, 0, 8), "FMOD": (0, 0, 8)}
FEATURES = ["tetrahedra", "quadratic", "visual", "barycentric_attachment", "cluster_attachment", "identity", "groups",
            "textures", "mechanics", "activation", "vertex_stiffness", "pin_weights",
            "fields"]
NEEDS = [("CURV", "CMEC"), ("PSTV", "PSET"), ("PRTV", "PART"), ("PART", "VPOS"), ("VNRM", "VPOS"), ("VUV0", "VPOS"), ("VCOL", "VPOS"), ("VSUB", "VPOS"), ("VMAT", "VPOS"), ("ATBC", "VPOS"),
         ("ATBC", "TETS"), ("ATCR", "VPOS"), ("VSRC", "VPOS"), ("GRUP", "VPOS"), ("TEXB", "VTEX"), ("GRPV", "GRUP"), ("MASK", "VPOS"),
         ("MSKV", "MASK"), ("FPNT", "FELD"), ("FPTV", "FPNT"), ("FFIB", "FELD"), ("FFBV", "FFIB"), ("FTHR", "FELD"), ("FTHV", "FTHR"), ("FRES", "FELD"), ("FRSV", "FRES"), ("FRSL", "FRES"), ("DIST", "FPNT"), ("DVAL", "DIST")]


def f32(value):
    """A bound as a 32-bit float holds it."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def need(condition, reason):
    if not condition:
        raise Refused(reason)


def padded(size):
    return (size + 63) // 64 * 64


def unpacked(name, data, element_bytes):
    """The elements of a packed section as its row of SECTIONS lays them out."""
    indices, plain, block = PACKINGS[name]
    rest = 4 * plain + (2 + 2 * block if block else 0)
    width = next((w for w in (2, 3) if w * indices + rest == element_bytes), None)
    need(width, f"section {name}: wrong size of packed elements")
    none = (1 << 8 * width) - 1
    out = bytearray()
    for at in range(0, len(data), element_bytes):
        for _ in range(indices):
            index = int.from_bytes(data[at:at + width], "little")
            out += struct.pack("<I", NONE if index == none else index)
            at += width
        out += data[at:at + 4 * plain]
        at += 4 * plain
        if block:
            exponent, *numbers = struct.unpack_from(f"<{1 + block}h", data, at)
            need(-111 <= exponent <= 127, f"section {name}: exponent of packed numbers")
            out += struct.pack(f"<{block}f", *(math.ldexp(q, exponent - 15) for q in numbers))
    return bytes(out)


def read_frame(data):
    """Checks header, table, checksums and tiling. Returns features, [(name, bytes)] and {name: bytes of it}."""
    need(len(data) >= 64, "cut short: the header has 64 bytes")
    magic, version, header_bytes, features, total, count, reserved0, checksum, r1, r2 = HEADER.unpack_from(data)
    need(magic == MAGIC, "not a Sinew package")
    cure = "use a newer version" if version > FORMAT_VERSION else "bake the package again"
    need(version == FORMAT_VERSION, f"format version {version}, this reader reads version {FORMAT_VERSION}: {cure}")
    need(header_bytes == 64, "header: header_bytes is not 64")
    need(total == len(data), "header: total_bytes is not the size of the file")
    need(reserved0 == r1 == r2 == 0, "header: a reserved field is not 0")
    need(count <= (len(data) - 64) // 64, "header: the table does not fit the file")
    need(xxh3(data[:40] + bytes(8) + data[48:64 + 64 * count]) == checksum, "header: checksum does not match")
    expected = 64 + 64 * count
    listed, found = [], {}
    for i in range(count):
        ident, flags, offset, size, elements, element_bytes, reserved0, checksum, r1, r2 = ENTRY.unpack_from(
            data, 64 + 64 * i)
        name = struct.pack("<I", ident).decode("latin-1")
        where = f"section {name!r}: "
        need(offset == expected, where + "does not start where the one before ends")
        need(offset + padded(size) <= len(data), where + "reaches beyond the end of the file")
        need(elements > 0 and element_bytes > 0, where + "has no elements")
        need(elements * element_bytes == size, where + "bytes are not elements times their size")
        need(reserved0 == r1 == r2 == 0, where + "a reserved field is not 0")
        expected = offset + padded(size)
        need(xxh3(data[offset:expected]) == checksum, where + "checksum does not match")
        need(not any(data[offset + size:expected]), where + "padding is not 0")
        listed.append((name, size))
        if name not in SECTIONS:
            need(not flags & REQUIRED, where + "required, but unknown: use a newer version")
            continue
        layout, wanted_flags, _, _ = SECTIONS[name]
        packed = name in PACKINGS and bool(flags & PACKED)
        need(flags == wanted_flags | (PACKED if packed else 0), where + "wrong flags")
        need(packed or element_bytes == struct.calcsize(layout), where + "wrong element size")
        need(elements < NONE, where + "too many elements")
        need(name not in found, where + "occurs twice")
        found[name] = data[offset:offset + size]
        if packed:
            found[name] = unpacked(name, found[name], element_bytes)
    need(expected == len(data), "the sections do not end where the file ends")
    need(features < 1 << len(FEATURES), "header: unknown feature bit: use a newer version")
    for name, (_, _, always, bit) in SECTIONS.items():
        need(name in found or not always, f"section {name}: missing")
        need(bit is None or (name in found) == bool(features >> bit & 1), f"section {name}: disagrees with its feature")
    for name, needed in NEEDS:
        need(name not in found or needed in found, f"section {name}: needs section {needed}")
    need("VPOS" not in found or "ATBC" in found or "ATCR" in found, "section VPOS: no attachment")
    return features, listed, found


# ---- Values ----

def tile(name, runs, total):
    """Runs (first, count) must follow each other and end at total."""
    end = 0
    for i, (first, count) in enumerate(runs):
        need(first == end, f"section {name}, element {i}: its run does not start where the one before ends")
        end += count
        need(end <= total, f"section {name}, element {i}: its run reaches too far")
    need(end == total, f"section {name}: the runs do not cover everything")


def ascending(values):
    return all(a < b for a, b in zip(values, values[1:]))


def positive(matrix, roots):
    """Whether a Cholesky factor exists of a symmetric matrix scaled to a diagonal of ones, with 0.0001 added to that."""
    factor = []
    for a, row in enumerate(matrix):
        factor.append([])
        for b in range(a + 1):
            scale = roots[a] * roots[b]
            if scale == 0 and row[b] != 0:
                return False
            rest = (row[b] / scale if scale else 0) + (1e-4 if a == b else 0)
            rest -= sum(x * y for x, y in zip(factor[a], factor[b]))
            if a == b and not rest > 0:
                return False
            factor[a].append(math.sqrt(rest) if a == b else rest / factor[b][b])
    return True


class Package:
    """All records of a sound package, as tuples of numbers in the page's order."""

    def __init__(self, data):
        self.bytes = len(data)
        self.features, self.sections, raw = read_frame(data)
        self.strings = raw.get("STRS", b"")
        self.texture_bytes = raw.get("TEXB", b"")
        self.records = {name: list(struct.iter_unpack(layout, raw.get(name, b"")))
                        for name, (layout, _, _, _) in SECTIONS.items() if name not in ("STRS", "TEXB")}
        self.check_texts()
        self.check_info()
        self.check_physical()
        self.check_clusters()
        self.check_mechanics()
        self.check_visual()
        self.check_attachments()
        self.check_identity()
        self.check_fields()

    def text(self, offset, size):
        return self.strings[offset:offset + size].decode("utf-8", "replace")

    def check_texts(self):
        at = {"INFO": (20, 22, 24, 26, 28), "BODY": (6,), "CLUS": (0,), "CHAN": (0,), "PSET": (0, 2), "PART": (0,), "VSUB": (0,), "VMAT": (0,), "VTEX": (0, 2),
              "SMSH": (0,), "GRUP": (0,), "MASK": (0,)}
        for name, fields in at.items():
            for i, record in enumerate(self.records[name]):
                for field in fields:
                    need(record[field] + record[field + 1] <= len(self.strings),
                         f"section {name}, element {i}: a text lies outside STRS")

    def check_info(self):
        # level is the third number of a FELD record; what follows counts without it
        self.levels = [f[2] for f in self.records["FELD"]]
        self.records["FELD"] = [f[:2] + f[3:] for f in self.records["FELD"]]
        need(len(self.records["INFO"]) == 1, "section INFO: must have one element")
        info = self.records["INFO"][0]
        origin, unit, low, high = info[0:3], info[3], info[4:7], info[7:10]
        diagonal, mass, density, volume, source_volume, error, min_angle, max_angle, inverted, reserved = info[10:20]
        need(all(abs(x) <= FAR for x in origin), "section INFO: origin")
        need(all(-FAR <= a <= b <= FAR for a, b in zip(low, high)), "section INFO: bounds")
        need(all(0 < x <= MOST for x in (unit, mass)), "section INFO: metres_per_unit or total_mass")
        need(all(0 <= x <= MOST for x in (density, volume, error)), "section INFO: density, physical_volume or max_rest_error")
        need(abs(source_volume) <= MOST, "section INFO: source_volume")
        side = math.dist(low, high)
        need(diagonal > 0 and abs(diagonal - side) <= 1e-3 * side, "section INFO: diagonal")
        self.low, self.high = [x - diagonal for x in low], [x + diagonal for x in high]
        need(0 <= min_angle <= max_angle <= 180, "section INFO: dihedral angles are out of order")
        need(inverted <= len(self.records["TETS"]) and reserved == 0, "section INFO: inverted_tetrahedra or reserved")

    def near(self, place):
        """Within a diagonal of the bounds."""
        return all(a <= x <= b for a, x, b in zip(self.low, place, self.high))

    def check_physical(self):
        r = self.records
        for first, name in ((0, "PVTX"), (2, "TETS"), (4, "CLUS")):
            tile("BODY", [(b[first], b[first + 1]) for b in r["BODY"]], len(r[name]))
        for i, v in enumerate(r["PVTX"]):
            need(self.near(v[:3]) and 0 < v[3] <= MOST, f"section PVTX, element {i}: rest_position or mass")
        mass = sum(v[3] for v in r["PVTX"])
        need(abs(mass - r["INFO"][0][11]) <= 1e-3 * mass, "section PVTX: the masses do not sum to total_mass")
        for i, piece in enumerate(r["BODY"]):
            need(piece[1] > 0 and piece[5] > 0, f"section BODY, element {i}: no vertices or clusters")
            end = piece[0] + piece[1]
            for k in range(piece[2], piece[2] + piece[3]):
                t = r["TETS"][k]
                need(min(t) >= piece[0] and max(t) < end and len(set(t)) == 4, f"section TETS, element {k}: bad vertex")

    def check_clusters(self):
        r = self.records
        tile("CLUS", [(c[4], c[5]) for c in r["CLUS"]], len(r["MEMB"]))
        shares = [0.0] * len(r["PVTX"])
        quadratic = 0
        for b, piece in enumerate(r["BODY"]):
            for i in range(piece[4], piece[4] + piece[5]):
                c = r["CLUS"][i]
                where = f"section CLUS, element {i}: "
                mode, of_body, first, count = c[2:6]
                center, radius, mass, alpha, frequencies, moment = c[6:9], c[9], c[10], c[11], c[12:15], c[15]
                need(mode <= 2 and of_body == b and count > 0, where + "mode, piece or member_count")
                need(moment == (quadratic if mode == 2 else NONE), where + "quadratic")
                quadratic += mode == 2
                diagonal, total = r["INFO"][0][10:12]
                need(1e-9 * diagonal <= radius <= max(3 * diagonal, 1), where + "radius")
                need(self.near(center) and 0 < mass <= f32(f32(1.001) * total) and 0 <= alpha <= 1, where + "rest_center, mass or alpha")
                need(all(0 <= f <= MOST or f == math.inf for f in frequencies), where + "frequency")
                need(all(abs(x) <= f32(1e12) for x in c[16:22]), where + "a_qq")
                members = r["MEMB"][first:first + count]
                vertices = [m[0] for m in members]
                where = f"section MEMB, cluster {i}: "
                need(ascending(vertices), where + "vertices not ascending")
                need(vertices[0] >= piece[0] and vertices[-1] < piece[0] + piece[1], where + "vertex of another piece")
                need(all(0 <= m[1] <= 1 and 0 <= m[2] <= 1 for m in members), where + "mu or share outside 0 to 1")
                need(abs(sum(m[1] for m in members) - 1) <= 1e-3, where + "mu does not sum to 1")
                for vertex, mu, share in members:
                    shares[vertex] += share
                    away = math.dist(r["PVTX"][vertex][:3], center)
                    need(mu == 0 or away <= 1.001 * radius + 1e-6 * diagonal, where + "a vertex with mu outside the radius")
                self.check_moments_of(i)
        need(quadratic == len(r["AQQ9"]), "section AQQ9: not one element for each quadratic cluster")
        for i, share in enumerate(shares):
            need(abs(share - 1) <= 1e-3, f"section MEMB: shares of physical vertex {i} do not sum to 1")
        for i, moment in enumerate(r["AQQ9"]):
            need(all(abs(x) <= f32(1e12) for x in moment), f"section AQQ9, element {i}: not finite or too large")

    def check_moments_of(self, i):
        r, c = self.records, self.records["CLUS"][i]
        where = f"section CLUS, element {i}: "
        terms, mus = [], []
        for vertex, mu, _ in r["MEMB"][c[4]:c[4] + c[5]]:
            x, y, z = ((a - b) / c[9] for a, b in zip(r["PVTX"][vertex][:3], c[6:9]))
            terms.append((x, y, z, x * x, y * y, z * z, x * y, y * z, z * x))
            mus.append(mu)
        mean = [sum(mu * q[k] for mu, q in zip(mus, terms)) for k in range(9)]
        xx, yy, zz, xy, yz, zx = c[16:22]
        inverses = [[[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]]]
        if c[2] == 2 and c[15] < len(r["AQQ9"]):
            packed = r["AQQ9"][c[15]]
            inverses.append([[packed[max(a, b) * (max(a, b) + 1) // 2 + min(a, b)] for b in range(9)] for a in range(9)])
        for inverse in inverses:
            n = len(inverse)
            moment = [[sum(mu * q[a] * q[b] for mu, q in zip(mus, terms)) - mean[a] * mean[b] for b in range(n)] for a in range(n)]
            need(all(abs(sum(inverse[a][k] * moment[k][b] for k in range(n))) <= 1.1 for a in range(n) for b in range(n)),
                 where + "not the inverse of its members' moment")

    def check_mechanics(self):
        r = self.records
        held = [v for (v,) in r["PSTV"]]
        tile("PSET", [(s[5], s[6]) for s in r["PSET"]], len(held))
        for i, s in enumerate(r["PSET"]):
            run = held[s[5]:s[5] + s[6]]
            need(s[4] <= 3 and s[7] == 0, f"section PSET, element {i}: method or reserved")
            need(ascending(run) and all(v < len(r["PVTX"]) for v in run), f"section PSET, element {i}: vertices")
        for name in ("PSTF", "PPIN"):
            need(len(r[name]) in (0, len(r["PVTX"])), f"section {name}: not one element for each physical vertex")
            for i, (value,) in enumerate(r[name]):
                need(0 <= value <= 1, f"section {name}, element {i}: outside 0 to 1")
        need(len(r["CMEC"]) in (0, len(r["CLUS"])), "section CMEC: not one element for each cluster")
        for i, m in enumerate(r["CMEC"]):
            stiffness, betas, young, poisson, damping, limit = m[0], m[1:4], m[4], m[5], m[6], m[7]
            least, largest, norm_max, norm_limit, first, count, volume = m[8:15]
            plastic_yield, creep, plastic_limit, fibre, channel, contraction, reserved = *m[15:18], m[18:21], *m[21:24]
            where = f"section CMEC, element {i}: "
            need(stiffness <= 2 and limit <= 6 and volume <= 2, where + "unknown model or method")
            need(all(0 <= b <= 1 for b in betas), where + "per_step_beta")
            need(0 <= young <= f32(1e12) and 0 <= poisson <= f32(0.499), where + "young or poisson")
            need(0 <= damping <= 1e5, where + "damping")
            need(f32(0.05) <= least <= 1 <= largest <= 20, where + "stretch_min or stretch_max")
            need(3 <= norm_max <= norm_limit <= 1000, where + "norm_max or norm_limit")
            need(0 <= plastic_yield <= 10 and 0 <= creep <= 1e5 and 0 <= plastic_limit <= 10, where + "plasticity")
            need(0 <= contraction <= f32(0.9), where + "contraction")
            length2 = sum(x * x for x in fibre)
            need(length2 == 0 or 0.999 <= length2 <= 1.001, where + "fibre is neither 0 nor of length 1")
            need(channel == NONE or channel < len(r["CHAN"]), where + "no such channel")
            need(reserved == 0, where + "reserved")
            if limit != 6:
                need(first == count == 0, where + "a curve that its limit does not use")
                continue
            need(count >= 2 and first + count <= len(r["CURV"]), where + "its curve")
            curve = r["CURV"][first:first + count]
            need(all(3 <= phi <= 1e6 and 3 <= f <= phi for phi, f in curve), where + "a point of its curve")
            need(curve[0][0] == curve[0][1], where + "the first point of its curve changes the norm")
            need(all(a[0] < b[0] and a[1] <= b[1] for a, b in zip(curve, curve[1:])), where + "its curve descends")

    def check_visual(self):
        r = self.records
        vertices = len(r["VPOS"])
        for name in ("VNRM", "VUV0", "VCOL", "ATBC", "ATCR", "VSRC"):
            need(len(r[name]) in (0, vertices), f"section {name}: not one element for each visual vertex")
        for i, place in enumerate(r["VPOS"]):
            need(self.near(place), f"section VPOS, element {i}: more than a diagonal outside the bounds")
        for name, most in (("VNRM", f32(1.001)), ("VUV0", 1e9)):
            for i, record in enumerate(r[name]):
                need(all(abs(x) <= most for x in record), f"section {name}, element {i}: not finite or too large")
        for i, triangle in enumerate(r["VTRI"]):
            need(max(triangle) < vertices, f"section VTRI, element {i}: no such vertex")
        if r["VSUB"]:
            tile("VSUB", [(s[3], s[4]) for s in r["VSUB"]], len(r["VTRI"]))
        for i, s in enumerate(r["VSUB"]):
            need((s[2] == NONE or s[2] < len(r["VMAT"])) and s[5] == 0, f"section VSUB, element {i}: material, reserved")
        for i, m in enumerate(r["VMAT"]):
            need(all(0 <= c <= 1 for c in m[2:6]) and (m[6] == NONE or m[6] < len(r["VTEX"])) and m[7] <= 1,
                 f"section VMAT, element {i}: base_color, texture or flags")
        tile("VTEX", [(t[4], t[5]) for t in r["VTEX"]], len(self.texture_bytes))

    def check_attachments(self):
        r = self.records
        for i, a in enumerate(r["ATBC"]):
            need(a[0] < len(r["TETS"]) and all(abs(w) <= 1e6 for w in a[1:]), f"section ATBC, element {i}: tetrahedron or weight")
            corner = [r["PVTX"][v][:3] for v in r["TETS"][a[0]]]
            place = [corner[3][x] + sum(w * (corner[k][x] - corner[3][x]) for k, w in enumerate(a[1:])) for x in range(3)]
            need(self.near(place), f"section ATBC, element {i}: hangs more than a diagonal outside the bounds")
        for i, a in enumerate(r["ATCW"]):
            need(a[0] < len(r["CLUS"]) and 0 <= a[1] <= 1, f"section ATCW, element {i}: cluster or weight")
        tile("ATCR", r["ATCR"], len(r["ATCW"]))
        for i, (first, count) in enumerate(r["ATCR"]):
            total = sum(a[1] for a in r["ATCW"][first:first + count])
            need(count > 0 and abs(total - 1) <= 1e-3, f"section ATCR, element {i}: weights do not sum to 1")

    def check_identity(self):
        r = self.records
        vertices = len(r["VSRC"])
        listed = [v for (v,) in r["SVLS"]]
        need(len(listed) == vertices, "section SVLS: not one element for each visual vertex")
        for i, (source, welded) in enumerate(r["VSRC"]):
            need(source < len(r["SVTX"]) and welded < vertices, f"section VSRC, element {i}: no such vertex or point")
        tile("SVTX", [(first, count) for _, first, count in r["SVTX"]], len(listed))
        need(all(v < vertices for v in listed), "section SVLS: no such visual vertex")
        for i, (welded, first, count) in enumerate(r["SVTX"]):
            run = listed[first:first + count]
            need(count > 0 or welded == NONE, f"section SVTX, element {i}: welded, but not visual")
            need(ascending(run) and all(r["VSRC"][v] == (i, welded) for v in run),
                 f"section SVTX, element {i}: disagrees with VSRC")
        tile("SMSH", [(m[2], m[3]) for m in r["SMSH"]], len(r["SVTX"]))
        carried = [v for (v,) in r["PRTV"]]
        tile("PART", [(p[3], p[4]) for p in r["PART"]], len(carried))
        need(all(v < len(r["VPOS"]) for v in carried), "section PRTV: no such visual vertex")
        for i, p in enumerate(r["PART"]):
            need(p[2] == NONE or p[2] < len(r["CLUS"]), f"section PART, element {i}: no such cluster")
            need(p[5] == 0, f"section PART, element {i}: reserved")
            need(ascending(carried[p[3]:p[3] + p[4]]), f"section PART, element {i}: vertices not ascending")
        members = [v for (v,) in r["GRPV"]]
        tile("GRUP", [(g[2], g[3]) for g in r["GRUP"]], len(members))
        need(all(v < len(r["VPOS"]) for v in members), "section GRPV: no such visual vertex")
        tile("MASK", [(m[2], m[3]) for m in r["MASK"]], len(r["MSKV"]))
        need(all(v < len(r["VPOS"]) and 0 < w <= 1 for v, w in r["MSKV"]), "section MSKV: vertex or weight")
        for i, m in enumerate(r["MASK"]):
            need(ascending([v for v, _ in r["MSKV"][m[2]:m[2] + m[3]]]), f"section MASK, element {i}: not ascending")
        for i, g in enumerate(r["GRUP"]):
            need(ascending(members[g[2]:g[2] + g[3]]), f"section GRUP, element {i}: vertices not ascending")

    def check_fields(self):
        r = self.records
        levels = self.levels
        fields = r["FELD"]
        whole = levels.count(0)
        need(all(level == i // whole for i, level in enumerate(levels)) if fields else True, "section FELD: levels")
        need(not fields or len(fields) % whole == 0, "section FELD: a level that is not whole")
        for i in range(whole, len(fields)):
            f, finer = fields[i], fields[i - whole]
            need((f[0], f[1], f[3], f[10]) == (finer[0], finer[1], finer[3], finer[10]) and f[2] <= finer[2]
                 and r["FPNT"][f[9]:f[9] + f[10]] == r["FPNT"][finer[9]:finer[9] + finer[10]],
                 f"section FELD, element {i}: unlike the level before")
        every, fields = fields, fields[:whole]
        order = [(f[0], f[1]) for f in fields]
        need(order == sorted(set(order)), "section FELD: not by piece, the free field before the held one")
        need(all(piece < len(r["BODY"]) for piece, _ in order), "section FELD: no such piece")
        need([b for b, held in order if held == 0] == (list(range(len(r["BODY"]))) if fields else []),
             "section FELD: not one free field for each piece")
        fields = every
        need(all(f[3] <= f[2] for f in fields), "section FELD: driven_count above function_count")
        # first in FELD's record, and how many elements a field takes
        runs = {"FFUN": (4, lambda k, f: k), "FPAK": (5, lambda k, f: f[6]), "FGRD": (7, lambda k, f: 3 * k * f[6]),
                "FVAL": (8, lambda k, f: k * ((r["BODY"][f[0]][1] + 7) // 8)), "FPNT": (9, lambda k, f: f[10]),
                "FPTV": (11, lambda k, f: k * ((f[10] + 7) // 8)),
                "FMOD": (12, lambda k, f: (3 * (k - f[3]) + 1) * ((3 * (k - f[3]) + 7) // 8))}
        for name, (at, count) in runs.items():
            tile(f"FELD ({name})", [(f[at], count(f[2], f)) for f in fields], len(r[name]))
        for i, f in enumerate(fields):
            where = f"section FELD, element {i}: "
            piece, held, k, driven, packs, hz, error, eigenvalue = *f[:4], f[6], *f[13:]
            need(held <= 1, where + "held")
            need(1 <= k <= 1024 and packs > 0, where + "function_count or pack_count")
            need(driven % 4 == 0 and driven <= k and (driven > 0) == (held == 1), where + "driven_count")
            need(0 <= hz <= MOST and 0 <= error <= MOST and abs(eigenvalue) <= MOST, where + "a number")
            self.check_functions(f[4], k, driven)
            finer = fields[i - whole][4] if i >= whole else f[4]
            need([x[6] for x in r["FFUN"][f[4]:f[4] + driven]] == [x[6] for x in r["FFUN"][finer:finer + driven]],
                 where + "not the pin sets of the level before")
            functions = r["FFUN"][f[4]:f[4] + k]
            self.check_samples(where, f, functions)
            first = r["BODY"][piece][0]
            vertices = r["PVTX"][first:first + r["BODY"][piece][1]]
            norms = self.check_places("FVAL", f[8], functions, vertices)
            need(all(abs(n - 1) <= 1e-3 for n in norms[driven:]), where + "a function's norm is not 1")
            if held == 0:
                self.check_moments(where, functions, vertices)
            points = r["FPNT"][f[9]:f[9] + f[10]]
            for n, p in enumerate(points, f[9]):
                need(self.near(p[:3]) and 0 < p[3] <= MOST, f"section FPNT, element {n}: at or area")
            self.check_places("FPTV", f[11], functions, points)
            self.check_modes(f[12], 3 * (k - driven))
        self.check_fibres()
        self.check_tethers()
        self.check_residuals()
        self.check_distances()

    def check_distances(self):
        grids = self.records["DIST"]
        need(ascending([g[0] for g in grids]) and all(g[0] < len(self.records["BODY"]) for g in grids), "section DIST: piece")
        tile("DIST", [(g[4], g[1] * g[2] * g[3]) for g in grids], len(self.records["DVAL"]))
        for i, g in enumerate(grids):
            where = f"section DIST, element {i}: "
            need(all(2 <= n <= 256 for n in g[1:4]), where + "nodes")
            need(self.near(g[5:8]), where + "origin")
            need(0 < g[8] <= self.records["INFO"][0][10] and 0 < g[9] <= g[8], where + "spacing or unit")

    def check_functions(self, first, k, driven):
        sets = []
        for j, (stiffness, damping, *carried, pin_set, monomial, decay) in enumerate(self.records["FFUN"][first:first + k]):
            where = f"section FFUN, element {first + j}: "
            need(all(0 <= x <= MOST for x in (stiffness, damping, decay)), where + "stiffness, damping_hz or decay")
            need(all(abs(c) <= MOST for c in carried), where + "one or rest")
            if j >= driven:
                need(pin_set == NONE and monomial == 0, where + "not driven, but names what drives it")
                continue
            need(monomial == j % 4 and pin_set < len(self.records["PSET"]), where + "monomial or pin_set")
            need(carried == [float(n == monomial) for n in range(4)], where + "not 1, X, Y or Z at rest")
            if monomial == 0:
                sets.append(pin_set)
            need(pin_set == sets[-1], where + "not the pin set of its four")
        need(ascending(sets), "section FFUN: the pin sets that drive a field are not ascending")

    def check_samples(self, where, field, functions):
        k, diagonal, total = len(functions), self.records["INFO"][0][10], 0.0
        for p in range(field[6]):
            pack = self.records["FPAK"][field[5] + p]
            gradients = self.records["FGRD"][field[7] + 3 * k * p:field[7] + 3 * k * (p + 1)]
            for lane in range(8):
                volume, mu, lam, *at, cluster = pack[lane::8]
                here = f"section FPAK, element {field[5] + p}, sample {lane}: "
                need(all(0 <= x <= MOST for x in (volume, mu, lam)), here + "volume, mu or lambda")
                need(volume == 0 or self.near(at), here + "at")
                steps = [g[lane] for g in gradients]
                need(all(abs(g) <= MOST for g in steps), here + "a gradient")
                total += volume
                piece = self.records["BODY"][field[0]]
                need(cluster == NONE or (0 <= cluster - piece[4] < piece[5] and self.records["CMEC"]), here + "cluster")
                if volume == 0:
                    need(cluster == NONE and not any([mu, lam, *at, *steps]), here + "no volume, but other numbers")
                    continue
                for axis in range(3):
                    for n in range(4):  # of 1, X, Y, Z
                        slope = sum(g * f[2 + n] for g, f in zip(steps[axis::3], functions))
                        wanted, unit = (0, 1 / diagonal) if n == 0 else (axis == n - 1, 1)
                        need(abs(slope - wanted) <= 1e-3 * unit, here + "the gradients do not give 1 at rest")
        need(total > 0, where + "the samples have no volume")

    def check_places(self, name, first, functions, places):
        """places: x y z weight. The sums of weight phi^2 by function."""
        k, diagonal = len(functions), self.records["INFO"][0][10]
        norms = [0.0] * k
        for i in range((len(places) + 7) // 8 * 8):
            block = first + k * (i // 8)
            here = f"section {name}, element {block}, place {i % 8}: "
            phi = [lanes[i % 8] for lanes in self.records[name][block:block + k]]
            if i >= len(places):
                need(not any(phi), here + "behind the last, but not 0")
                continue
            need(all(abs(value) <= MOST for value in phi), here + "not finite or too large")
            for n, wanted in enumerate((1, *places[i][:3])):
                found = sum(value * f[2 + n] for value, f in zip(phi, functions))
                need(abs(found - wanted) <= 1e-3 * (diagonal if n else 1), here + "the functions do not give 1 and X")
            norms = [norm + places[i][3] * value * value for norm, value in zip(norms, phi)]
        return norms

    def check_modes(self, first, unknowns):
        for mode in range((unknowns + 7) // 8 * 8):
            block = first + (unknowns + 1) * (mode // 8)
            here = f"section FMOD, element {block}, mode {mode}: "
            square, *vector = [lanes[mode % 8] for lanes in self.records["FMOD"][block:block + unknowns + 1]]
            if mode >= unknowns:
                need(square == 0 and not any(vector), here + "behind the last, but not 0")
                continue
            need(0 <= square <= MOST and abs(sum(x * x for x in vector) - 1) <= 1e-3, here + "frequency or norm")

    def check_fibres(self):
        r = self.records
        order = [(f[0], f[1]) for f in r["FFIB"]]
        need(order == sorted(order), "section FFIB: not by field and cluster")
        need(all(f < len(r["FELD"]) for f, _ in order), "section FFIB: no such field")
        tile("FFIB", [(f[2], r["FELD"][f[0]][2]) for f in r["FFIB"]], len(r["FFBV"]))
        sizes = [r["FELD"][field][2] for field, _ in set(order)]
        need(sum(k * (k + 1) // 2 for k in sizes) <= 1 << 26, "section FFIB: too many clusters times functions")
        for i, (field, cluster, first, tension) in enumerate(r["FFIB"]):
            where = f"section FFIB, element {i}: "
            piece = r["BODY"][r["FELD"][field][0]]
            need(0 <= cluster - piece[4] < piece[5] and r["CMEC"], where + "cluster")
            need(r["CMEC"][cluster][21] != NONE and any(r["CMEC"][cluster][18:21]), where + "nothing activates a fibre")
            need(0 <= tension <= MOST, where + "tension")
            functions = r["FFUN"][r["FELD"][field][4]:][:r["FELD"][field][2]]
            values = [v for v, in r["FFBV"][first:first + len(functions)]]
            need(all(abs(v) <= MOST and tension * v * v <= MOST for v in values), where + "a value")
            wanted = (0, *r["CMEC"][cluster][18:21])
            for n in range(4):
                found = sum(v * f[2 + n] for v, f in zip(values, functions)) * (1 if n else r["INFO"][0][10])
                need(abs(found - wanted[n]) <= 1e-3, where + "its values do not give the fibre at rest")

    def check_tethers(self):
        r = self.records
        order = [f for f, _ in r["FTHR"]]
        need(order == sorted(set(order)) and all(f < len(r["FELD"]) and r["FELD"][f][1] == 1 for f in order), "section FTHR: fields")
        tile("FTHR", [(first, r["FELD"][f][2] ** 2) for f, first in r["FTHR"]], len(r["FTHV"]))
        for i, (field, first) in enumerate(r["FTHR"]):
            where = f"section FTHR, element {i}: "
            k = r["FELD"][field][2]
            functions = r["FFUN"][r["FELD"][field][4]:][:k]
            t = [[v for v, in r["FTHV"][first + k * a:first + k * a + k]] for a in range(k)]
            for a in range(k):
                need(t[a][a] >= 0 and all(abs(t[a][b]) <= MOST and t[a][b] == t[b][a] for b in range(k)), where + "a value")
            roots = [math.sqrt(t[a][a]) for a in range(k)]
            for a in range(k):
                sizes = [max(abs(t[a][b]), roots[a] * roots[b]) for b in range(k)]  # of terms that may have cancelled
                for n in range(4):
                    pull = sum(v * f[2 + n] for v, f in zip(t[a], functions))
                    unit = sum(s * abs(f[2 + n]) for s, f in zip(sizes, functions))
                    need(abs(pull) <= 1e-3 * unit, where + "pulls at the rest shape")
            need(positive(t, roots), where + "not positive semidefinite")

    def check_residuals(self):
        r = self.records
        order = [record[0] for record in r["FRES"]]
        need(order == sorted(set(order)) and all(f < len(r["FELD"]) and r["FELD"][f][1] == 0 for f in order), "section FRES: fields")
        counts = [r["BODY"][r["FELD"][f][0]][1] for f in order]  # of vertices
        for i, (_, modes, _, _, scale) in enumerate(r["FRES"]):
            need(1 <= modes <= 256 and 0 < scale <= MOST, f"section FRES, element {i}: modes or scale")
        tile("FRES", [(record[2], 24 * ((count + 7) // 8) * record[1]) for record, count in zip(r["FRES"], counts)], len(r["FRSV"]))
        tile("FRES", [(record[3], count) for record, count in zip(r["FRES"], counts)], len(r["FRSL"]))
        need(all(0 < local <= MOST for local, in r["FRSL"]), "section FRSL: a value")

    def check_moments(self, where, functions, vertices):
        diagonal, mass, origin = self.records["INFO"][0][10], sum(v[3] for v in vertices), vertices[0][:3]
        carried = [(f[2], *(x - f[2] * o for x, o in zip(f[3:6], origin))) for f in functions]
        wanted = [(1, *(x - o for x, o in zip(v[:3], origin))) for v in vertices]
        for a in range(4):
            for b in range(a + 1):
                found = sum(c[a] * c[b] for c in carried)
                right = sum(v[3] * w[a] * w[b] for v, w in zip(vertices, wanted))
                unit = mass * (diagonal if a else 1) * (diagonal if b else 1)
                need(abs(found - right) <= 1e-3 * unit, where + "mass, centre or moments")

    def summary(self):
        """The keys of `sinew inspect --json`."""
        r = self.records
        info = r["INFO"][0]
        return {
            "format_version": FORMAT_VERSION,
            "bytes": self.bytes,
            "sections": [{"name": name, "bytes": size} for name, size in self.sections],
            "features": [name for bit, name in enumerate(FEATURES) if self.features >> bit & 1],
            "physical_vertices": len(r["PVTX"]),
            "tetrahedra": len(r["TETS"]),
            "clusters": [{"name": self.text(c[0], c[1]), "members": c[5], "mode": ("rigid", "linear", "quadratic")[c[2]]}
                         for c in r["CLUS"]],
            "fields": [self.field_summary(f, level) for f, level in zip(r["FELD"], self.levels)],
            "visual_vertices": len(r["VPOS"]),
            "visual_triangles": len(r["VTRI"]),
            "source_vertices": len(r["SVTX"]),
            "attachment": {"max_rest_error": info[15]},
            "tetrahedra_quality": {"min_dihedral_deg": info[16], "max_dihedral_deg": info[17], "inverted": info[18]},
        }

    def field_summary(self, f, level):
        samples = sum(volume > 0 for pack in self.records["FPAK"][f[5]:f[5] + f[6]] for volume in pack[:8])
        return {"piece": self.text(*self.records["BODY"][f[0]][6:8]), "held": f[1] == 1, "level": level, "functions": f[2], "driven": f[3],
                "samples": samples, "contact_points": f[10], "lowest_hz": f[13], "static_error": f[14],
                "least_eigenvalue": f[15]}


def main():
    if len(sys.argv) != 2:
        print("usage: read_package.py FILE.sinew", file=sys.stderr)
        return 2
    try:
        with open(sys.argv[1], "rb") as file:
            data = file.read()
    except OSError as error:
        print(f"read_package: {sys.argv[1]}: {error.strerror}", file=sys.stderr)
        return 4
    try:
        print(json.dumps(Package(data).summary(), indent=2))
    except Refused as reason:
        print(f"read_package: {sys.argv[1]}: {reason}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
