# SPDX-License-Identifier: Apache-2.0
"""What the micromaps of a .glb say: the share of the surface that is known, and pictures of the states. Needs numpy, not Blender.

The file is one that Blender's exporter wrote, without Draco compression, and that vellum baked.
"""
import json
import struct

import numpy

# By state: transparent, opaque, unknown-transparent, unknown-opaque (kStateColors in src/base/picture.h).
COLOURS = numpy.array([(0x56, 0xb4, 0xe9, 255), (0, 0x72, 0xb2, 255), (0xf0, 0xe4, 0x42, 255), (0xd5, 0x5e, 0, 255)], numpy.uint8)
_FINEST = 12  # the highest subdivision level
_TYPES = {5121: numpy.uint8, 5123: numpy.uint16, 5125: numpy.uint32, 5126: numpy.float32}
_SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES = 4
# For each byte of data, in how many of its four 2-bit states the upper bit, which means unknown, is 0.
_KNOWN_IN_BYTE = numpy.array([sum((byte >> shift) & 1 == 0 for shift in (1, 3, 5, 7)) for byte in range(256)], numpy.int64)


class Scene:
    """The parts of a .glb that are of interest here.

    data: the bytes of the file.
    """

    def __init__(self, data):
        length, = struct.unpack_from("<I", data, 12)
        self.json = json.loads(data[20:20 + length])
        self._binary = memoryview(data)[20 + length + 8:]

    def accessor(self, number):
        """The elements of an accessor, (count,) or (count, components)."""
        accessor = self.json["accessors"][number]
        view = self.json["bufferViews"][accessor["bufferView"]]
        columns = _SIZES[accessor["type"]]
        kind = numpy.dtype(_TYPES[accessor["componentType"]])
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        found = numpy.frombuffer(self._binary, kind, accessor["count"] * columns, start)
        return found if columns == 1 else found.reshape(-1, columns)

    def corners(self, primitive, attribute):
        """The values of an attribute at the corners of each triangle, (triangles, 3, components)."""
        values = self.accessor(primitive["attributes"][attribute]).astype(numpy.float64)
        if "indices" in primitive:
            values = values[self.accessor(primitive["indices"])]
        return values.reshape(-1, 3, values.shape[-1])

    def material(self, primitive):
        return self.json["materials"][primitive["material"]] if "material" in primitive else {}

    def instances(self):
        """For each mesh, the 4 x 4 matrices from it to the scene."""
        found = {}

        def visit(number, parent):
            node = self.json["nodes"][number]
            matrix = parent @ _matrix_of(node)
            if "mesh" in node:
                found.setdefault(node["mesh"], []).append(matrix)
            for child in node.get("children", ()):
                visit(child, matrix)

        for number in self.json["scenes"][self.json.get("scene", 0)].get("nodes", ()):
            visit(number, numpy.identity(4))
        return found


