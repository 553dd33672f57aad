# SPDX-License-Identifier: Apache-2.0
# Toolchain file of the preset `windows`: 64-bit Windows, by Debian's mingw-w64 with posix threads. The compiler's runtime is
# linked statically, so that the programs need only DLLs of Windows.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR AMD64)
set(CMAKE_C_COMPILER x86_64-w64-mingw32-gcc-posix)
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix)
set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
# For programs that run during the build; with a WINEPREFIX of its own, not the user's.
set(CMAKE_CROSSCOMPILING_EMULATOR env WINEPREFIX=${CMAKE_BINARY_DIR}/wine WINEDLLOVERRIDES=mscoree,mshtml= wine)

# Libraries of which the headers are enough come from /usr/include, which must not be on the compiler's path as a whole.
set(VELLUM_STAGED ${CMAKE_BINARY_DIR}/staged)
get_property(inTryCompile GLOBAL PROPERTY IN_TRY_COMPILE)
if(NOT inTryCompile)
  include(${CMAKE_CURRENT_LIST_DIR}/staged_packages.cmake)
  vellum_stage_packages(${VELLUM_STAGED} x86_64-w64-mingw32-dlltool)
endif()

set(CMAKE_FIND_ROOT_PATH ${VELLUM_STAGED} /usr/x86_64-w64-mingw32)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ZLIB_LIBRARY /usr/x86_64-w64-mingw32/lib/libz.a CACHE FILEPATH "The static zlib")

# Windows 10; and no macros called min, max, ERROR or near.
set(flags "-isystem ${VELLUM_STAGED}/include -D_WIN32_WINNT=0x0A00 -DWIN32_LEAN_AND_MEAN -DNOMINMAX -DNOGDI")
# GCC takes inline functions of this system for its own: with -fipa-ra a caller relies on registers that its own copy of a
# function keeps, and the linker takes the copy of another object, which was compiled with other optimizations.
string(APPEND flags " -fno-ipa-ra")
set(CMAKE_C_FLAGS_INIT "${flags} -D__USE_MINGW_ANSI_STDIO=1")
set(CMAKE_CXX_FLAGS_INIT "${flags} -D__USE_MINGW_ANSI_STDIO=1")
foreach(type EXE SHARED MODULE)
  set(CMAKE_${type}_LINKER_FLAGS_INIT "-static -Wl,--no-insert-timestamp") # equal for equal objects
  set(CMAKE_${type}_LINKER_FLAGS_RELEASE_INIT "-s")
endforeach()
