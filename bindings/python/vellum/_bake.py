# SPDX-License-Identifier: Apache-2.0
"""The baker: vellum/vellum.h."""
from __future__ import annotations

import ctypes
import weakref
from ctypes import byref, c_uint32, sizeof
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Callable, Iterable, TypedDict, TypeVar, Unpack, cast

from . import _native
from ._buffers import Element, Memory, element_of, require_element, require_shape, view_of

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class Format(IntEnum):
    """Values of VkFormat: of texels (one channel) and of texture coordinates (two)."""

    R8_UNORM = 9
    R16_UNORM = 70
    R16_SFLOAT = 76
    R16G16_UNORM = 77
    R16G16_SFLOAT = 83
    R32_SFLOAT = 100
    R32G32_SFLOAT = 103


class Filter(IntEnum):
    """Values of VkFilter."""

    NEAREST = 0
    LINEAR = 1


class AddressMode(IntEnum):
    """Values of VkSamplerAddressMode."""

    REPEAT = 0
    MIRRORED_REPEAT = 1
    CLAMP_TO_EDGE = 2
    CLAMP_TO_BORDER = 3
    MIRROR_CLAMP_TO_EDGE = 4


class MicromapFormat(IntEnum):
    """Values of VkOpacityMicromapFormatKHR."""

    TWO_STATE = 1
    FOUR_STATE = 2


class CompareOp(IntEnum):
    """Values of VkCompareOp. A sample is opaque if "alpha op cutoff" is true."""

    LESS = 1
    LESS_OR_EQUAL = 3
    GREATER = 4
    GREATER_OR_EQUAL = 6


class TwoStateRule(IntEnum):
    """What a micro-triangle in 2-state data is if the alpha test has both outcomes in it; NEAREST: that of the larger area."""

    NEAREST = 0
    UNKNOWN_IS_OPAQUE = 1
    UNKNOWN_IS_TRANSPARENT = 2


class State(IntEnum):
    """The states of 4-state data, 2 bits each; 2-state data has the first two, 1 bit each."""

    TRANSPARENT = 0
    OPAQUE = 1
    UNKNOWN_TRANSPARENT = 2
    UNKNOWN_OPAQUE = 3


class SpecialIndex(IntEnum):
    """The index of a triangle that has one state and no data."""

    FULLY_TRANSPARENT = -1
    FULLY_OPAQUE = -2
    FULLY_UNKNOWN_TRANSPARENT = -3
    FULLY_UNKNOWN_OPAQUE = -4


LEVEL_AUTOMATIC = -1
NO_BUDGET = 2**64 - 1
_INDEX_TYPES = {1: 1000265000, 2: 0, 4: 1}  # VkIndexType by bytes of an index
_DISALLOW_MIXED_SPECIAL_INDICES = 1

T = TypeVar("T")
_BYTES: Element = ("u", 1)
_ALPHA = {("u", 1): Format.R8_UNORM, ("u", 2): Format.R16_UNORM, ("f", 2): Format.R16_SFLOAT, ("f", 4): Format.R32_SFLOAT}
_UVS = {("f", 4): Format.R32G32_SFLOAT, ("f", 2): Format.R16G16_SFLOAT, ("u", 2): Format.R16G16_UNORM}


class QualityOptions(TypedDict, total=False):
    """Options of all bakes.

    format: a MicromapFormat; default FOUR_STATE.
    two_state_rule: a TwoStateRule; default NEAREST.
    level: subdivision level, 0 to 12, or LEVEL_AUTOMATIC, the default.
    max_level: the highest automatic level, 0 to 12; default 8.
    texels_per_edge: for automatic levels, the edges of micro-triangles in texels, 0 or more; default 4.
    budget: the most bytes of data, with 8 for each micromap triangle; default NO_BUDGET.
    min_known: share of a 4-state triangle that must be known for it to get data, 0 to 1; default 0.
    value_tolerance: of a filtered value, 0 or more; default 2/255.
    subtexel_tolerance: in texels, 0 to 1024; default 1/16.
    barycentric_tolerance: in barycentrics, 0 to 1; default 1e-5.
    interpolation_tolerance: relative to the largest coordinate, 0 to 2^-10; default 2^-20.
    max_data_size: bytes of data, at most 2^32 - 1, above which a bake fails; default 2^30.
    threads: 1 to 1024; 0, the default: one for each processor.
    """

    format: int
    two_state_rule: int
    level: int
    max_level: int
    texels_per_edge: float
    budget: int
    min_known: float
    value_tolerance: float
    subtexel_tolerance: float
    barycentric_tolerance: float
    interpolation_tolerance: float
    max_data_size: int
    threads: int


