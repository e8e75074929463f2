"""Reads the OpenEXR files that cnerf writes: scan lines, ZIP or no compression. Debian packages no reader for Python."""

import struct
import zlib

import numpy as np


def _attributes(data):
    at = 8
    while data[at]:
        name_end = data.index(b"\0", at)
        type_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, type_end + 1)
        yield data[at:name_end].decode(), data[type_end + 5 : type_end + 5 + size]
        at = type_end + 5 + size
    yield "", at + 1  # the table of blocks


def _channels(value):
    at = 0
    while value[at]:
        end = value.index(b"\0", at)
        (kind,) = struct.unpack_from("<i", value, end + 1)
        yield value[at:end].decode(), np.dtype({1: "<f2", 2: "<f4"}[kind])
        at = end + 17


def _unpacked(block, size):
    if len(block) == size:
        return block
    packed = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
    halves = (np.cumsum(packed - 128) + 128).astype(np.uint8)
    middle = (size + 1) // 2
    whole = np.empty(size, np.uint8)
    whole[0::2], whole[1::2] = halves[:middle], halves[middle:]
    return whole.tobytes()


def read_exr(path):
    """{channel: [H, W]}"""
    data = path.read_bytes()
    header = dict(_attributes(data))
    left, top, right, bottom = struct.unpack("<4i", header["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    lines_of_block = {0: 1, 2: 1, 3: 16}[header["compression"][0]]
    channels = list(_channels(header["channels"]))
    image = {name: np.empty((height, width), kind) for name, kind in channels}
    for block in range(-(-height // lines_of_block)):
        (at,) = struct.unpack_from("<Q", data, header[""] + 8 * block)
        line, size = struct.unpack_from("<ii", data, at)
        lines = range(line - top, min(line - top + lines_of_block, height))
        whole = len(lines) * sum(width * kind.itemsize for _, kind in channels)
        pixels, offset = _unpacked(data[at + 8 : at + 8 + size], whole), 0
        for y in lines:
            for name, kind in channels:
                image[name][y] = np.frombuffer(pixels, kind, width, offset)
                offset += width * kind.itemsize
    return image
