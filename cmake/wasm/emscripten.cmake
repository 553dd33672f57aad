# SPDX-License-Identifier: Apache-2.0
# Toolchain file of the preset `wasm`: WebAssembly by Emscripten, Debian's or that of an active emsdk.
find_program(EMCC emcc HINTS $ENV{EMSDK}/upstream/emscripten REQUIRED)
file(REAL_PATH ${EMCC} emcc)
cmake_path(GET emcc PARENT_PATH EMSCRIPTEN_ROOT_PATH)
include(${EMSCRIPTEN_ROOT_PATH}/cmake/Modules/Platform/Emscripten.cmake)

# Libraries of which the headers are enough come from /usr/include, which must not be on the compiler's path as a whole.
set(staged ${CMAKE_BINARY_DIR}/staged)
get_property(inTryCompile GLOBAL PROPERTY IN_TRY_COMPILE)
if(NOT inTryCompile)
  file(MAKE_DIRECTORY ${staged}/include)
  foreach(name boost rapidjson stb)
    file(CREATE_LINK /usr/include/${name} ${staged}/include/${name} SYMBOLIC)
  endforeach()
  list(APPEND CMAKE_FIND_ROOT_PATH ${staged})
endif()

# What Node.js 18 and the browsers of docs/javascript.md have: exceptions that cost nothing where none is thrown, SSE2 as 128-bit vectors,
# and conversions without a check for each.
set(flags "-fwasm-exceptions -msimd128 -msse2 -mnontrapping-fptoint -msign-ext")
set(CMAKE_C_FLAGS_INIT "${flags}")
set(CMAKE_CXX_FLAGS_INIT "${flags}")