class BakeOptions(QualityOptions, total=False):
    """Options of bake(), in addition to QualityOptions.

    compare_op: a CompareOp; default GREATER_OR_EQUAL.
    disallow_mixed_special_indices: either all triangles of an input have special indices or none has; default False.
    """

    compare_op: int
    disallow_mixed_special_indices: bool


def set_options(options: _native.BakeOptions, allowed: frozenset[str], members: dict[str, Any]) -> None:
    for name in members:
        if name not in allowed:
            raise TypeError(f"there is no option {name!r}; there are {', '.join(sorted(allowed))}")
    members = dict(members)
    if members.pop("disallow_mixed_special_indices", False):
        members["flags"] = _DISALLOW_MIXED_SPECIAL_INDICES
    _native.set_members(options, **members)


def list_of(name: str, kind: type[T], given: T | Iterable[T]) -> list[T]:
    """What may be one or several."""
    found = [given] if isinstance(given, kind) else list(cast(Iterable[T], given))
    for one in found:
        if not isinstance(one, kind):
            raise TypeError(f"{name}: expected {kind.__name__}, or a list of them, not {type(one).__name__}")
    return found


class Texture:
    """The alpha of one mip level of an image, and how a sampler reads it. Row 0 is at v = 0.

    alpha: either of two.
        Two dimensions, (height, width): one value for each texel, such as image[:, :, 3] of a numpy array. Any strides.
        One dimension: texel (x, y) is at byte offset + y * row_stride + x * pixel_stride. `width` and `height` are needed.
        Of 8-bit RGBA: offset=3, pixel_stride=4.
    width, height: texels, 1 to 2^24.
    format: a Format of one channel; default R8_UNORM for elements of uint8, R16_UNORM for uint16, R16_SFLOAT for float16,
        R32_SFLOAT for float32. No others are read; with one dimension, uint8 may also be the bytes of another format.
    filter: a Filter. address_mode_u, address_mode_v: an AddressMode each.
    offset: bytes. pixel_stride: bytes, at least those of a value; 0: exactly those.
    row_stride: bytes, at least width * pixel_stride; 0: exactly that.
    scale: factor on alpha, such as glTF's baseColorFactor[3].
    border: alpha outside of the texture with CLAMP_TO_BORDER, before `scale`.

    Raises TypeError for elements of another type, ValueError for another shape or a number that cannot be one. Other ranges
    are checked by bake(). The memory of `alpha` must not change before that.
    """

    def __init__(self, alpha: ReadableBuffer, width: int | None = None, height: int | None = None, *,
                 format: int | None = None, filter: int = Filter.LINEAR, address_mode_u: int = AddressMode.REPEAT,
                 address_mode_v: int = AddressMode.REPEAT, offset: int = 0, pixel_stride: int = 0, row_stride: int = 0,
                 scale: float = 1.0, border: float = 0.0) -> None:
        view = view_of("alpha", alpha)
        if view.ndim == 2 and view.shape is not None:
            if (height, width) not in ((None, None), view.shape):
                raise ValueError(f"alpha has the shape {view.shape}, not (height, width), which is {(height, width)}")
            if offset or pixel_stride or row_stride:
                raise ValueError("offset, pixel_stride and row_stride are for alpha of one dimension")
            height, width = view.shape
        elif view.ndim != 1:
            raise ValueError(f"alpha has the shape {view.shape}, expected (height, width) of one channel, "
                             "such as image[:, :, 3], or (n,)")
        if width is None or height is None:
            raise ValueError("alpha of one dimension needs width and height")
        if format is None:
            format = _ALPHA[require_element("alpha", view, _ALPHA)]
        else:
            elements = [element for element, its_format in _ALPHA.items() if its_format == format]
            if not elements:
                raise ValueError(f"format {format} is not a format of texels")
            require_element("alpha", view, elements + [_BYTES] * (view.ndim == 1))
        self._memory = Memory(view)
        self.structure = _native.Texture()
        _native.library("vellum").vellumInitTexture(byref(self.structure), sizeof(self.structure))
        _native.set_members(
            self.structure, texels=self._memory.address, texels_size=self._memory.size, width=width, height=height,
            format=format, filter=filter, address_mode_u=address_mode_u, address_mode_v=address_mode_v, offset=offset,
            pixel_stride=pixel_stride, row_stride=row_stride)
        _native.set_members(self.structure, scale=scale, border=border)


