# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that the program wrote, for tests."""
import pathlib
import struct
import zlib


def read_png(path):
    """Rows of RGB bytes of an 8-bit RGB PNG."""
    data = pathlib.Path(path).read_bytes()
    at, chunks = 8, b""
    while at < len(data):
        length, name = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if name == b"IHDR":
            width, height, depth, kind = struct.unpack(">IIBB", body[:10])
        if name == b"IDAT":
            chunks += body
        at += 12 + length
    assert (depth, kind) == (8, 2)
    raw, rows, before = zlib.decompress(chunks), [], bytearray(width * 3)
    for y in range(height):
        start = y * (width * 3 + 1)
        filter_kind, line = raw[start], bytearray(raw[start + 1:start + 1 + width * 3])
        for i in range(width * 3):
            a = line[i - 3] if i >= 3 else 0
            b = before[i]
            c = before[i - 3] if i >= 3 else 0
            if filter_kind == 1:
                line[i] = (line[i] + a) & 255
            elif filter_kind == 2:
                line[i] = (line[i] + b) & 255
            elif filter_kind == 3:
                line[i] = (line[i] + (a + b) // 2) & 255
            elif filter_kind == 4:
                p = a + b - c
                pa, pb, pc = abs(p - a), abs(p - b), abs(p - c)
                line[i] = (line[i] + (a if pa <= pb and pa <= pc else b if pb <= pc else c)) & 255
        rows.append(bytes(line))
        before = line
    return width, height, rows
