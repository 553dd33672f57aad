# SPDX-License-Identifier: Apache-2.0
"""The C interface by ctypes: structures with the members of the headers, functions, results, and how long calls are made."""
from __future__ import annotations

import ctypes
import functools
import os
import pathlib
import queue
import sys
import threading
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_int32, c_size_t, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from typing import Any, Callable, Sequence

# Of the headers that are described here, and of the libraries' sonames: before 1.0 another one may differ in anything.
INTERFACE = "0.1"


class Result(IntEnum):
    """What a call came to."""

    SUCCESS = 0
    CANCELLED = 1
    ERROR_INVALID_ARGUMENT = -1
    ERROR_OUT_OF_MEMORY = -2
    ERROR_TOO_LARGE = -3
    ERROR_UNSUPPORTED = -4
    ERROR_INTERNAL = -5
    ERROR_FILE = -6


class Error(Exception):
    """What the library reports: one sentence that names the argument, or the place in the file. `result` is a Result."""

    def __init__(self, result: Result, message: str) -> None:
        super().__init__(message)
        self.result = result

    def __reduce__(self) -> tuple[type[Error], tuple[Result, str]]:
        return type(self), (self.result, str(self))


class Cancelled(Error):
    """`progress` or `cancelled` ended the call; there is no result, and no file was written."""


MESSAGE = ctypes.CFUNCTYPE(None, c_void_p, c_int, c_char_p)
PROGRESS = ctypes.CFUNCTYPE(c_int, c_void_p, c_uint64, c_uint64)
CANCEL = ctypes.CFUNCTYPE(c_int, c_void_p)
NOTE = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_char_p)
CACHE_VALUE = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_size_t)
CACHE_GET = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, CACHE_VALUE, c_void_p)
CACHE_PUT = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_void_p, c_size_t)
OUTPUT = ctypes.CFUNCTYPE(None, c_void_p, c_void_p, c_size_t)
CACHE_KEY_SIZE = 32


class Handle(c_void_p):
    """Of an object of the library. Unlike c_void_p itself, something can be attached to its end."""


class Texture(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("texels", c_void_p), ("texels_size", c_size_t), ("width", c_uint32),
                ("height", c_uint32), ("format", c_uint32), ("filter", c_uint32), ("address_mode_u", c_uint32),
                ("address_mode_v", c_uint32), ("offset", c_size_t), ("pixel_stride", c_size_t), ("row_stride", c_size_t),
                ("scale", c_float), ("border", c_float)]


class BakeInput(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("textures", POINTER(Texture)), ("texture_count", c_size_t), ("uvs", c_void_p),
                ("uvs_size", c_size_t), ("uv_stride", c_size_t), ("indices", c_void_p), ("indices_size", c_size_t),
                ("triangle_count", c_size_t), ("uv_format", c_uint32), ("index_type", c_uint32), ("uv_transform", c_float * 6),
                ("levels", c_void_p), ("formats", c_void_p), ("cutoff", c_double)]


class BakeOptions(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("format", c_uint32), ("two_state_rule", c_uint32), ("level", c_int32),
                ("max_level", c_uint32), ("texels_per_edge", c_double), ("compare_op", c_uint32), ("flags", c_uint32),
                ("budget", c_uint64), ("min_known", c_double), ("value_tolerance", c_double), ("subtexel_tolerance", c_double),
                ("barycentric_tolerance", c_double), ("interpolation_tolerance", c_double), ("max_data_size", c_uint64),
                ("threads", c_uint32), ("reserved", c_uint32), ("message", MESSAGE), ("progress", PROGRESS),
                ("cancelled", CANCEL), ("user_data", c_void_p)]


class MicromapTriangle(ctypes.Structure):
    _fields_ = [("data_offset", c_uint32), ("subdivision_level", c_uint16), ("format", c_uint16)]


class MicromapUsage(ctypes.Structure):
    _fields_ = [("count", c_uint32), ("subdivision_level", c_uint32), ("format", c_uint32)]


class MicromapInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("data", POINTER(c_uint8)), ("data_size", c_size_t),
                ("triangles", POINTER(MicromapTriangle)), ("triangle_count", c_size_t), ("usages", POINTER(MicromapUsage)),
                ("usage_count", c_size_t), ("indices", POINTER(c_int32)), ("index_count", c_size_t),
                ("state_counts", c_uint64 * 4), ("special_counts", c_uint64 * 4), ("distinct_count", c_uint64)]


class GeometryInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("indices", POINTER(c_int32)), ("index_count", c_size_t),
                ("usages", POINTER(MicromapUsage)), ("usage_count", c_size_t)]


class SpirvOptions(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("edit", c_uint32), ("constant_id", c_uint32), ("constant_default", c_uint32),
                ("reserved", c_uint32), ("entry_points", POINTER(c_char_p)), ("entry_point_count", c_size_t),
                ("message", MESSAGE), ("user_data", c_void_p)]


class SpirvInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("words", POINTER(c_uint32)), ("word_count", c_size_t),
                ("entry_point_count", c_size_t), ("changed", c_uint32), ("reserved", c_uint32)]


class SpirvEntryPointInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("name", c_char_p), ("execution_model", c_uint32), ("ray_queries", c_uint32),
                ("traces_rays", c_uint32), ("mode", c_uint32), ("constant_id", c_uint32), ("constant_default", c_uint32)]


class GltfInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("extension", c_char_p), ("micromap_count", c_size_t),
                ("primitive_count", c_size_t)]


class GltfMicromapInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("data", POINTER(c_uint8)), ("data_size", c_size_t),
                ("triangles", POINTER(MicromapTriangle)), ("triangle_count", c_size_t), ("usages", POINTER(MicromapUsage)),
                ("usage_count", c_size_t)]


class GltfPrimitiveInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("name", c_char_p), ("mesh", c_uint32), ("primitive", c_uint32),
                ("micromap", c_size_t), ("indices", POINTER(c_int32)), ("index_count", c_size_t),
                ("usages", POINTER(MicromapUsage)), ("usage_count", c_size_t), ("base_triangle", c_uint32),
                ("reserved", c_uint32)]


class GltfBakeOptions(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("flags", c_uint32), ("blend_cutoff", c_float),
                ("excluded_materials", POINTER(c_char_p)), ("excluded_material_count", c_size_t),
                ("excluded_meshes", POINTER(c_char_p)), ("excluded_mesh_count", c_size_t), ("skipped", NOTE),
                ("cache_get", CACHE_GET), ("cache_put", CACHE_PUT), ("target_known", c_double)]


class GltfBakeInfo(ctypes.Structure):
    _fields_ = [("struct_size", c_size_t), ("micromap_count", c_size_t), ("primitive_count", c_size_t),
                ("skipped_count", c_size_t), ("micromap_size", c_uint64), ("input_size", c_uint64), ("output_size", c_uint64),
                ("replaced", c_uint32), ("reserved", c_uint32), ("cache_hits", c_size_t), ("cache_misses", c_size_t)]