class BakeInput:
    """Triangles that are alpha-tested with one texture and cutoff: a geometry, or part of one.

    textures: a Texture, or the mip levels that the sampler may read, largest first.
    uvs: the texture coordinates of each vertex, (n, 2), or (2 n,) one after the other. Elements: float32 or float16; uint16
        with the uv_format R16G16_UNORM; or, in one dimension, the bytes of `uv_format`. float64 is rejected, as it would
        have to be rounded.
    indices: three for each triangle, (n, 3) or (3 n,), of 1, 2 or 4 bytes; int64 is rejected. None: each three vertices are
        a triangle.
    uv_format: a Format of two channels; default: that of the elements.
    uv_stride: bytes from vertex to vertex, for uvs of one dimension; 0: those of u and v.
    uv_transform: six numbers m, a row-major 2 x 3 matrix: (u, v) becomes (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]).
    levels: the subdivision level of each triangle, uint8, 0 to 12; None: that of the options.
    formats: the MicromapFormat of each triangle, uint8; None: that of the options.
    cutoff: alpha is compared with it; not NaN.

    Raises as Texture does. The memory must not change before bake() returns.
    """

    def __init__(self, textures: Texture | Iterable[Texture], uvs: ReadableBuffer, indices: ReadableBuffer | None = None, *,
                 uv_format: int | None = None, uv_stride: int = 0, uv_transform: Iterable[float] | None = None,
                 levels: ReadableBuffer | None = None, formats: ReadableBuffer | None = None, cutoff: float = 0.5) -> None:
        self._textures = list_of("textures", Texture, textures)
        self.structure = _native.BakeInput()
        _native.library("vellum").vellumInitBakeInput(byref(self.structure), sizeof(self.structure))
        self.structure.textures = (_native.Texture * len(self._textures))(*(t.structure for t in self._textures))
        self.structure.texture_count = len(self._textures)
        _native.set_members(self.structure, uv_stride=uv_stride, cutoff=cutoff)
        vertices = self._set_uvs(view_of("uvs", uvs), uv_format, uv_stride)
        self._indices: Memory | None = None
        if indices is not None:
            self.structure.triangle_count = self._set_indices(view_of("indices", indices))
        elif vertices % 3 != 0:
            raise ValueError(f"{vertices} vertices are no whole number of triangles")
        else:
            self.structure.triangle_count = vertices // 3
        if uv_transform is not None:
            numbers = list(uv_transform)
            if len(numbers) != 6:
                raise ValueError(f"uv_transform has {len(numbers)} numbers, not 6")
            self.structure.uv_transform = (ctypes.c_float * 6)(*numbers)
        self._levels = self._set_of_triangles("levels", levels)
        self._formats = self._set_of_triangles("formats", formats)

    @property
    def triangle_count(self) -> int:
        count: int = self.structure.triangle_count
        return count

    def _set_uvs(self, view: memoryview, uv_format: int | None, uv_stride: int) -> int:
        """Returns the number of vertices."""
        require_shape("uvs", view, 2)
        if uv_format is None:
            # Without a format, uint16 may be the bits of float16 as well.
            uv_format = _UVS[require_element("uvs", view, [element for element in _UVS if element[0] == "f"])]
        elements = [element for element, format in _UVS.items() if format == uv_format]
        if not elements:
            raise ValueError(f"uv_format {uv_format} is not a format of texture coordinates")
        require_element("uvs", view, elements + [_BYTES] * (view.ndim == 1))
        if uv_stride and view.ndim != 1:
            raise ValueError("uv_stride is for uvs of one dimension")
        size = 2 * elements[0][1]
        if not uv_stride and view.nbytes % size != 0:
            raise ValueError(f"uvs has {view.nbytes} bytes, which are no whole number of vertices of {size} bytes")
        self._uvs = Memory(view)
        _native.set_members(self.structure, uvs=self._uvs.address, uvs_size=self._uvs.size, uv_format=uv_format)
        return 1 + (view.nbytes - size) // (uv_stride or size) if view.nbytes >= size else 0

    def _set_indices(self, view: memoryview) -> int:
        """Returns the number of triangles."""
        require_shape("indices", view, 3)
        size = require_element("indices", view, [(kind, size) for size in (4, 2, 1) for kind in "ui"])[1]
        count = view.nbytes // size
        if count % 3 != 0:
            raise ValueError(f"{count} indices are no whole number of triangles")
        self._indices = memory = Memory(view)
        _native.set_members(self.structure, indices=memory.address, indices_size=memory.size,
                            index_type=_INDEX_TYPES[size])
        return count // 3

    def _set_of_triangles(self, name: str, value: ReadableBuffer | None) -> Memory | None:
        if value is None:
            return None
        view = view_of(name, value)
        require_element(name, view, [_BYTES])
        if view.shape != (self.triangle_count,):
            raise ValueError(f"{name} has the shape {view.shape}, expected ({self.triangle_count},), one for each triangle")
        memory = Memory(view)
        _native.set_members(self.structure, **{name: memory.address})
        return memory


