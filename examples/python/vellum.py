# SPDX-License-Identifier: Apache-2.0
"""libvellum for Python, by ctypes: no build, no packages. vellum/vellum.h describes every member and function.

    import vellum
    texture = vellum.Texture(texels=rgba, width=64, height=64, offset=3, pixelStride=4)
    mesh = vellum.BakeInput(textures=[texture], uvs=array("f", ...), indices=array("I", ...))
    micromap = vellum.bake([mesh], level=5)

Numbers go into members by name, whatever supports the buffer protocol (bytes, array, numpy arrays) into pointers. The
type of their elements must be right: nothing is converted. numpy's own is float64 and int64; asarray(..., "f4") is right.
The library is $VELLUM_LIBRARY, or what the system's loader finds.
"""
import ctypes
import os
from ctypes import POINTER, byref, c_char_p, c_double, c_float, c_int, c_int32, c_size_t, c_uint8, c_uint16, c_uint32
from ctypes import c_uint64, c_void_p, sizeof

SUCCESS, CANCELLED = 0, 1
FORMAT_R8_UNORM, FORMAT_R16_UNORM, FORMAT_R16_SFLOAT, FORMAT_R32_SFLOAT = 9, 70, 76, 100
FORMAT_R16G16_UNORM, FORMAT_R16G16_SFLOAT, FORMAT_R32G32_SFLOAT = 77, 83, 103
REPEAT, MIRRORED_REPEAT, CLAMP_TO_EDGE, CLAMP_TO_BORDER, MIRROR_CLAMP_TO_EDGE = range(5)
FILTER_NEAREST, FILTER_LINEAR = 0, 1
INDEX_TYPES = {1: 1000265000, 2: 0, 4: 1}  # by bytes of an index
COMPARE_LESS, COMPARE_LESS_OR_EQUAL, COMPARE_GREATER, COMPARE_GREATER_OR_EQUAL = 1, 3, 4, 6
TWO_STATE, FOUR_STATE = 1, 2
TRANSPARENT, OPAQUE, UNKNOWN_TRANSPARENT, UNKNOWN_OPAQUE = range(4)

MESSAGE = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p)
PROGRESS = ctypes.CFUNCTYPE(c_int, c_void_p, c_uint64, c_uint64)
CANCEL = ctypes.CFUNCTYPE(c_int, c_void_p)


class Error(Exception):
    """result is the VellumResult."""

    def __init__(self, result, message):
        super().__init__(message or library.vellumResultName(result).decode())
        self.result = result


# The elements that are right for a format: kinds, and their bytes.
_ELEMENTS = {FORMAT_R8_UNORM: ("u", 1), FORMAT_R16_UNORM: ("u", 2), FORMAT_R16_SFLOAT: ("f", 2),
             FORMAT_R32_SFLOAT: ("f", 4), FORMAT_R16G16_UNORM: ("u", 2), FORMAT_R16G16_SFLOAT: ("f", 2),
             FORMAT_R32G32_SFLOAT: ("f", 4)}
_KINDS = {**dict.fromkeys("BHILQN", "u"), **dict.fromkeys("bhilqn", "i"), **dict.fromkeys("efdg", "f")}


def _buffer(value):
    """The address and size of a buffer, which must be kept as long as they are used."""
    view = memoryview(value)
    if not view.c_contiguous:
        raise TypeError("a buffer whose elements are not one after another; a numpy array: numpy.ascontiguousarray()")
    data = view.tobytes()
    kept = (c_uint8 * len(data)).from_buffer_copy(data)
    return kept, len(data)


def _element(value):
    """Kind and bytes of a buffer's elements: ("f", 8) is float64. Those of another byte order have no kind."""
    view = memoryview(value)
    code = view.format[1:] if view.format[0] in "@=<" else view.format
    return _KINDS.get(code, view.format), view.itemsize


def _nameOf(element):
    kind, size = element
    return {"u": "uint", "i": "int", "f": "float"}.get(kind, f"'{kind}' of ") + str(8 * size)


def _requireElements(name, value, allowed):
    """Bytes would be misread if they were of another type."""
    element = _element(value)
    if element not in allowed:
        raise TypeError(f"{name} are {_nameOf(element)}, expected {' or '.join(map(_nameOf, allowed))}")