# The functions of each library: the result and the arguments. Pointers to structures are those of byref().
FUNCTIONS: dict[str, dict[str, tuple[Any, list[Any]]]] = {
    "vellum": {
        "vellumGetVersion": (c_uint32, []),
        "vellumGetBakeVersion": (c_uint32, []),
        "vellumInitTexture": (None, [c_void_p, c_size_t]),
        "vellumInitBakeInput": (None, [c_void_p, c_size_t]),
        "vellumInitBakeOptions": (None, [c_void_p, c_size_t]),
        "vellumIsFlagSet": (c_int, [c_void_p]),
        "vellumBake": (c_int, [c_void_p, c_size_t, c_void_p, c_void_p]),
        "vellumDestroyMicromap": (None, [c_void_p]),
        "vellumGetMicromapInfo": (c_int, [c_void_p, c_void_p]),
        "vellumGetGeometryInfo": (c_int, [c_void_p, c_size_t, c_void_p]),
        "vellumWriteIndices": (c_int, [c_void_p, c_size_t, c_uint32, c_void_p]),
        "vellumGetState": (c_int, [c_void_p, c_size_t, c_float, c_float, c_void_p]),
        "vellumInitSpirvOptions": (None, [c_void_p, c_size_t]),
        "vellumEditSpirv": (c_int, [c_void_p, c_size_t, c_void_p, c_void_p]),
        "vellumDestroySpirv": (None, [c_void_p]),
        "vellumGetSpirvInfo": (c_int, [c_void_p, c_void_p]),
        "vellumGetSpirvEntryPointInfo": (c_int, [c_void_p, c_size_t, c_void_p])},
    "vellum_gltf": {
        "vellumReadGltf": (c_int, [c_char_p, MESSAGE, c_void_p, c_void_p]),
        "vellumReadGltfMemory": (c_int, [c_void_p, c_size_t, c_char_p, MESSAGE, c_void_p, c_void_p]),
        "vellumDestroyGltf": (None, [c_void_p]),
        "vellumGetGltfInfo": (c_int, [c_void_p, c_void_p]),
        "vellumGetGltfMicromapInfo": (c_int, [c_void_p, c_size_t, c_void_p]),
        "vellumGetGltfPrimitiveInfo": (c_int, [c_void_p, c_size_t, c_void_p]),
        "vellumCheckGltf": (c_int, [c_char_p, c_size_t, NOTE, MESSAGE, c_void_p]),
        "vellumCheckGltfMemory": (c_int, [c_void_p, c_size_t, c_char_p, c_size_t, NOTE, MESSAGE, c_void_p]),
        "vellumInitGltfBakeOptions": (None, [c_void_p, c_size_t]),
        "vellumBakeGltf": (c_int, [c_char_p, c_char_p, c_void_p, c_void_p, c_void_p]),
        "vellumBakeGltfMemory": (c_int, [c_void_p, c_size_t, c_char_p, c_void_p, c_void_p, OUTPUT, c_void_p])}}


@functools.lru_cache(maxsize=None)
def library(name: str) -> ctypes.CDLL:
    """A library: of $VELLUM_LIBRARY_PATH, of this folder, into which wheels put it, or what the system's loader finds."""
    file = f"{name}.dll" if sys.platform == "win32" else f"lib{name}.so.{INTERFACE}"
    folder = os.environ.get("VELLUM_LIBRARY_PATH")
    inside = pathlib.Path(__file__).with_name(file)
    path = os.path.join(os.path.abspath(folder), file) if folder else str(inside) if inside.exists() else file
    try:
        loaded = ctypes.CDLL(path)
    except OSError as error:
        raise ImportError(f"{error}: install Vellum, or set VELLUM_LIBRARY_PATH to the folder that has {file}",
                          name="vellum", path=path) from None
    for function, (result, arguments) in FUNCTIONS[name].items():
        try:
            found = getattr(loaded, function)
        except AttributeError:
            raise ImportError(f"{path} is older than this package: it has no {function}", name="vellum", path=path) from None
        found.restype, found.argtypes = result, arguments
    return loaded


def copied(address: Any, count: int, size: int = 1) -> bytes:
    """`count` elements of `size` bytes at a pointer of the library."""
    return bytes((c_uint8 * (count * size)).from_address(ctypes.cast(address, c_void_p).value or 0)) if count else b""


def _without_nulls(name: str, encoded: bytes) -> bytes:
    if b"\0" in encoded:
        raise ValueError(f"{name} has a null character")
    return encoded


def path(name: str, value: str | os.PathLike[str]) -> bytes:
    """A path as the system has it."""
    return _without_nulls(name, os.fsencode(value))


def text(name: str, value: str) -> bytes:
    """A name of a file's contents in UTF-8, in any locale."""
    return _without_nulls(name, value.encode("utf-8", "surrogateescape"))


def strings(name: str, values: Sequence[str]) -> Any:
    if isinstance(values, str):
        raise TypeError(f"{name} is a string, expected a list of them")
    return (c_char_p * len(values))(*(text(name, value) for value in values))


