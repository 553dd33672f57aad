# SPDX-License-Identifier: Apache-2.0
"""Micromaps in glTF files: vellum/gltf.h."""
from __future__ import annotations

import os
from ctypes import byref, c_void_p, sizeof
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Callable, MutableMapping, NamedTuple, Sequence, Union, Unpack

from . import _native
from ._bake import QualityOptions, Usage, indices_of, set_options, usages_of
from ._buffers import Memory, view_of

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

Path = Union[str, "os.PathLike[str]"]
_BLEND, _EMBED, _BLEND_CUTOFF, _FALLBACK_IMAGES, _TARGET_KNOWN, _REPLACE_COPIES = 1, 2, 4, 8, 16, 32


class GltfNote(NamedTuple):
    """Something about a place in a file: `mesh 2 "leaves" primitive 0`, and a sentence."""

    place: str
    message: str


@dataclass(frozen=True)
class GltfMicromap:
    """The input of a micromap build, as the members of Micromap with these names."""

    data: bytes
    triangles: bytes
    usages: list[Usage]


@dataclass(frozen=True)
class GltfPrimitive:
    """What the geometry made of meshes[mesh].primitives[primitive] needs in addition to the micromap.

    name: for messages, `mesh 2 "leaves" primitive 0`.
    micromap: into Gltf.micromaps.
    indices: int32, for each triangle: a SpecialIndex, or an index to which base_triangle is added.
    usages: number of its triangles with data, by format and level.
    """

    name: str
    mesh: int
    primitive: int
    micromap: int
    indices: memoryview
    usages: list[Usage]
    base_triangle: int


@dataclass(frozen=True)
class Gltf:
    """The micromaps of a file, and the primitives that have one, in the order of meshes. `extension` is its name in the file,
    or empty without micromaps."""

    extension: str
    micromaps: list[GltfMicromap]
    primitives: list[GltfPrimitive]


@dataclass
class GltfReport:
    """What bake_gltf() and bake_gltf_file() did.

    micromap_count: one for each image, sampler, factor and cutoff. primitive_count: primitives that got a micromap.
    micromap_size: bytes of micromaps, with 8 for each micromap triangle. input_size, output_size: bytes of files.
    replaced: the input had micromaps, all of which were replaced or removed.
    cache_hits, cache_misses: results that the cache had, and that it did not have.
    skipped: alpha-tested primitives that got no micromap, and why.
    """

    micromap_count: int = 0
    primitive_count: int = 0
    micromap_size: int = 0
    input_size: int = 0
    output_size: int = 0
    replaced: bool = False
    cache_hits: int = 0
    cache_misses: int = 0
    skipped: list[GltfNote] = field(default_factory=list)


class GltfBakeOptions(QualityOptions, total=False):
    """Options of bake_gltf() and bake_gltf_file(), in addition to QualityOptions. The budget is for the whole file, max_data_size
    for each micromap, or, with a budget, for all of them.

    blend: also bakes alphaMode BLEND: opaque only where alpha is 1, transparent only where it is 0; default False.
    blend_cutoff: bakes it as a mask with this cutoff instead, finite; wrong for renderers that blend.
    fallback_images: bakes textures with an image that is not supported (KTX2, DDS) from their other one; default False.
    target_known: the smallest micromaps that know this share of the alpha-tested surface, 0 to 1, instead of a budget; not with
        2 states.
    excluded_materials, excluded_meshes: names of those that are not baked; shell patterns: * ? [...].
    cache: results by keys of 32 bytes, such as a dict. It is asked before anything is baked.
    """

    blend: bool
    blend_cutoff: float
    fallback_images: bool
    target_known: float
    excluded_materials: Sequence[str]
    excluded_meshes: Sequence[str]
    cache: MutableMapping[bytes, bytes]


def _note_list() -> tuple[list[GltfNote], Any]:
    notes: list[GltfNote] = []

    def add(user_data: object, place: bytes, note: bytes) -> None:
        notes.append(GltfNote(place.decode(errors="replace"), note.decode(errors="replace")))

    return notes, _native.NOTE(add)


