#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""examples/python/vellum.py: what is given to it is read as what it is, or rejected.

usage: python_test.py <libvellum> <examples/python>
"""
import os
import sys
import unittest
from array import array

LIBRARY, EXAMPLES = sys.argv[1:3]
os.environ["VELLUM_LIBRARY"] = LIBRARY
sys.path.insert(0, EXAMPLES)
sys.dont_write_bytecode = True
import vellum  # noqa: E402

try:
    import numpy
except ImportError:
    numpy = None

UVS = [0, 0, 1, 0, 0, 1, 1, 1]
INDICES = [0, 1, 2, 3, 2, 1]
HALF = {0: 0, 1: 0x3c00}
ALPHA = bytes([0, 255, 255, 0])


def texture(texels=ALPHA, **members):
    return vellum.Texture(texels, width=2, height=2, filter=vellum.FILTER_NEAREST,
                          addressModeU=vellum.CLAMP_TO_EDGE, addressModeV=vellum.CLAMP_TO_EDGE, **members)


def mesh(uvs=None, indices=None, **members):
    return vellum.BakeInput([texture()], uvs=array("f", UVS) if uvs is None else uvs,
                            indices=array("H", INDICES) if indices is None else indices, **members)


def baked(given):
    micromap = vellum.bake([given], level=3)
    return micromap.indices, micromap.data


class Python(unittest.TestCase):
    def setUp(self):
        self.expected = baked(mesh())
        self.assertEqual(len(self.expected[0]), 2)
        self.assertTrue(self.expected[1])

    def test_takes_what_is_right(self):
        for indices in (bytes(INDICES), array("I", INDICES), array("i", INDICES), array("h", INDICES)):
            self.assertEqual(baked(mesh(indices=indices)), self.expected)
        halves = array("H", [HALF[x] for x in UVS])
        self.assertEqual(baked(mesh(halves.tobytes(), uvFormat=vellum.FORMAT_R16G16_SFLOAT)), self.expected)
        self.assertEqual(baked(mesh(array("H", [65535 * x for x in UVS]), uvFormat=vellum.FORMAT_R16G16_UNORM)),
                         self.expected)
        self.assertEqual(baked(mesh(array("f", UVS).tobytes())), self.expected)
        for texels, format in ((array("f", [x / 255 for x in ALPHA]), vellum.FORMAT_R32_SFLOAT),
                               (array("H", [257 * x for x in ALPHA]), vellum.FORMAT_R16_UNORM),
                               (bytes(x for x in ALPHA for _ in (0, 1)), vellum.FORMAT_R16_UNORM)):
            given = vellum.BakeInput([texture(texels, format=format)], array("f", UVS), array("H", INDICES))
            self.assertEqual(baked(given), self.expected)

    def test_counts_triangles_by_the_format(self):
        vertices = [UVS[2 * i + k] for i in INDICES for k in (0, 1)]
        for uvs, format in ((array("f", vertices), vellum.FORMAT_R32G32_SFLOAT),
                            (array("H", [65535 * x for x in vertices]), vellum.FORMAT_R16G16_UNORM)):
            given = vellum.BakeInput([texture()], uvs, uvFormat=format)
            self.assertEqual(given.triangleCount, 2)
            self.assertEqual(baked(given), self.expected)
        wide = array("f", [x for i in range(6) for x in (*vertices[2 * i:2 * i + 2], 9, 9)])
        self.assertEqual(baked(vellum.BakeInput([texture()], wide, uvStride=16)), self.expected)
        self.assertEqual(vellum.BakeInput([texture()], wide[:-2], uvStride=16).triangleCount, 2)

    def rejects(self, error, text, make):
        with self.assertRaisesRegex(error, text):
            make()

    def test_rejects_what_would_be_misread(self):
        self.rejects(TypeError, "uvs are float64, expected float32", lambda: mesh(array("d", UVS)))
        self.rejects(TypeError, "uvs are float32, expected float16",
                     lambda: mesh(array("f", UVS), uvFormat=vellum.FORMAT_R16G16_SFLOAT))
        self.rejects(TypeError, "uvs are int32", lambda: mesh(array("i", UVS)))
        self.rejects(ValueError, "uvFormat", lambda: mesh(uvFormat=vellum.FORMAT_R8_UNORM))
        self.rejects(TypeError, "indices are int64, expected uint8", lambda: mesh(indices=array("q", INDICES)))
        self.rejects(TypeError, "indices are float32", lambda: mesh(indices=array("f", INDICES)))
        self.rejects(ValueError, "5 indices", lambda: mesh(indices=array("H", INDICES[:5])))
        self.rejects(ValueError, "4 vertices", lambda: vellum.BakeInput([texture()], array("f", UVS)))
        self.rejects(TypeError, "texels are float64, expected uint8", lambda: texture(array("d", list(ALPHA))))
        self.rejects(TypeError, "texels are float32, expected uint8", lambda: texture(array("f", list(ALPHA))))
        self.rejects(TypeError, "texels are float64, expected float32",
                     lambda: texture(array("d", list(ALPHA)), format=vellum.FORMAT_R32_SFLOAT))
        self.rejects(TypeError, "levels are int64, expected uint8", lambda: mesh(levels=array("q", [3, 3])))
        self.rejects(TypeError, "not one after another", lambda: mesh(memoryview(array("f", 2 * UVS))[::2]))
        self.assertEqual(len(mesh(levels=bytes([3, 3])).textures[:1]), 1)

    @unittest.skipIf(numpy is None, "numpy is not installed")
    def test_numpy(self):
        uvs = numpy.array(UVS, "f4").reshape(4, 2)
        for indices in ("u1", "u2", "u4", "i4"):
            self.assertEqual(baked(mesh(uvs, numpy.array(INDICES, indices).reshape(2, 3))), self.expected)
        self.assertEqual(baked(mesh(uvs.astype("f2"), uvFormat=vellum.FORMAT_R16G16_SFLOAT)), self.expected)
        self.rejects(TypeError, "uvs are float64", lambda: mesh(uvs.astype("f8")))
        self.rejects(TypeError, "uvs are float64", lambda: mesh(numpy.array([[0, 0.5], [1, 0]])))
        self.rejects(TypeError, "uvs are '>f' of 32", lambda: mesh(uvs.astype(">f4")))
        self.rejects(TypeError, "indices are int64", lambda: mesh(uvs, numpy.array(INDICES, "i8")))
        self.rejects(TypeError, "not one after another", lambda: mesh(uvs[:, ::-1]))
        self.rejects(TypeError, "texels are float64", lambda: texture(numpy.zeros((2, 2))))
        self.rejects(TypeError, "levels are int64", lambda: mesh(levels=numpy.array([3, 3], "i8")))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