def set_members(structure: ctypes.Structure, **members: Any) -> None:
    """Numbers; ctypes itself would cut off what an integer cannot hold."""
    kinds = {field[0]: field[1] for field in structure._fields_}
    for name, value in members.items():
        try:
            setattr(structure, name, value)
        except (TypeError, OverflowError) as error:
            raise type(error)(f"{name} is {value!r}: {error}") from None
        if kinds[name] not in (c_float, c_double) and getattr(structure, name) != value:
            raise ValueError(f"{name} is {value}, which is out of its range")


def check(result: int, message: str = "") -> None:
    if result != Result.SUCCESS:
        try:
            known = Result(result)
        except ValueError:  # of a newer library
            known = Result.ERROR_INTERNAL
        kind = Cancelled if known == Result.CANCELLED else Error
        raise kind(known, message or ("cancelled" if known == Result.CANCELLED else f"VELLUM_{known.name}"))


class Messages:
    """Receives what a call reports."""

    def __init__(self) -> None:
        self.text = ""
        self.callback = MESSAGE(self._receive)

    def _receive(self, user_data: object, result: int, message: bytes) -> None:
        self.text = message.decode(errors="replace")


class LongCall:
    """A call that may take long. It runs on a thread of its own, as ctypes releases the interpreter's lock. Meanwhile the
    thread that called runs Python: signals such as that of Ctrl-C, and all callbacks.
    """

    POLL = 0.05  # seconds

    def __init__(self, progress: Callable[[int, int], object] | None, cancelled: Callable[[], object] | None,
                 read: object) -> None:
        self._read = read  # kept as long as the library's threads run
        self.options = BakeOptions()
        library("vellum").vellumInitBakeOptions(ctypes.byref(self.options), ctypes.sizeof(self.options))
        self._messages = Messages()
        self._cancelled = cancelled
        self._flag = c_int32(0)  # what the library polls
        self._requests: queue.SimpleQueue[tuple[Callable[..., Any], tuple[Any, ...], queue.SimpleQueue[Any]] | None] = (
            queue.SimpleQueue())
        self.options.message = self._messages.callback
        self.options.user_data = ctypes.addressof(self._flag)
        self.options.cancelled = ctypes.cast(library("vellum").vellumIsFlagSet, CANCEL)
        if progress is not None:
            function = progress
            self.options.progress = PROGRESS(lambda user_data, done, total: 1 if self.ask(function, done, total) else 0)

    def ask(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Called by the library's threads: the result of a function that runs on the thread that called; None once the call
        is to end."""
        reply: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._requests.put((function, arguments, reply))
        while not self._flag.value:
            try:
                return reply.get(timeout=self.POLL)
            except queue.Empty:
                pass
        return None

    def _poll(self) -> None:
        if self._cancelled is not None and not self._flag.value and self._cancelled():
            self._flag.value = 1

    def _serve(self, thread: threading.Thread) -> None:
        self._poll()
        try:
            request = self._requests.get(timeout=self.POLL)
        except queue.Empty:
            return
        if request is None:
            thread.join()
        elif not self._flag.value:
            function, arguments, reply = request
            reply.put(function(*arguments))

    def run(self, function: Callable[..., int], *arguments: Any) -> None:
        self._poll()
        results: list[int] = []

        def work() -> None:
            try:
                results.append(function(*arguments))
            finally:
                self._requests.put(None)

        # An exception, of a callback or a signal, is raised once the library has ended.
        failure: BaseException | None = None
        thread = threading.Thread(target=work, name="vellum")
        thread.start()
        try:
            while thread.is_alive():
                try:
                    self._serve(thread)
                except BaseException as error:
                    self._flag.value = 1
                    failure = failure or error
        finally:
            self._flag.value = 1
            thread.join()
        self._read = None  # the callbacks refer to this object, so that it lives until it is collected
        if failure is not None:
            raise failure
        check(results[0], self._messages.text)