class Texture(ctypes.Structure):
    _fields_ = [("structSize", c_size_t), ("texels", c_void_p), ("texelsSize", c_size_t), ("width", c_uint32),
                ("height", c_uint32), ("format", c_uint32), ("filter", c_uint32), ("addressModeU", c_uint32),
                ("addressModeV", c_uint32), ("offset", c_size_t), ("pixelStride", c_size_t), ("rowStride", c_size_t),
                ("scale", c_float), ("border", c_float)]

    def __init__(self, texels, **members):
        library.vellumInitTexture(byref(self), sizeof(self))
        # Bytes can be any format's.
        format = members.get("format", FORMAT_R8_UNORM)
        if format in _ELEMENTS:
            _requireElements("texels", texels, [_ELEMENTS[format]] + [("u", 1)] * (_ELEMENTS[format] != ("u", 1)))
        self._texels, self.texelsSize = _buffer(texels)
        self.texels = ctypes.addressof(self._texels)
        for name, value in members.items():
            _set(self, name, value)


class BakeInput(ctypes.Structure):
    _fields_ = [("structSize", c_size_t), ("textures", POINTER(Texture)), ("textureCount", c_size_t),
                ("uvs", c_void_p), ("uvsSize", c_size_t), ("uvStride", c_size_t), ("indices", c_void_p),
                ("indicesSize", c_size_t), ("triangleCount", c_size_t), ("uvFormat", c_uint32),
                ("indexType", c_uint32), ("uvTransform", c_float * 6), ("levels", c_void_p), ("formats", c_void_p),
                ("cutoff", c_double)]

    def __init__(self, textures, uvs, indices=None, **members):
        """uvs: two numbers of uvFormat (float32 without it) for each vertex, or its bytes. indices: three for each
        triangle, integers of 1, 2 or 4 bytes; or none."""
        library.vellumInitBakeInput(byref(self), sizeof(self))
        self._kept = [list(textures)]
        self.textures = (Texture * len(textures))(*textures)
        self.textureCount = len(textures)
        format = members.get("uvFormat", FORMAT_R32G32_SFLOAT)
        if format not in (FORMAT_R16G16_UNORM, FORMAT_R16G16_SFLOAT, FORMAT_R32G32_SFLOAT):
            raise ValueError(f"uvFormat {format} is not a format of texture coordinates")
        _requireElements("uvs", uvs, [_ELEMENTS[format], ("u", 1)])
        kept, self.uvsSize = _buffer(uvs)
        self._kept.append(kept)
        self.uvs = ctypes.addressof(kept)
        vertexBytes = 2 * _ELEMENTS[format][1]
        stride = members.get("uvStride", 0) or vertexBytes
        vertices = 1 + (self.uvsSize - vertexBytes) // stride if self.uvsSize >= vertexBytes else 0
        if indices is None and vertices % 3 != 0:
            raise ValueError(f"{vertices} vertices are no whole number of triangles")
        self.triangleCount = vertices // 3
        if indices is not None:
            _requireElements("indices", indices, [(kind, size) for size in (1, 2, 4) for kind in "ui"])
            size = memoryview(indices).itemsize
            kept, self.indicesSize = _buffer(indices)
            self._kept.append(kept)
            self.indices = ctypes.addressof(kept)
            self.indexType = INDEX_TYPES[size]
            if self.indicesSize % (3 * size) != 0:
                raise ValueError(f"{self.indicesSize // size} indices are no whole number of triangles")
            self.triangleCount = self.indicesSize // size // 3
        for name, value in members.items():
            if name in ("levels", "formats"):
                _requireElements(name, value, [("u", 1)])
                kept, count = _buffer(value)
                if count != self.triangleCount:
                    raise ValueError(f"{count} {name} for {self.triangleCount} triangles")
                self._kept.append(kept)
                value = ctypes.addressof(kept)
            elif name == "uvTransform":
                value = (c_float * 6)(*value)
            _set(self, name, value)


class BakeOptions(ctypes.Structure):
    _fields_ = [("structSize", c_size_t), ("format", c_uint32), ("twoStateRule", c_uint32), ("level", c_int32),
                ("maxLevel", c_uint32), ("texelsPerEdge", c_double), ("compareOp", c_uint32), ("flags", c_uint32),
                ("budget", c_uint64), ("minKnown", c_double), ("valueTolerance", c_double),
                ("subtexelTolerance", c_double), ("barycentricTolerance", c_double),
                ("interpolationTolerance", c_double), ("maxDataSize", c_uint64), ("threads", c_uint32),
                ("reserved", c_uint32), ("message", MESSAGE), ("progress", PROGRESS), ("cancelled", CANCEL),
                ("userData", c_void_p)]


