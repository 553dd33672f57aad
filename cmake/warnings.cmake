# SPDX-License-Identifier: Apache-2.0
# Warnings that every target is compiled with; errors with VELLUM_WERROR, as in the presets for developers. Link
# `vellum_warnings` privately.
add_library(vellum_warnings INTERFACE)
target_compile_options(vellum_warnings INTERFACE
  -Wall -Wextra $<$<BOOL:${VELLUM_WERROR}>:-Werror> -Wshadow -Wconversion -Wsign-conversion -Wold-style-cast -Wnon-virtual-dtor -Wimplicit-fallthrough
  # `{VK_STRUCTURE_TYPE_...}` leaves the rest of a Vulkan structure zero on purpose.
  -Wno-missing-field-initializers
  # GCC's optimizer finds these in strings of its own library where that comes from a precompiled header.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-restrict;-Wno-stringop-overflow;-Wno-stringop-overread>
  # Code that a sanitizer has added hides from GCC that a value is set.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${VELLUM_SANITIZE}>>:-Wno-maybe-uninitialized>
  # A batch includes .cpp files one after the other: a local name may hide one of another file's anonymous namespace, and a
  # class of one file may have members of such a type.
  $<$<BOOL:${CMAKE_UNITY_BUILD}>:-Wno-shadow> $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${CMAKE_UNITY_BUILD}>>:-Wno-subobject-linkage>)
