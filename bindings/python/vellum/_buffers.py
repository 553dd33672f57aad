# SPDX-License-Identifier: Apache-2.0
"""Objects with the buffer protocol (bytes, array.array, numpy arrays) as memory of known elements."""
from __future__ import annotations

import ctypes
import sys
from typing import TYPE_CHECKING, Iterable

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

# What the elements are: "u", "i" or "f", and their bytes; or, where they are nothing of that kind, their format.
Element = tuple[str, int]
_KINDS = {**dict.fromkeys("BHILQN", "u"), **dict.fromkeys("bhilqn", "i"), **dict.fromkeys("efdg", "f")}
_NATIVE = "@=" + ("<" if sys.byteorder == "little" else ">")


def view_of(name: str, value: ReadableBuffer) -> memoryview:
    try:
        return memoryview(value)
    except (TypeError, ValueError, BufferError) as error:
        raise TypeError(f"{name}: expected bytes, array.array, a numpy array or another buffer: {error}") from None


def element_of(view: memoryview) -> Element:
    code = view.format[1:] if view.format[:1] in _NATIVE else view.format
    return _KINDS.get(code, view.format), view.itemsize


def _name_of(element: Element) -> str:
    kind, size = element
    known = {"u": "uint", "i": "int", "f": "float"}.get(kind)
    return f"{known}{8 * size}" if known else f"of format {kind!r}"


def require_element(name: str, view: memoryview, allowed: Iterable[Element]) -> Element:
    """Nothing is converted: it would be slow, or change values."""
    element = element_of(view)
    allowed = list(allowed)
    if element not in allowed:
        expected = " or ".join(map(_name_of, allowed))
        code = allowed[0][0] + str(allowed[0][1])
        raise TypeError(f"{name} is {_name_of(element)}, expected {expected}; of a numpy array: .astype('{code}')")
    return element


def require_shape(name: str, view: memoryview, columns: int) -> None:
    """One after the other, or in rows of `columns`."""
    if view.ndim != 1 and (view.ndim != 2 or view.shape is None or view.shape[1] != columns):
        raise ValueError(f"{name} has the shape {view.shape}, expected (n, {columns}) or (n,)")


class Memory:
    """The elements of a view, one after the other, at an address that is valid as long as this object. They are read where
    they are if that can be had: of bytes, and of writable memory without gaps. Otherwise they are copied."""

    def __init__(self, view: memoryview) -> None:
        self.size = view.nbytes
        self.address: int | None = None
        if self.size == 0:
            return
        if view.c_contiguous and not view.readonly:
            start = ctypes.c_char.from_buffer(view)
            self._kept: object = start
            self.address = ctypes.addressof(start)
            return
        whole = view.c_contiguous and type(view.obj) is bytes and len(view.obj) == self.size
        data = view.obj if whole else view.tobytes()
        assert isinstance(data, bytes)
        self._kept = data
        self.address = ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p).value