def _arguments_of(file: Path | ReadableBuffer, name: str) -> tuple[str, tuple[Any, ...], Memory | None]:
    """The end of the function's name, its first arguments, and what must be kept as long as they are used."""
    if isinstance(file, (str, os.PathLike)):
        return "", (_native.path("file", file),), None
    memory = Memory(view_of("file", file))
    return "Memory", (memory.address, memory.size, _native.text("name", name)), memory


def read_gltf(file: Path | ReadableBuffer, *, name: str = "input") -> Gltf:
    """Reads and checks the micromaps of a .glb or .gltf file. A file without micromaps is no error.

    file: a path (str or os.PathLike), or the bytes of a file.
    name: of bytes: for messages, and the path to which files that a .gltf names are relative.

    Raises Error with Result.ERROR_FILE if the file cannot be read, or a micromap breaks a rule of the extension.
    """
    library, messages, handle = _native.library("vellum_gltf"), _native.Messages(), c_void_p()
    end, arguments, _kept = _arguments_of(file, name)
    function = getattr(library, "vellumReadGltf" + end)
    _native.check(function(*arguments, messages.callback, None, byref(handle)), messages.text)
    try:
        info = _native.GltfInfo(struct_size=sizeof(_native.GltfInfo))
        _native.check(library.vellumGetGltfInfo(handle, byref(info)))
        micromaps, primitives = [], []
        for number in range(info.micromap_count):
            one = _native.GltfMicromapInfo(struct_size=sizeof(_native.GltfMicromapInfo))
            _native.check(library.vellumGetGltfMicromapInfo(handle, number, byref(one)))
            micromaps.append(GltfMicromap(_native.copied(one.data, one.data_size),
                                          _native.copied(one.triangles, one.triangle_count, 8), usages_of(one)))
        for number in range(info.primitive_count):
            user = _native.GltfPrimitiveInfo(struct_size=sizeof(_native.GltfPrimitiveInfo))
            _native.check(library.vellumGetGltfPrimitiveInfo(handle, number, byref(user)))
            primitives.append(GltfPrimitive(user.name.decode(errors="replace"), user.mesh, user.primitive, user.micromap,
                                            indices_of(user), usages_of(user), user.base_triangle))
        return Gltf(info.extension.decode(), micromaps, primitives)
    finally:
        library.vellumDestroyGltf(handle)


def check_gltf(file: Path | ReadableBuffer, most: int = 100, *, name: str = "input") -> list[GltfNote]:
    """Whatever breaks a rule of the extension in a file, at most `most` findings, in the file's order.

    It does not look at textures; `vellum verify` compares states with them. Arguments and errors are those of read_gltf().
    """
    if not 0 <= most < 2**64:
        raise ValueError(f"most is {most}, not 0 or more")
    messages = _native.Messages()
    end, arguments, _kept = _arguments_of(file, name)
    findings, callback = _note_list()
    function = getattr(_native.library("vellum_gltf"), "vellumCheckGltf" + end)
    _native.check(function(*arguments, most, callback, messages.callback, None), messages.text)
    return findings


