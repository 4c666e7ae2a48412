#!/usr/bin/env python3
"""Writes cape.glb beside this script: a cape that becomes a cloth when its scene spawns.

It needs Python only. What it writes is what Blender exports with "Custom Properties" and "Attributes" switched on for
an object with the custom property `mass_spring` and the attribute `_PIN` on its vertices:

    extras of the node    {"mass_spring": {"net": "Cloth", "material": "WOOL", "pins": "_PIN"}}
    attribute _PIN        1 along the collar, 0 elsewhere
"""

import json
import math
import pathlib
import struct

COLUMNS, ROWS = 18, 20
LENGTH = 1.15  # m, from the collar down
COLLAR, HEM = 0.17, 0.42  # m, radii
HALF_TURN = math.radians(105)  # how far the cape reaches round, to each side


def vertices():
    for row in range(ROWS + 1):
        down = row / ROWS
        for column in range(COLUMNS + 1):
            across = column / COLUMNS
            angle = (2 * across - 1) * HALF_TURN * (1 - 0.35 * down)
            radius = COLLAR + (HEM - COLLAR) * down
            position = (radius * math.sin(angle), -LENGTH * down, -radius * math.cos(angle))
            slope = (HEM - COLLAR) / LENGTH
            scale = 1 / math.hypot(1, slope)
            normal = (math.sin(angle) * scale, slope * scale, -math.cos(angle) * scale)
            yield position, normal, (across, down), 1.0 if row == 0 else 0.0


def triangles():
    for row in range(ROWS):
        for column in range(COLUMNS):
            a = row * (COLUMNS + 1) + column
            b, c, d = a + 1, a + COLUMNS + 1, a + COLUMNS + 2
            # The diagonals alternate, so that the cloth has no grain. Seen from outside, counter-clockwise.
            yield from ((a, b, c), (b, d, c)) if (row + column) % 2 == 0 else ((a, b, d), (a, d, c))


def main():
    positions, normals, uvs, pins = zip(*vertices())
    indices = [index for triangle in triangles() for index in triangle]
    flat = lambda vectors: [component for vector in vectors for component in vector]
    blob, views, accessors = b"", [], []

    def add(values, kind, component, target, **bounds):
        nonlocal blob
        data = struct.pack(f"<{len(values)}{'f' if component == 5126 else 'H'}", *values)
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data), "target": target})
        size = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[kind]
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": component, "count": len(values) // size, "type": kind, **bounds}
        )
        blob += data + b"\0" * (-len(data) % 4)
        return len(accessors) - 1

    least = [round(min(axis), 6) - 1e-6 for axis in zip(*positions)]
    most = [round(max(axis), 6) + 1e-6 for axis in zip(*positions)]
    attributes = {
        "POSITION": add(flat(positions), "VEC3", 5126, 34962, min=least, max=most),
        "NORMAL": add(flat(normals), "VEC3", 5126, 34962),
        "TEXCOORD_0": add(flat(uvs), "VEC2", 5126, 34962),
        "_PIN": add(list(pins), "SCALAR", 5126, 34962),
    }
    primitive = {"attributes": attributes, "indices": add(indices, "SCALAR", 5123, 34963), "material": 0}
    document = {
        "asset": {"version": "2.0", "generator": "cape.py of bevy_mass_spring"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {
                "name": "Cape",
                "mesh": 0,
                "extras": {"mass_spring": {"net": "Cloth", "material": "WOOL", "pins": "_PIN"}},
            }
        ],
        "meshes": [{"name": "Cape", "primitives": [primitive]}],
        "materials": [
            {
                "name": "Wool",
                "doubleSided": True,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [0.33, 0.025, 0.04, 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.9,
                },
            }
        ],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    file = pathlib.Path(__file__).with_suffix(".glb")
    file.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    print(f"{file.name}: {len(positions)} vertices, {len(indices) // 3} triangles")


if __name__ == "__main__":
    main()