@dataclass(frozen=True)
class Usage:
    """The number of triangles with data of one format and level."""

    count: int
    subdivision_level: int
    format: MicromapFormat


@dataclass(frozen=True)
class Geometry:
    """What the geometry made of one input needs. `indices`: int32, one for each of its triangles. Only VK_EXT_opacity_micromap
    and OptiX take `usages`."""

    indices: memoryview
    usages: list[Usage]


def usages_of(info: Any) -> list[Usage]:
    return [Usage(usage.count, usage.subdivision_level, MicromapFormat(usage.format))
            for usage in info.usages[:info.usage_count]]


def indices_of(info: Any) -> memoryview:
    return memoryview(_native.copied(info.indices, info.index_count, 4)).cast("i")


class Micromap:
    """The result of bake(). The first three members are the input of a micromap build, the fourth belongs to the geometry.

    data: the states, in the order of the curve.
    triangles: 8 bytes for each micromap triangle: the offset of its data (uint32), its level and its format (uint16 each), as
        VkMicromapTriangleKHR has them; struct.iter_unpack("IHH", triangles).
    usages: number of micromap triangles by format and level.
    indices: int32, for each triangle of all inputs: the number of a micromap triangle, or a SpecialIndex.
    geometries: the part of each input.
    state_counts: micro-triangles by State, with those of triangles with special indices.
    special_counts: triangles with special indices by State.
    distinct_count: triangles that differ in coordinates, textures, level or format.
    """

    def __init__(self, handle: _native.Handle, inputs: int) -> None:
        library = _native.library("vellum")
        self._handle = handle  # which copies of this object share
        weakref.finalize(handle, library.vellumDestroyMicromap, handle.value)
        info = _native.MicromapInfo(struct_size=sizeof(_native.MicromapInfo))
        _native.check(library.vellumGetMicromapInfo(handle, byref(info)))
        self.data = _native.copied(info.data, info.data_size)
        self.triangles = _native.copied(info.triangles, info.triangle_count, 8)
        self.usages = usages_of(info)
        self.indices = indices_of(info)
        self.state_counts: list[int] = list(info.state_counts)
        self.special_counts: list[int] = list(info.special_counts)
        self.distinct_count: int = info.distinct_count
        self.geometries = [self._geometry(number) for number in range(inputs)]

    def _geometry(self, number: int) -> Geometry:
        info = _native.GeometryInfo(struct_size=sizeof(_native.GeometryInfo))
        _native.check(_native.library("vellum").vellumGetGeometryInfo(self._handle, number, byref(info)))
        return Geometry(indices_of(info), usages_of(info))

    def state(self, triangle: int, u: float, v: float) -> State:
        """The state at a point of a triangle, as a ray looks it up.

        triangle: of all inputs, 0 to len(indices) - 1; otherwise IndexError.
        u, v: barycentrics, the weights of vertices 1 and 2. Points outside are moved to the edge.
        """
        if not 0 <= triangle < len(self.indices):
            raise IndexError(f"there is no triangle {triangle} of {len(self.indices)}")
        state = c_uint32()
        _native.check(_native.library("vellum").vellumGetState(self._handle, triangle, u, v, byref(state)))
        return State(state.value)