class _FileBake:
    """The arguments that files and memory share."""

    def __init__(self, progress: Callable[[int, int], object] | None, cancelled: Callable[[], object] | None,
                 given: dict[str, Any], *, embed: bool = False, replace_copies: bool = False, read: object = None) -> None:
        self.call = _native.LongCall(progress, cancelled, read)
        self.options = _native.GltfBakeOptions()
        library = _native.library("vellum_gltf")
        library.vellumInitGltfBakeOptions(byref(self.options), sizeof(self.options))
        names = GltfBakeOptions.__optional_keys__
        own = {name: given.pop(name) for name in names - QualityOptions.__optional_keys__ if name in given}
        set_options(self.call.options, names, given)
        flags = ((own.get("blend"), _BLEND), (own.get("fallback_images"), _FALLBACK_IMAGES), (embed, _EMBED),
                 (replace_copies, _REPLACE_COPIES))
        self.options.flags = sum(bit for wanted, bit in flags if wanted)
        if own.get("blend_cutoff") is not None:
            self.options.flags |= _BLEND | _BLEND_CUTOFF
            _native.set_members(self.options, blend_cutoff=own["blend_cutoff"])
        if own.get("target_known") is not None:
            self.options.flags |= _TARGET_KNOWN
            _native.set_members(self.options, target_known=own["target_known"])
        for member, count in (("excluded_materials", "excluded_material_count"), ("excluded_meshes", "excluded_mesh_count")):
            patterns = _native.strings(member, own.get(member) or ())
            setattr(self.options, member, patterns)
            setattr(self.options, count, len(patterns))
        self._skipped, self.options.skipped = _note_list()
        if own.get("cache") is not None:
            self._use(own["cache"])
        self.info = _native.GltfBakeInfo(struct_size=sizeof(_native.GltfBakeInfo))

    def _use(self, cache: MutableMapping[bytes, bytes]) -> None:
        def value_of(key: bytes) -> bytes | None:
            value = cache.get(key)
            return None if value is None else memoryview(value).tobytes()

        def get(user_data: object, key: int, found: Callable[[Any, bytes, int], None], receiver: Any) -> None:
            value = self.call.ask(value_of, _native.copied(key, _native.CACHE_KEY_SIZE))
            if value is not None:
                found(receiver, value, len(value))

        def put(user_data: object, key: int, value: int, size: int) -> None:
            self.call.ask(cache.__setitem__, _native.copied(key, _native.CACHE_KEY_SIZE), _native.copied(value, size))

        self.options.cache_get, self.options.cache_put = _native.CACHE_GET(get), _native.CACHE_PUT(put)

    def report(self) -> GltfReport:
        info = self.info
        return GltfReport(info.micromap_count, info.primitive_count, info.micromap_size, info.input_size, info.output_size,
                          bool(info.replaced), info.cache_hits, info.cache_misses, self._skipped)


def bake_gltf(file: ReadableBuffer, *, name: str = "input", progress: Callable[[int, int], object] | None = None,
              cancelled: Callable[[], object] | None = None, **options: Unpack[GltfBakeOptions]) -> tuple[bytes, GltfReport]:
    """Bakes the alpha-tested primitives of a glTF file in memory. Returns the file with micromaps, a .glb for a .glb, a .gltf
    with its micromaps inside for a .gltf, and a report. Everything else stays byte for byte.

    file: the bytes of a .glb or .gltf.
    name: for messages, and the path to which files that a .gltf names are relative.
    progress, cancelled: as for bake().
    options: of GltfBakeOptions, by name. Methods of the cache are called on this thread.

    Raises as bake() does, and Error with Result.ERROR_FILE if the file is invalid.
    """
    memory, parts = Memory(view_of("file", file)), []
    bake = _FileBake(progress, cancelled, dict(options), read=memory)
    output = _native.OUTPUT(lambda user_data, start, size: parts.append(_native.copied(start, size)))
    bake.call.run(_native.library("vellum_gltf").vellumBakeGltfMemory, memory.address, memory.size, _native.text("name", name),
                  byref(bake.call.options), byref(bake.options), output, byref(bake.info))
    data, report = b"".join(parts), bake.report()
    if len(data) != report.output_size:  # a callback cannot raise
        raise MemoryError("the output does not fit into memory")
    return data, report


def bake_gltf_file(input: Path, output: Path, *, embed: bool = False, replace_copies: bool = False,
                   progress: Callable[[int, int], object] | None = None, cancelled: Callable[[], object] | None = None,
                   **options: Unpack[GltfBakeOptions]) -> GltfReport:
    """Bakes the alpha-tested primitives of a glTF file and writes the file with their micromaps, whole or not at all.

    input, output: paths of two different files, both .glb or both .gltf. Micromaps of tree.gltf are written to
        tree.omm-<digest>.bin beside the output; files that a .gltf refers to are copied if that is in another folder. An
        existing output is replaced.
    embed: micromaps of a .gltf are written into it, in a data URI.
    replace_copies: copied files replace different ones of the same names, which other models in that folder may name; without
        it, these are an error.
    progress, cancelled, options: as for bake_gltf().

    Raises as bake_gltf() does; Result.ERROR_FILE also if a file cannot be written.
    """
    bake = _FileBake(progress, cancelled, dict(options), embed=embed, replace_copies=replace_copies)
    bake.call.run(_native.library("vellum_gltf").vellumBakeGltf, _native.path("input", input), _native.path("output", output),
                  byref(bake.call.options), byref(bake.options), byref(bake.info))
    return bake.report()
