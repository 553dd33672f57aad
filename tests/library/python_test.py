#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Python package, bindings/python, with the libraries and the command of a build.

usage: python_test.py <folder of the libraries> <vellum> [unittest's arguments]
"""
import _thread
import base64
import copy
import json
import os
import pathlib
import pickle
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import unittest
import zlib
from array import array
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_int32, c_size_t, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p

if sys.version_info < (3, 11):
    print("skipped: the package needs Python 3.11")
    sys.exit(77)
LIBRARIES, COMMAND = sys.argv[1:3]
ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ["VELLUM_LIBRARY_PATH"] = LIBRARIES
sys.path.insert(0, str(ROOT / "bindings/python"))
sys.dont_write_bytecode = True
import vellum  # noqa: E402
from vellum import _native  # noqa: E402

assert "numpy" not in sys.modules, "the package does without"
try:
    import numpy
except ImportError:
    numpy = None

UVS = [0, 0, 1, 0, 0, 1, 1, 1]
INDICES = [0, 1, 2, 3, 2, 1]
VERTICES = [UVS[2 * i + k] for i in INDICES for k in (0, 1)]
ALPHA = bytes([0, 255, 255, 0])
HALF = {0: 0, 1: 0x3c00}
EDGE = vellum.AddressMode.CLAMP_TO_EDGE


def texture(alpha=ALPHA, *size, **members):
    return vellum.Texture(alpha, *(size or (2, 2)), filter=vellum.Filter.NEAREST, address_mode_u=EDGE, address_mode_v=EDGE,
                          **members)


def mesh(uvs=None, indices=None, **members):
    return vellum.BakeInput(texture(), array("f", UVS) if uvs is None else uvs,
                            array("H", INDICES) if indices is None else indices, **members)


def baked(given, **options):
    micromap = vellum.bake(given, **{"level": 3, **options})
    return micromap.indices.tolist(), micromap.data, micromap.triangles


def long_bake():
    """It takes minutes, so that it ends because it is interrupted."""
    alpha = bytes(255 * (x * 7919 % 251 < 125) for x in range(256 * 256))
    uvs = array("f", [i / 1000 + x for i in range(200) for x in (0, 0, 9, 0, 0, 9)])
    return [vellum.BakeInput(vellum.Texture(alpha, 256, 256), uvs)]


class Case(unittest.TestCase):
    def rejects(self, error, text, make, *arguments, **members):
        with self.assertRaisesRegex(error, text) as caught:
            make(*arguments, **members)
        return caught.exception

    def fails(self, result, text, make, *arguments, **members):
        self.assertIs(self.rejects(vellum.Error, text, make, *arguments, **members).result, result)


class Interface(Case):
    """What is written by hand in Python is what the headers state."""

    HEADERS = [re.sub(r"//.*|VELLUM_CALL ?", "", (ROOT / "include/vellum" / name).read_text(encoding="utf-8"))
               for name in ("vellum.h", "spirv.h", "gltf.h")]
    TYPES = {"size_t": c_size_t, "uint8_t": c_uint8, "uint16_t": c_uint16, "uint32_t": c_uint32, "int32_t": c_int32,
             "uint64_t": c_uint64, "float": c_float, "double": c_double, "void": c_void_p, "int": c_int, "VellumResult": c_int,
             "VellumMessageCallback": _native.MESSAGE, "VellumProgressCallback": _native.PROGRESS,
             "VellumCancelCallback": _native.CANCEL, "VellumGltfNoteCallback": _native.NOTE,
             "VellumGltfCacheGetCallback": _native.CACHE_GET, "VellumGltfCachePutCallback": _native.CACHE_PUT,
             "VellumGltfCacheValueCallback": _native.CACHE_VALUE, "VellumGltfOutputCallback": _native.OUTPUT}

    def type_of(self, text, member):
        """Of a declaration without its name: `const uint8_t *`. Members and arguments have pointers of other kinds."""
        words = text.replace("const ", "").replace("*", " * ").split()
        name, stars = words[0], words.count("*")
        if name == "char":
            return c_char_p if stars == 1 else POINTER(c_char_p)
        if stars == 0:
            return self.TYPES[name]
        if name == "void" or not member:
            return c_void_p
        if name.startswith("Vellum"):
            return POINTER(getattr(_native, name.removeprefix("Vellum")))
        return POINTER(self.TYPES[name])

    def test_structures(self):
        found = 0
        for text in self.HEADERS:
            for body, name in re.findall(r"typedef struct \w+ \{(.*?)\} Vellum(\w+);", text, re.S):
                found += 1
                members = []
                for declaration, member, count in re.findall(r"^\s*(.*?)(\w+)(?:\[(\d)\])?;", body, re.M):
                    kind = self.type_of(declaration, True)
                    members.append((re.sub("[A-Z]", lambda c: "_" + c[0].lower(), member), kind * int(count) if count else kind))
                # Buffers of the caller are addresses here.
                given = [(field, c_void_p if kind == POINTER(c_uint8) and name == "BakeInput" else kind)
                         for field, kind in members]
                self.assertEqual(getattr(_native, name)._fields_, given, name)
        self.assertEqual(found, sum(isinstance(value, type(_native.Texture)) for value in vars(_native).values()))

    def test_functions(self):
        for name, texts in (("vellum", self.HEADERS[:2]), ("vellum_gltf", self.HEADERS[2:])):
            declared = {}
            for result, pointer, function, arguments in re.findall(
                    r"VELLUM_API ([\w ]+?) (\*?)(\w+)\(([^)]*)\);", " ".join(texts)):
                arguments = [re.sub(r"\w+$", "", argument.strip()) for argument in arguments.split(",")]
                declared[function] = (None if result == "void" else self.type_of(result + pointer, False),
                                      [self.type_of(argument, False) for argument in arguments if argument])
            # Python has the names of results, and lists that can be searched.
            for unused in ("vellumResultName", "vellumFindGltfPrimitive"):
                declared.pop(unused, None)
            self.assertEqual(_native.FUNCTIONS[name], declared)

    def test_enumerations(self):
        arguments = ("VellumIndexType", "VellumBakeFlagBits", "VellumGltfBakeFlagBits")  # of other kinds in Python
        count = 0
        for body, name in re.findall(r"typedef enum \w+ \{(.*?)\} (\w+);", " ".join(self.HEADERS), re.S):
            if name in arguments:
                continue
            kind = getattr(vellum, name.removeprefix("Vellum"))
            prefix = re.sub("(?<!^)[A-Z]", lambda c: "_" + c[0], name).upper().removesuffix("_RULE") + "_"
            values = {key.removeprefix(prefix).removeprefix("VELLUM_"): int(value)
                      for key, value in re.findall(r"(\w+) = (-?\d+)", body)}
            if kind is vellum.MicromapFormat:  # names begin with letters
                values = {{"2_STATE": "TWO_STATE", "4_STATE": "FOUR_STATE"}[key]: value for key, value in values.items()}
            self.assertEqual({member.name: member.value for member in kind}, values, name)
            count += 1
        self.assertEqual(count, 11)

    def test_versions(self):
        major, minor, patch = re.search(r"VELLUM_HEADER_VERSION VELLUM_MAKE_VERSION\((\d+), (\d+), (\d+)\)",
                                        self.HEADERS[0]).groups()
        self.assertEqual(_native.INTERFACE, f"{major}.{minor}")
        self.assertEqual(vellum.library_version(), f"{major}.{minor}.{patch}")
        self.assertGreater(vellum.bake_version(), 0)

    def test_options_are_members(self):
        members = {name for name, _ in _native.BakeOptions._fields_}
        own = set(vellum.BakeOptions.__optional_keys__)
        self.assertEqual(own - members, {"disallow_mixed_special_indices"})
        self.assertEqual(members - own, {"struct_size", "flags", "reserved", "message", "progress", "cancelled", "user_data"})

    def test_without_the_library(self):
        done = subprocess.run([sys.executable, "-c", "import vellum"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              env={**os.environ, "VELLUM_LIBRARY_PATH": "/nowhere", "PYTHONPATH": str(ROOT / "bindings/python")})
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stdout, r"ImportError: .*/nowhere/libvellum\.so.*: install Vellum, or set VELLUM_LIBRARY_PATH")


class Input(Case):
    def setUp(self):
        self.expected = baked(mesh())
        self.assertEqual(len(self.expected[0]), 2)
        self.assertTrue(self.expected[1])

    def test_indices(self):
        for indices in (bytes(INDICES), memoryview(bytes(INDICES[::-1]))[::-1], array("b", INDICES), array("h", INDICES), array("H", INDICES), array("i", INDICES),
                        array("I", INDICES), memoryview(bytes(array("I", INDICES))).cast("I", (2, 3))):
            self.assertEqual(baked(mesh(indices=indices)), self.expected)
        self.assertEqual(mesh(indices=b"").triangle_count, 0)

    def test_texture_coordinates(self):
        floats = array("f", UVS)
        halves = array("H", [HALF[x] for x in UVS])
        for uvs, format in ((floats, None), (memoryview(floats).cast("B").cast("f", (4, 2)), None),
                            (floats, vellum.Format.R32G32_SFLOAT), (floats.tobytes(), vellum.Format.R32G32_SFLOAT),
                            (halves.tobytes(), vellum.Format.R16G16_SFLOAT),
                            (array("H", [65535 * x for x in UVS]), vellum.Format.R16G16_UNORM)):
            self.assertEqual(baked(mesh(uvs, uv_format=format)), self.expected)

    def test_triangles_are_counted_by_the_format(self):
        halves = array("H", [HALF[x] for x in VERTICES])
        for uvs, format in ((array("f", VERTICES), None), (halves.tobytes(), vellum.Format.R16G16_SFLOAT),
                            (array("H", [65535 * x for x in VERTICES]), vellum.Format.R16G16_UNORM)):
            given = vellum.BakeInput(texture(), uvs, uv_format=format)
            self.assertEqual(given.triangle_count, 2)
            self.assertEqual(baked(given), self.expected)
        wide = array("f", [x for i in range(6) for x in (*VERTICES[2 * i:2 * i + 2], 9, 9)])
        self.assertEqual(baked(vellum.BakeInput(texture(), wide, uv_stride=16)), self.expected)
        self.assertEqual(vellum.BakeInput(texture(), wide[:-2], uv_stride=16).triangle_count, 2)

    def test_alpha(self):
        halves = b"".join(struct.pack("e", x / 255) for x in ALPHA)
        rgba = bytes(x for alpha in ALPHA for x in (9, 9, 9, alpha))
        for given in (texture(array("f", [x / 255 for x in ALPHA])), texture(array("H", [257 * x for x in ALPHA])),
                      texture(halves, format=vellum.Format.R16_SFLOAT),
                      texture(bytearray(ALPHA)), texture(memoryview(bytearray(b"_" + ALPHA))[1:]),
                      texture(memoryview(b"_" + ALPHA)[1:]), texture(memoryview(ALPHA).cast("B", (2, 2)), None, None),
                      texture(memoryview(rgba)[3::4]), texture(rgba, offset=3, pixel_stride=4),
                      texture(ALPHA[:2] + b"__" + ALPHA[2:], row_stride=4)):
            self.assertEqual(baked(vellum.BakeInput([given], array("f", UVS), array("H", INDICES))), self.expected)

    def test_each_triangle(self):
        levels = mesh(levels=bytes([1, 2]), formats=bytes([1, 2]))
        self.assertEqual({(usage.subdivision_level, usage.format) for usage in vellum.bake(levels).usages}, {(1, 1), (2, 2)})
        transformed = mesh(array("f", [x / 2 for x in UVS]), uv_transform=[2, 0, 0, 0, 2, 0])
        self.assertEqual(baked(transformed), self.expected)

    def test_what_would_be_misread_is_rejected(self):
        uvs = array("f", UVS)
        for text, make in (
                (r"uvs is float64, expected float32 or float16; of a numpy array: .astype\('f4'\)", lambda: mesh(array("d", UVS))),
                ("uvs is float32, expected float16", lambda: mesh(uvs, uv_format=vellum.Format.R16G16_SFLOAT)),
                ("uvs is float32, expected uint16", lambda: mesh(uvs, uv_format=vellum.Format.R16G16_UNORM)),
                ("uvs is uint16, expected float32 or float16", lambda: mesh(array("H", UVS))),
                ("uvs is uint16, expected float16", lambda: mesh(array("H", UVS), uv_format=vellum.Format.R16G16_SFLOAT)),
                ("uvs is int32", lambda: mesh(array("i", UVS))),
                ("uvs is uint8, expected float32 or float16", lambda: mesh(uvs.tobytes())),
                ("uvs: expected bytes, array.array, a numpy array .* 'list'", lambda: mesh(UVS)),
                ("uvs: .* 'str'", lambda: mesh("00")),
                (r"indices is int64, expected uint32 or .*; of a numpy array: .astype\('u4'\)",
                 lambda: mesh(indices=array("q", INDICES))),
                ("indices is uint64", lambda: mesh(indices=array("Q", INDICES))),
                ("indices is float32", lambda: mesh(indices=array("f", INDICES))),
                ("alpha is float64, expected uint8 or uint16 or float16 or float32", lambda: texture(array("d", list(ALPHA)))),
                ("alpha is uint32", lambda: texture(array("I", list(ALPHA)))),
                ("alpha is int8", lambda: texture(array("b", ALPHA))),
                (r"alpha is of format '\?'", lambda: texture(memoryview(ALPHA).cast("?"))),
                ("alpha is float64, expected float32", lambda: texture(array("d", list(ALPHA)), format=vellum.Format.R32_SFLOAT)),
                ("alpha is uint8, expected uint16",
                 lambda: texture(memoryview(bytes(8)).cast("B", (2, 4)), None, None, format=vellum.Format.R16_UNORM)),
                ("levels is int64, expected uint8", lambda: mesh(levels=array("q", [3, 3])))):
            with self.subTest(text):
                self.rejects(TypeError, text, make)

    def test_shapes(self):
        uvs = array("f", UVS)
        for text, make in (
                ("uv_format 9 is not", lambda: mesh(uv_format=vellum.Format.R8_UNORM)),
                ("format 103 is not", lambda: texture(format=vellum.Format.R32G32_SFLOAT)),
                (r"uvs has the shape \(2, 4\), expected \(n, 2\)", lambda: mesh(memoryview(bytes(uvs)).cast("f", (2, 4)))),
                ("uvs has 28 bytes, which are no whole number of vertices of 8", lambda: mesh(uvs[:7])),
                ("uv_stride is for uvs of one", lambda: mesh(memoryview(bytes(uvs)).cast("f", (4, 2)), uv_stride=8)),
                (r"indices has the shape \(3, 2\)", lambda: mesh(indices=memoryview(bytes(INDICES)).cast("B", (3, 2)))),
                ("5 indices are no whole", lambda: mesh(indices=array("H", INDICES[:5]))),
                ("4 vertices are no whole", lambda: vellum.BakeInput(texture(), uvs)),
                (r"alpha has the shape \(1, 2, 2\), expected \(height, width\)",
                 lambda: texture(memoryview(ALPHA).cast("B", (1, 2, 2)))),
                (r"alpha has the shape \(1, 4\), not", lambda: texture(memoryview(ALPHA).cast("B", (1, 4)), 2, 2)),
                ("offset, pixel_stride and row_stride", lambda: texture(memoryview(ALPHA).cast("B", (2, 2)), None, None, offset=1)),
                ("needs width and height", lambda: vellum.Texture(ALPHA)),
                ("width is -2, which is out", lambda: texture(ALPHA, -2, 2)),
                ("width is 4294967298, which is out", lambda: texture(ALPHA, 2**32 + 2, 2)),
                ("offset is -1", lambda: texture(offset=-1)),
                ("uv_transform has 5 numbers", lambda: mesh(uv_transform=[1] * 5)),
                (r"levels has the shape \(3,\), expected \(2,\)", lambda: mesh(levels=bytes(3)))):
            with self.subTest(text):
                self.rejects(ValueError, text, make)
        self.rejects(TypeError, "textures: expected Texture, or a list of them, not bytes", vellum.BakeInput, [ALPHA], uvs)
        self.rejects(TypeError, "inputs: expected BakeInput, or a list of them, not Texture", vellum.bake, [texture()])
        self.rejects(TypeError, "width is 2.0", texture, ALPHA, 2.0, 2)
        self.rejects(TypeError, "scale is '1'", texture, scale="1")

    def test_ranges_are_the_library_s(self):
        invalid = vellum.Result.ERROR_INVALID_ARGUMENT
        self.fails(invalid, "input 1: texture 0: width is 0, not 1 to",
                   vellum.bake, [mesh(), vellum.BakeInput(texture(ALPHA, 0, 2), array("f", VERTICES))])
        self.fails(invalid, "do not lie within 4 bytes", vellum.bake, vellum.BakeInput(texture(ALPHA, 2, 3), array("f", VERTICES)))
        self.fails(invalid, "index 2 is 9, of 4 vertices", vellum.bake, mesh(indices=bytes([0, 1, 9])))
        self.fails(invalid, "index 2 is 4294967295, of 4 vertices", vellum.bake, mesh(indices=array("i", [0, 1, -1])))
        self.fails(invalid, "texture", vellum.bake, vellum.BakeInput([], array("f", VERTICES)))
        self.fails(invalid, "cutoff is", vellum.bake, mesh(cutoff=float("nan")))
        self.fails(invalid, "level is 13", vellum.bake, mesh(), level=13)
        self.fails(invalid, "minKnown is 2", vellum.bake, mesh(), min_known=2)
        self.fails(vellum.Result.ERROR_TOO_LARGE, "larger than 10 bytes", vellum.bake, mesh(), level=9, max_data_size=10)
        self.rejects(TypeError, "there is no option 'levle'; there are .* level, ", vellum.bake, mesh(), levle=3)
        self.rejects(TypeError, "there is no option 'flags'", vellum.bake, mesh(), flags=1)
        self.rejects(ValueError, "threads is -1", vellum.bake, mesh(), threads=-1)
        self.rejects(TypeError, "level is 1.5", vellum.bake, mesh(), level=1.5)

    @unittest.skipIf(numpy is None, "numpy is not installed")
    def test_numpy(self):
        uvs = numpy.array(UVS, "f4").reshape(4, 2)
        indices = numpy.array(INDICES).reshape(2, 3)
        self.assertEqual(indices.dtype, numpy.int64)
        for code in ("u1", "u2", "u4", "i1", "i2", "i4"):
            self.assertEqual(baked(mesh(uvs, indices.astype(code))), self.expected)
        self.assertEqual(baked(mesh(uvs.astype("f2"))), self.expected)
        self.assertEqual(baked(mesh((65535 * uvs).astype("u2"), uv_format=vellum.Format.R16G16_UNORM)), self.expected)
        vertices = numpy.zeros((4, 8), "f4")
        vertices[:, 3:5] = uvs
        self.assertEqual(baked(mesh(vertices.astype("f2")[:, 3:5], indices.astype("u1"))), self.expected)
        for given in (vertices[:, 3:5], numpy.asfortranarray(uvs), uvs[::-1][::-1]):  # with gaps, and of all strides
            self.assertEqual(baked(mesh(given, indices.astype("u4"))), self.expected)
        self.assertEqual(baked(mesh(uvs[:, ::-1], indices.astype("u4"))),
                         baked(mesh(numpy.ascontiguousarray(uvs[:, ::-1]), indices.astype("u4"))))
        fixed = uvs.copy()
        fixed.flags.writeable = False
        self.assertEqual(baked(mesh(fixed, indices.astype("u4"))), self.expected)
        image = numpy.zeros((2, 2, 4), "u1")
        image[:, :, 3] = numpy.frombuffer(ALPHA, "u1").reshape(2, 2)
        for alpha in (image[:, :, 3], image[:, :, 3] / numpy.float32(255), (image[:, :, 3] / 255).astype("f2"),
                      image[:, :, 3].astype("u2") * 257):
            self.assertEqual(baked(vellum.BakeInput(texture(alpha, None, None), uvs, indices.astype("u4"))), self.expected)
        for text, make in (
                ("uvs is float64, expected float32", lambda: mesh(numpy.array([[0, 0.5], [1, 0]]))),
                ("uvs is of format '>f'", lambda: mesh(uvs.astype(">f4"))),
                ("indices is int64, expected uint32", lambda: mesh(uvs, indices)),
                ("alpha is float64", lambda: texture(numpy.zeros((2, 2)))),
                ("alpha is of format '?'", lambda: texture(numpy.zeros((2, 2), bool))),
                ("levels is int64", lambda: mesh(levels=numpy.array([3, 3])))):
            with self.subTest(text):
                self.rejects(TypeError, text.replace("?", r"\?"), make)
        self.rejects(ValueError, r"alpha has the shape \(2, 2, 4\), expected .* image\[:, :, 3\]", texture, image)
        micromap = vellum.bake(mesh(), level=3)
        found = numpy.asarray(micromap.indices)
        self.assertEqual((found.dtype, found.tolist()), (numpy.int32, self.expected[0]))
        triangles = numpy.frombuffer(micromap.triangles, "u4,u2,u2")
        self.assertEqual(triangles[0].tolist(), (0, 3, 2))


class Results(Case):
    def test_members(self):
        opaque = vellum.BakeInput(texture(bytes([255] * 4)), array("f", VERTICES))
        micromap = vellum.bake([mesh(), opaque], level=3)
        self.assertEqual(sum(micromap.state_counts), 4 * 4**3)
        self.assertEqual(micromap.special_counts, [0, 2, 0, 0])
        self.assertEqual(micromap.indices.tolist()[2:], [vellum.SpecialIndex.FULLY_OPAQUE] * 2)
        self.assertEqual([geometry.indices.tolist() for geometry in micromap.geometries],
                         [micromap.indices.tolist()[:2], micromap.indices.tolist()[2:]])
        self.assertEqual(sum(usage.count for usage in micromap.usages), len(micromap.triangles) // 8)
        self.assertEqual(micromap.geometries[1].usages, [])
        offset, level, format = next(struct.iter_unpack("IHH", micromap.triangles))
        self.assertEqual((offset, level, vellum.MicromapFormat(format)), (0, 3, vellum.MicromapFormat.FOUR_STATE))
        self.assertEqual(micromap.distinct_count, 4)
        self.assertIs(micromap.state(0, 0, 0), vellum.State.TRANSPARENT)
        self.assertIs(micromap.state(3, 0.2, 0.2), vellum.State.OPAQUE)
        for wrong in (-1, 4):
            self.rejects(IndexError, f"no triangle {wrong} of 4", micromap.state, wrong, 0, 0)
        self.assertEqual(len(vellum.bake([]).indices), 0)
        another = copy.copy(micromap)
        del micromap
        self.assertIs(another.state(3, 0.2, 0.2), vellum.State.OPAQUE)
        two = vellum.bake(mesh(), level=3, format=vellum.MicromapFormat.TWO_STATE,
                          two_state_rule=vellum.TwoStateRule.UNKNOWN_IS_OPAQUE)
        self.assertEqual(two.state_counts[2:], [0, 0])
        mixed = vellum.bake([vellum.BakeInput(texture(), array("f", VERTICES + [0.1, 0.1, 0.2, 0.1, 0.1, 0.2]))], level=3,
                            disallow_mixed_special_indices=True)
        self.assertGreaterEqual(min(mixed.indices), 0)

    def test_write_indices(self):
        indices = array("i", [0, -1, 251, -4])
        self.assertEqual(vellum.write_indices(indices, 1), bytes([0, 255, 251, 252]))
        self.assertEqual(vellum.write_indices(indices, 2), array("H", [0, 65535, 251, 65532]).tobytes())
        self.assertEqual(vellum.write_indices(indices, 4), indices.tobytes())
        self.assertEqual(vellum.write_indices(vellum.bake(mesh(), level=3).indices, 1), bytes([0, 0]))
        self.assertEqual(vellum.write_indices(array("i"), 1), b"")
        self.rejects(ValueError, "too large for 1 byte", vellum.write_indices, array("i", [252]), 1)
        self.rejects(ValueError, "below -4", vellum.write_indices, array("i", [-5]), 4)
        self.rejects(ValueError, "size is 3", vellum.write_indices, indices, 3)
        self.rejects(TypeError, "indices is int64, expected int32", vellum.write_indices, array("q", [0]), 4)

    def test_errors_can_be_pickled(self):
        error = self.rejects(vellum.Error, "level is 13", vellum.bake, mesh(), level=13)
        same = pickle.loads(pickle.dumps(error))
        self.assertEqual((type(same), same.result, str(same)), (vellum.Error, error.result, str(error)))


class Callbacks(Case):
    def test_progress(self):
        seen = []
        vellum.bake(mesh(), level=3, progress=lambda done, total: seen.append((done, total, threading.get_ident())))
        self.assertEqual(seen[-1], (2, 2, threading.get_ident()))
        for last in (1, 2):
            error = self.rejects(vellum.Cancelled, "cancelled", vellum.bake, mesh(), level=3,
                                 progress=lambda done, total, last=last: done == last)
            self.assertIs(error.result, vellum.Result.CANCELLED)

    def test_last_progress_raises(self):
        # The library has a result by then.
        library, destroyed = _native.library("vellum"), []
        original = library.vellumDestroyMicromap

        def destroy(handle):
            destroyed.append(handle.value)
            original(handle)

        def progress(done, total):
            if done == total:
                raise KeyError("last")
        library.vellumDestroyMicromap = destroy
        try:
            with self.assertRaises(KeyError):
                vellum.bake(mesh(), level=3, progress=progress)
        finally:
            library.vellumDestroyMicromap = original
        self.assertEqual(len(destroyed), 1)
        self.assertTrue(destroyed[0])

    def test_callbacks_may_bake(self):
        inner = []
        vellum.bake(mesh(), level=3, progress=lambda done, total: inner.append(baked(mesh())))
        self.assertEqual(inner, [baked(mesh())] * 2)

    def test_exceptions_are_raised_on(self):
        def wrong(*_):
            raise KeyError("mine")
        for callbacks in ({"progress": wrong}, {"cancelled": wrong}):
            self.rejects(KeyError, "mine", vellum.bake, mesh(), level=3, **callbacks)
        polls = []
        self.rejects(ZeroDivisionError, "zero", vellum.bake, long_bake(), level=12,
                     cancelled=lambda: polls.append(0) or len(polls) > 1 and 1 / 0)
        self.assertEqual(len(baked(mesh())[0]), 2)

    def test_threads_run_while_it_bakes_and_cancel_it(self):
        done, polls = threading.Event(), []
        thread = threading.Thread(target=lambda: (sum(range(10**6)), done.set()))

        def cancelled():
            polls.append(0)
            if len(polls) == 2:  # the first is before the bake
                thread.start()
            return done.is_set()

        self.rejects(vellum.Cancelled, "cancelled", vellum.bake, long_bake(), level=12, cancelled=cancelled)
        thread.join()
        self.rejects(vellum.Cancelled, "cancelled", vellum.bake, mesh(), cancelled=lambda: True)

    def test_interrupts(self):
        timer = threading.Timer(0.3, _thread.interrupt_main)
        timer.start()
        self.rejects(KeyboardInterrupt, "", vellum.bake, long_bake(), level=12)
        timer.join()
        self.assertEqual([thread for thread in threading.enumerate() if thread.name == "vellum"], [])
        # As a terminal does it, in a program of its own.
        child = subprocess.Popen([sys.executable, __file__, LIBRARIES, COMMAND, "bake long"], stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE, text=True)
        try:
            self.assertEqual(child.stdout.readline(), "begins\n")
            threading.Event().wait(0.3)
            child.send_signal(signal.SIGINT)
            _, errors = child.communicate(timeout=100)
        finally:
            child.kill()
        self.assertTrue(errors.strip().endswith("KeyboardInterrupt"), errors)
        self.assertEqual(child.returncode, -signal.SIGINT)

    def test_many_threads(self):
        expected, found = baked(mesh()), []
        threads = [threading.Thread(target=lambda: found.append([baked(mesh(), threads=2) for _ in range(20)])) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(found, [[expected] * 20] * 4)


class Files(Case):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="vellum-python-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.tree = cls.folder / "tree.glb"
        subprocess.run([sys.executable, ROOT / "examples/python/tree.py", cls.tree], check=True)
        cls.bytes = cls.tree.read_bytes()
        cls.command("bake", "--quiet", cls.tree, cls.folder / "tree.omm.glb")
        cls.baked = (cls.folder / "tree.omm.glb").read_bytes()

    @staticmethod
    def parts_of(glb):
        size = struct.unpack_from("<I", glb, 12)[0]
        return json.loads(glb[20:20 + size]), glb[28 + size:]

    @staticmethod
    def command(*words):
        return subprocess.run([COMMAND, *words], check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True).stdout

    def test_files_have_the_bytes_of_the_command(self):
        native = self.folder / "native.glb"
        for flags, options in (([], {}), (["--level", "3"], {"level": 3}), (["--states", "2"], {"format": 1}),
                               (["--budget", "20000"], {"budget": 20000}), (["--exact"], {
                                   name: 0 for name in vellum.BakeOptions.__optional_keys__ if name.endswith("_tolerance")})):
            self.command("bake", "--quiet", "--force", *flags, self.tree, native)
            made, report = vellum.bake_gltf(self.bytes, **options)
            self.assertEqual(made, native.read_bytes(), flags)
            self.assertEqual((report.input_size, report.output_size), (len(self.bytes), len(made)))
            self.assertEqual((report.micromap_count, report.primitive_count, report.skipped, report.replaced), (1, 1, [], False))
            output = self.folder / "output.glb"
            self.assertEqual(vellum.bake_gltf_file(self.tree, output, **options), report)
            self.assertEqual(output.read_bytes(), made)
        given = bytearray(self.baked)
        self.assertTrue(vellum.bake_gltf(given, progress=lambda *_: False)[1].replaced)
        given.append(0)  # nothing refers to its memory any more

    def test_bakes_have_the_bytes_of_the_command(self):
        """The texture and the coordinates of the file, by bake()."""
        document, binary = self.parts_of(self.bytes)

        def view(number):
            one = document["bufferViews"][number]
            return binary[one["byteOffset"]:one["byteOffset"] + one["byteLength"]]

        png = view(document["images"][0]["bufferView"])
        rows = zlib.decompress(png[41:-16])  # one chunk, without filters
        leaves = document["meshes"][0]["primitives"][1]
        uvs, indices = (view(document["accessors"][number]["bufferView"])
                        for number in (leaves["attributes"]["TEXCOORD_0"], leaves["indices"]))
        image = vellum.Texture(rows, 256, 256, offset=4, pixel_stride=4, row_stride=1025, address_mode_u=EDGE, address_mode_v=EDGE)
        micromap = vellum.bake(vellum.BakeInput(image, uvs, memoryview(indices).cast("I"), uv_format=vellum.Format.R32G32_SFLOAT))
        stored = vellum.read_gltf(self.baked)
        self.assertGreater(len(micromap.data), 1000)
        self.assertEqual(stored.micromaps, [vellum._gltf.GltfMicromap(micromap.data, micromap.triangles, micromap.usages)])
        self.assertEqual(stored.primitives[0].indices, micromap.indices)

    def test_read(self):
        for file in (self.baked, self.folder / "tree.omm.glb", str(self.folder / "tree.omm.glb"), bytearray(self.baked)):
            read = vellum.read_gltf(file)
            self.assertEqual(read.extension, "EXT_mesh_opacity_micromap")
            primitive, = read.primitives
            self.assertEqual((primitive.name, primitive.mesh, primitive.primitive, primitive.micromap),
                             ('mesh 0 "tree" primitive 1', 0, 1, 0))
            self.assertEqual(max(primitive.indices) + 1, len(read.micromaps[0].triangles) // 8)
        self.assertEqual(vellum.read_gltf(self.bytes), vellum.Gltf("", [], []))

    def test_check(self):
        self.assertEqual(vellum.check_gltf(self.baked), [])
        self.assertEqual(vellum.check_gltf(self.folder / "tree.omm.glb"), [])
        broken = re.sub(rb'"usageLevels":\[\d', b'"usageLevels":[9', self.baked)
        self.assertNotEqual(broken, self.baked)
        finding = vellum.check_gltf(broken)[0]
        self.assertTrue(finding.place and finding.message)
        self.assertEqual(vellum.check_gltf(broken, 0), [])
        self.rejects(ValueError, "most is -1", vellum.check_gltf, broken, -1)
        self.fails(vellum.Result.ERROR_FILE, "leaf.glb: ", vellum.read_gltf, broken, name="leaf.glb")

    def test_damaged_files_are_errors(self):
        for length in (0, 1, 11, 12, 20, 1000, len(self.baked) - 1):
            for function in (vellum.read_gltf, vellum.check_gltf, vellum.bake_gltf):
                self.fails(vellum.Result.ERROR_FILE, "^input: ", function, self.baked[:length])
        self.fails(vellum.Result.ERROR_FILE, "absent.glb", vellum.read_gltf, self.folder / "absent.glb")
        self.fails(vellum.Result.ERROR_FILE, "absent.glb", vellum.bake_gltf_file, self.folder / "absent.glb", self.folder / "a.glb")
        self.fails(vellum.Result.ERROR_FILE, "tree.glb", vellum.bake_gltf_file, self.folder / "tree.omm.glb", self.tree / "a.glb")
        self.rejects(ValueError, "null character", vellum.read_gltf, "tree.glb\0.txt")
        self.rejects(TypeError, "file: expected bytes", vellum.bake_gltf, [1])

    def test_copies_are_replaced_on_request(self):
        document, binary = self.parts_of(self.bytes)
        document["buffers"][0]["uri"] = "copied.bin"
        (self.folder / "copied").mkdir()
        (self.folder / "copied.gltf").write_text(json.dumps(document))
        arguments = self.folder / "copied.gltf", self.folder / "copied/tree.gltf"
        (self.folder / "copied.bin").write_bytes(binary)
        vellum.bake_gltf_file(*arguments)
        (self.folder / "copied.bin").write_bytes(binary + b"more")
        self.fails(vellum.Result.ERROR_FILE, "copied.bin: is there already", vellum.bake_gltf_file, *arguments)
        vellum.bake_gltf_file(*arguments, replace_copies=True)
        self.assertEqual((self.folder / "copied/copied.bin").read_bytes(), binary + b"more")

    def test_cancelled_bakes_write_nothing(self):
        output = self.folder / "cancelled.glb"
        for callbacks in ({"progress": lambda *_: True}, {"cancelled": lambda: True}):
            self.rejects(vellum.Cancelled, "cancelled", vellum.bake_gltf_file, self.tree, output, **callbacks)
            self.rejects(vellum.Cancelled, "cancelled", vellum.bake_gltf, self.bytes, **callbacks)

        def fails_at_the_end(done, total):
            if done == total:
                raise KeyError("mine")
        self.rejects(KeyError, "mine", vellum.bake_gltf_file, self.tree, output, progress=fails_at_the_end)
        self.assertEqual(sorted(path.name for path in self.folder.iterdir() if path.name.startswith("cancelled")), [])

    def test_cache(self):
        cache = {}
        made, report = vellum.bake_gltf(self.bytes, cache=cache)
        self.assertEqual((report.cache_hits, report.cache_misses, len(cache)), (0, 1, 1))
        key, = cache
        self.assertEqual(len(key), 32)
        again, report = vellum.bake_gltf(self.bytes, cache=cache)
        self.assertEqual((again, report.cache_hits, report.cache_misses), (made, 1, 0))
        cache[key] = cache[key][:-1]
        again, report = vellum.bake_gltf(self.bytes, cache=cache)
        self.assertEqual((again, report.cache_hits, report.cache_misses), (made, 0, 1))

        class Broken(dict):
            def __setitem__(self, key, value):
                raise OSError("disk")
        self.rejects(OSError, "disk", vellum.bake_gltf, self.bytes, cache=Broken())
        self.rejects(TypeError, "bytes-like", vellum.bake_gltf, self.bytes, cache={key: "text"})

    def test_options(self):
        for options in ({"excluded_materials": ["nothing", "lea*"]}, {"excluded_meshes": ["tree"]}):
            _, report = vellum.bake_gltf(self.bytes, **options)
            self.assertEqual((report.primitive_count, [note.place for note in report.skipped]), (0, ['mesh 0 "tree" primitive 1']))
        document, binary = self.parts_of(self.bytes)
        document["materials"][1]["alphaMode"] = "BLEND"
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        blend = struct.pack("<4sIII4s", b"glTF", 2, 28 + len(text) + len(binary), len(text), b"JSON") + text + struct.pack(
            "<I4s", len(binary), b"BIN\0") + binary
        self.assertEqual(len(vellum.bake_gltf(blend)[1].skipped), 1)
        exact, report = vellum.bake_gltf(blend, blend=True, level=4)
        self.assertEqual(report.primitive_count, 1)
        mask, report = vellum.bake_gltf(blend, blend_cutoff=0.5, level=4)
        self.assertEqual(report.primitive_count, 1)
        self.assertNotEqual(vellum.read_gltf(exact).micromaps, vellum.read_gltf(mask).micromaps)
        self.assertEqual(vellum.read_gltf(mask).micromaps, vellum.read_gltf(vellum.bake_gltf(self.bytes, level=4)[0]).micromaps)
        known = [vellum.bake_gltf(self.bytes, target_known=share, level=4)[1].micromap_size for share in (0, 0.4, 0.5)]
        self.assertEqual(sorted(set(known)), known)
        self.fails(vellum.Result.ERROR_FILE, "the wanted share is not reached", vellum.bake_gltf, self.bytes, target_known=1, level=4)
        self.fails(vellum.Result.ERROR_INVALID_ARGUMENT, "targetKnown", vellum.bake_gltf, self.bytes, target_known=2)
        document["materials"][1]["alphaMode"] = "MASK"
        document["images"].append({"uri": "leaf.ktx2"})
        document["textures"][0]["extensions"] = {"KHR_texture_basisu": {"source": len(document["images"]) - 1}}
        document["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
        both = json.dumps(document).encode()
        self.assertIn("an image that is not supported", vellum.bake_gltf(both)[1].skipped[0].message)
        self.assertEqual(vellum.bake_gltf(both, fallback_images=True)[1].primitive_count, 1)
        self.rejects(TypeError, "there is no option 'compare_op'", vellum.bake_gltf, self.bytes, compare_op=1)
        self.rejects(TypeError, "excluded_meshes is a string", vellum.bake_gltf, self.bytes, excluded_meshes="tree")
        self.fails(vellum.Result.ERROR_INVALID_ARGUMENT, "level is 13", vellum.bake_gltf, self.bytes, level=13)
        self.fails(vellum.Result.ERROR_INVALID_ARGUMENT, "blendCutoff", vellum.bake_gltf, self.bytes, blend_cutoff=float("nan"))


class Modules(Case):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="vellum-python-")
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        shader = cls.folder / "query.comp"
        shader.write_text("#version 460\n#extension GL_EXT_ray_query : require\n"
                          "layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;\n"
                          "void main()\n{\n    rayQueryEXT query;\n"
                          "    rayQueryInitializeEXT(query, scene, 0, 255, vec3(0), 0.0, vec3(1), 1.0);\n"
                          "    rayQueryProceedEXT(query);\n}\n")
        subprocess.run(["glslangValidator", "-V", "--target-env", "vulkan1.2", shader, "-o", cls.folder / "query.spv"], check=True,
                       stdout=subprocess.DEVNULL)
        cls.words = (cls.folder / "query.spv").read_bytes()

    def test_edits_are_those_of_the_command(self):
        plain = vellum.edit_spirv(self.words, vellum.SpirvEdit.NONE)
        self.assertEqual((plain.words, plain.changed), (self.words, False))
        entry, = plain.entry_points
        self.assertEqual(entry, ("main", 5, True, False, vellum.SpirvMode.ABSENT, 0, False))
        for flags, arguments, mode in (
                (["--enable-micromaps"], {}, vellum.SpirvMode.TRUE),
                (["--enable-micromaps", "--entry", "main"], {"entry_points": ["main"]}, vellum.SpirvMode.TRUE),
                (["--enable-micromaps=7", "--default", "true"], {"edit": vellum.SpirvEdit.ENABLE_BY_CONSTANT, "constant_id": 7,
                                                                "constant_default": True}, vellum.SpirvMode.CONSTANT)):
            output = self.folder / "edited.spv"
            Files.command("spirv", *flags, self.folder / "query.spv", "-o", output)
            edited = vellum.edit_spirv(self.words, **arguments)
            self.assertEqual(edited.words, output.read_bytes())
            self.assertTrue(edited.changed)
            self.assertIs(edited.entry_points[0].mode, mode)
            self.assertEqual(edited.entry_points[0][5:], (7, True) if mode == vellum.SpirvMode.CONSTANT else (0, False))
            disabled = vellum.edit_spirv(array("I", edited.words), vellum.SpirvEdit.DISABLE)
            self.assertEqual(disabled.entry_points, plain.entry_points)

    def test_errors(self):
        invalid = vellum.Result.ERROR_INVALID_ARGUMENT
        self.fails(invalid, "nothing", vellum.edit_spirv, self.words, entry_points=["nothing"])
        self.rejects(TypeError, "entry_points is a string", vellum.edit_spirv, self.words, entry_points="main")
        for length in (0, 4, 20, len(self.words) - 4):
            self.fails(invalid, ".", vellum.edit_spirv, self.words[:length])
        self.rejects(ValueError, "words has 7 bytes", vellum.edit_spirv, self.words[:7])
        self.rejects(TypeError, "words is uint16, expected uint32", vellum.edit_spirv, array("H", self.words))
        self.fails(invalid, "edit", vellum.edit_spirv, self.words, 9)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where a shell starts this in the background
    if sys.argv[3:] == ["bake long"]:
        print("begins", flush=True)
        vellum.bake(long_bake(), level=12)
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