class MicromapTriangle(ctypes.Structure):
    _fields_ = [("dataOffset", c_uint32), ("subdivisionLevel", c_uint16), ("format", c_uint16)]


class MicromapUsage(ctypes.Structure):
    _fields_ = [("count", c_uint32), ("subdivisionLevel", c_uint32), ("format", c_uint32)]


class MicromapInfo(ctypes.Structure):
    _fields_ = [("structSize", c_size_t), ("data", POINTER(c_uint8)), ("dataSize", c_size_t),
                ("triangles", POINTER(MicromapTriangle)), ("triangleCount", c_size_t),
                ("usages", POINTER(MicromapUsage)), ("usageCount", c_size_t), ("indices", POINTER(c_int32)),
                ("indexCount", c_size_t), ("stateCounts", c_uint64 * 4), ("specialCounts", c_uint64 * 4),
                ("distinctCount", c_uint64)]


class Micromap:
    """data: bytes; indices: ints; triangles, usages: structures; stateCounts, specialCounts: by state."""

    def __init__(self, handle):
        self._handle = handle
        info = MicromapInfo(structSize=sizeof(MicromapInfo))
        _check(library.vellumGetMicromapInfo(handle, byref(info)))
        self.data = ctypes.string_at(info.data, info.dataSize) if info.dataSize else b""
        # The pointers become invalid with the handle.
        self.triangles = [MicromapTriangle.from_buffer_copy(t) for t in info.triangles[:info.triangleCount]]
        self.usages = [MicromapUsage.from_buffer_copy(usage) for usage in info.usages[:info.usageCount]]
        self.indices = info.indices[:info.indexCount]
        self.stateCounts = list(info.stateCounts)
        self.specialCounts = list(info.specialCounts)
        self.distinctCount = info.distinctCount

    def __del__(self):
        library.vellumDestroyMicromap(self._handle)

    def state(self, triangle, u, v):
        state = c_uint32()
        _check(library.vellumGetState(self._handle, triangle, u, v, byref(state)))
        return state.value


def bake(inputs, progress=None, **members):
    """One micromap for a list of BakeInput. members: of BakeOptions.

    progress(done, total), which may return True to cancel, is called from the library's threads.
    """
    options = BakeOptions()
    library.vellumInitBakeOptions(byref(options), sizeof(options))
    for name, value in members.items():
        _set(options, name, value)
    messages = []
    options.message = MESSAGE(lambda data, result, text: messages.append(text.decode()))
    if progress is not None:
        options.progress = PROGRESS(lambda data, done, total: 1 if progress(done, total) else 0)
    handle = c_void_p()
    array = (BakeInput * len(inputs))(*inputs)
    result = library.vellumBake(array, len(inputs), byref(options), byref(handle))
    _check(result, "".join(messages))
    return Micromap(handle)


def _set(structure, name, value):
    if name not in dict(structure._fields_):
        raise TypeError(f"{type(structure).__name__} has no member {name}")
    setattr(structure, name, value)


def _check(result, message=""):
    if result != SUCCESS:
        raise Error(result, message)


def _load():
    loaded = ctypes.CDLL(os.environ.get("VELLUM_LIBRARY", "libvellum.so.0.1"))
    for name, result, arguments in (
            ("vellumGetVersion", c_uint32, []),
            ("vellumResultName", c_char_p, [c_int]),
            ("vellumInitTexture", None, [c_void_p, c_size_t]),
            ("vellumInitBakeInput", None, [c_void_p, c_size_t]),
            ("vellumInitBakeOptions", None, [c_void_p, c_size_t]),
            ("vellumBake", c_int, [c_void_p, c_size_t, c_void_p, POINTER(c_void_p)]),
            ("vellumDestroyMicromap", None, [c_void_p]),
            ("vellumGetMicromapInfo", c_int, [c_void_p, c_void_p]),
            ("vellumGetState", c_int, [c_void_p, c_size_t, c_float, c_float, POINTER(c_uint32)])):
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


library = _load()