def bake(inputs: BakeInput | Iterable[BakeInput], *, progress: Callable[[int, int], object] | None = None,
         cancelled: Callable[[], object] | None = None, **options: Unpack[BakeOptions]) -> Micromap:
    """Bakes one micromap for the triangles of all inputs; triangles with equal states share data, also across inputs.

    progress: called with (done, total) triangles, a few hundred times at most; a true result cancels the bake.
    cancelled: called about twenty times a second, such as threading.Event().is_set; a true result cancels the bake.
    options: of BakeOptions, by name.

    Both are called on this thread, which waits for the bake; the library's threads run without the interpreter's lock. An
    exception that they raise, or KeyboardInterrupt, ends the bake and is raised on.

    Raises Error if an option or an input is out of range (Result.ERROR_INVALID_ARGUMENT), if the data would exceed
    max_data_size (ERROR_TOO_LARGE) or memory runs out; Cancelled; TypeError for an option that does not exist.
    """
    given = list_of("inputs", BakeInput, inputs)
    call = _native.LongCall(progress, cancelled, given)
    set_options(call.options, BakeOptions.__optional_keys__, dict(options))
    handle = _native.Handle()
    structures = (_native.BakeInput * len(given))(*(one.structure for one in given))
    library = _native.library("vellum")
    try:
        call.run(library.vellumBake, structures, len(given), byref(call.options), byref(handle))
    except BaseException:
        library.vellumDestroyMicromap(handle)  # there may be one: the last call of `progress` can raise
        raise
    return Micromap(handle, len(given))


def write_indices(indices: ReadableBuffer, size: int) -> bytes:
    """Indices of a Micromap, a Geometry or a GltfPrimitive as unsigned integers of `size` bytes, 1, 2 or 4; special ones in
    two's complement, as Vulkan, D3D12, OptiX and glTF read them. 1 byte holds indices into 252 triangles, 2 bytes those into
    65,532.

    indices: int32, one dimension. Raises ValueError for one that is below -4 or does not fit, and for another size.
    """
    view = view_of("indices", indices)
    require_element("indices", view, [("i", 4)])
    if view.ndim != 1:
        raise ValueError(f"indices has the shape {view.shape}, expected (n,)")
    if size not in (1, 2, 4):
        raise ValueError(f"size is {size}, not 1, 2 or 4")
    memory, count = Memory(view), view.nbytes // 4
    output = ctypes.create_string_buffer(max(count * size, 1))
    if count and _native.library("vellum").vellumWriteIndices(memory.address, count, size, output) != _native.Result.SUCCESS:
        raise ValueError(f"an index is below -4, or too large for {size} bytes")
    return output.raw[:count * size]


def library_version() -> str:
    """The version of the libvellum in use, such as "0.1.0"."""
    version: int = _native.library("vellum").vellumGetVersion()
    return f"{version >> 22}.{version >> 12 & 0x3ff}.{version & 0xfff}"


def bake_version() -> int:
    """Higher in every version whose results for the same arguments may differ: for the keys of caches."""
    version: int = _native.library("vellum").vellumGetBakeVersion()
    return version