def _matrix_of(node):
    if "matrix" in node:
        return numpy.array(node["matrix"], numpy.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    matrix = numpy.identity(4)
    matrix[:3, :3] = numpy.array([(1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
                                  (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
                                  (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y))])
    matrix[:3, :3] *= node.get("scale", (1, 1, 1))
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _micromap_triangles(micromap):
    """(offset, level, format) of each."""
    return numpy.frombuffer(micromap.triangles, numpy.dtype([("offset", "<u4"), ("level", "<u2"), ("format", "<u2")]))


def _indices(primitive):
    """For each triangle of a primitive the triangle of its micromap, or a special index, which is negative."""
    indices = numpy.array(primitive.indices, numpy.int64)
    return numpy.where(indices >= 0, indices + primitive.base_triangle, indices)


def _known_shares(micromap, indices):
    """Of each triangle the share of its micro-triangles that is known."""
    triangles = _micromap_triangles(micromap)
    data = numpy.frombuffer(micromap.data, numpy.uint8)
    before = numpy.concatenate([[0], numpy.cumsum(_KNOWN_IN_BYTE[data])])
    offset, level = triangles["offset"].astype(numpy.int64), triangles["level"].astype(numpy.int64)
    known = numpy.where(level > 0, before[offset + numpy.maximum(4 ** level // 4, 1)] - before[offset], (data[offset] & 3) < 2)
    shares = numpy.concatenate([known / 4.0 ** level, [0, 0, 1, 1]])  # and of the special indices -4 to -1
    return shares[indices]


def known_share(scene, gltf):
    """The share of the area of all triangles with an alpha test that is opaque or transparent, 0 to 1; all instances count.

    scene: a Scene. gltf: vellum.read_gltf() of the same file.
    """
    baked = {(one.mesh, one.primitive): one for one in gltf.primitives}
    instances = scene.instances()
    total = known = 0.0
    for mesh_number, mesh in enumerate(scene.json.get("meshes", ())):
        for number, primitive in enumerate(mesh["primitives"]):
            if scene.material(primitive).get("alphaMode", "OPAQUE") == "OPAQUE" or primitive.get("mode", _TRIANGLES) != _TRIANGLES:
                continue
            corners = scene.corners(primitive, "POSITION")
            areas = numpy.zeros(len(corners))
            for matrix in instances.get(mesh_number, ()):
                a, b, c = numpy.moveaxis(corners @ matrix[:3, :3].T, 1, 0)
                areas += numpy.linalg.norm(numpy.cross(b - a, c - a), axis=1) / 2
            total += areas.sum()
            one = baked.get((mesh_number, number))
            if one:
                known += (areas * _known_shares(gltf.micromaps[one.micromap], _indices(one))).sum()
    return known / total if total else 0.0


def curve_index(u, v, level):
    """The micro-triangle at barycentrics (u, v), the weights of vertices 1 and 2: arrays of numbers in the triangle, of a level
    of 0 to 12 (curveIndex in src/core/curve.h)."""
    steps = 1 << _FINEST
    iv = numpy.minimum((v * steps).astype(numpy.int64), steps - 1)
    iu = numpy.minimum((u * steps).astype(numpy.int64), steps - 1 - iv)
    total = iu + iv + (numpy.minimum(((u + v) * steps).astype(numpy.int64), steps - 1) > iu + iv)
    low, corner = iu ^ total, iu ^ iv
    parity = corner & low
    for shift in (1, 2, 4, 8):
        parity ^= parity >> shift
    high = (low & corner) | (~low & (parity ^ iu))
    index = numpy.zeros_like(iu)
    for bit in range(_FINEST):
        index |= ((low >> bit & 1) | (high >> bit & 1) << 1) << (2 * bit)
    return index >> 2 * (_FINEST - level)


def _draw_triangle(image, corners, state_at):
    """Colours the texels whose centres lie in a triangle. What lies beyond the image is repeated in it, once each way."""
    size = len(image)
    a, b, c = corners * size
    first = numpy.floor(corners.min(axis=0) * size).astype(int)
    last = numpy.minimum(numpy.ceil(corners.max(axis=0) * size).astype(int), first + 2 * size)
    edges = numpy.array([b - a, c - a])
    if abs(numpy.linalg.det(edges)) < 1e-9:
        return
    x, y = numpy.meshgrid(numpy.arange(first[0], last[0]), numpy.arange(first[1], last[1]))
    weights = (numpy.stack([x, y], axis=-1) + 0.5 - a) @ numpy.linalg.inv(edges)
    u, v = weights[..., 0], weights[..., 1]
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    image[y[inside] % size, x[inside] % size] = COLOURS[state_at(u[inside], v[inside])]


def draw_states(scene, gltf, size):
    """Pictures of the states in the space of the texture coordinates, by name of the material: (texture coordinates' number,
    array of uint8 (size, size, 4), row 0 at v = 0), for materials with a texture. Empty where no triangle lies. Where triangles
    cover the same part, the last is seen; of a triangle that repeats the texture, two repetitions.

    scene: a Scene. gltf: vellum.read_gltf() of the same file, of 4-state micromaps.
    """
    pictures = {}
    for one in gltf.primitives:
        primitive = scene.json["meshes"][one.mesh]["primitives"][one.primitive]
        material = scene.material(primitive)
        texture = material.get("pbrMetallicRoughness", {}).get("baseColorTexture")
        if not texture:
            continue
        transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
        number = transform.get("texCoord", texture.get("texCoord", 0))
        image = pictures.setdefault(material["name"], (number, numpy.zeros((size, size, 4), numpy.uint8)))[1]
        micromap = gltf.micromaps[one.micromap]
        triangles = _micromap_triangles(micromap)
        data = numpy.frombuffer(micromap.data, numpy.uint8)
        corners = scene.corners(primitive, f"TEXCOORD_{number}")
        # Cards share their coordinates: each is drawn once.
        rows = numpy.unique(numpy.column_stack([corners.reshape(-1, 6), _indices(one)]), axis=0)
        for row in rows[numpy.isfinite(rows).all(axis=1)]:
            index = int(row[6])

            def state_at(u, v):
                if index < 0:
                    return numpy.full(u.shape, -index - 1)
                offset, level, _ = triangles[index]
                cell = curve_index(u, v, int(level))
                return data[int(offset) + (cell >> 2)] >> (2 * (cell & 3)) & 3

            _draw_triangle(image, row[:6].reshape(3, 2), state_at)
    return pictures
