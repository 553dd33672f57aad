# SPDX-License-Identifier: Apache-2.0
"""The execution mode OpacityMicromapIdKHR of SPIR-V modules: vellum/spirv.h."""
from __future__ import annotations

from ctypes import byref, c_void_p, sizeof
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple, Sequence

from . import _native
from ._buffers import Memory, require_element, view_of

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


class SpirvMode(IntEnum):
    """How an entry point declares whether its ray queries use micromaps."""

    ABSENT = 0
    FALSE = 1
    TRUE = 2
    CONSTANT = 3
    COMPUTED = 4
    INVALID = 5


class SpirvEdit(IntEnum):
    """What edit_spirv() does with the execution mode."""

    NONE = 0
    ENABLE = 1
    ENABLE_BY_CONSTANT = 2
    DISABLE = 3


class SpirvEntryPoint(NamedTuple):
    """An entry point after the edit. `execution_model` is SPIR-V's. `ray_queries`: it has ray queries, itself or in functions
    that it calls. `traces_rays`: it traces rays of a ray tracing pipeline. The constant is that of SpirvMode.CONSTANT."""

    name: str
    execution_model: int
    ray_queries: bool
    traces_rays: bool
    mode: SpirvMode
    constant_id: int
    constant_default: bool


@dataclass(frozen=True)
class Spirv:
    """A module after the edit. `changed`: its words differ from those given."""

    words: bytes
    changed: bool
    entry_points: list[SpirvEntryPoint]


def edit_spirv(words: ReadableBuffer, edit: int = SpirvEdit.ENABLE, *, entry_points: Sequence[str] = (), constant_id: int = 0,
               constant_default: bool = False) -> Spirv:
    """Reads a module and edits a copy of it.

    words: the module in the byte order of this machine, as bytes or uint32, in one dimension.
    edit: a SpirvEdit. NONE only reads.
    entry_points: names of those to edit. None given: all, and only those with ray queries get the mode.
    constant_id, constant_default: for ENABLE_BY_CONSTANT, the SpecId of the constant and its default value. A constant of
        the module with that SpecId is used; it must be a bool with that default.

    Raises Error if the module is malformed, has no entry point of a given name, or is older than SPIR-V 1.4 and needs the
    mode; TypeError or ValueError if `words` are no words.
    """
    view = view_of("words", words)
    require_element("words", view, [("u", 4), ("u", 1)])
    if view.nbytes % 4 != 0:
        raise ValueError(f"words has {view.nbytes} bytes, which are no whole number of words of 4 bytes")
    library, messages = _native.library("vellum"), _native.Messages()
    options = _native.SpirvOptions()
    library.vellumInitSpirvOptions(byref(options), sizeof(options))
    _native.set_members(options, edit=edit, constant_id=constant_id, constant_default=int(constant_default))
    options.message = messages.callback
    options.entry_points = _native.strings("entry_points", entry_points)
    options.entry_point_count = len(entry_points)
    memory = Memory(memoryview(view.tobytes()))  # aligned
    handle = c_void_p()
    _native.check(library.vellumEditSpirv(memory.address, view.nbytes // 4, byref(options), byref(handle)), messages.text)
    try:
        info = _native.SpirvInfo(struct_size=sizeof(_native.SpirvInfo))
        _native.check(library.vellumGetSpirvInfo(handle, byref(info)))
        found = []
        for number in range(info.entry_point_count):
            entry = _native.SpirvEntryPointInfo(struct_size=sizeof(_native.SpirvEntryPointInfo))
            _native.check(library.vellumGetSpirvEntryPointInfo(handle, number, byref(entry)))
            found.append(SpirvEntryPoint(
                entry.name.decode(errors="replace"), entry.execution_model, bool(entry.ray_queries), bool(entry.traces_rays),
                SpirvMode(entry.mode), entry.constant_id, bool(entry.constant_default)))
        return Spirv(_native.copied(info.words, info.word_count, 4), bool(info.changed), found)
    finally:
        library.vellumDestroySpirv(handle)
