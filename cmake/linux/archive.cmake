# SPDX-License-Identifier: Apache-2.0
# For the Linux archives of a release, which run on older systems: VELLUM_SYSROOT has an older C library, and no shared
# libraries but that and the Vulkan loader. VELLUM_PROCESSOR is x86_64 or aarch64.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES VELLUM_SYSROOT VELLUM_PROCESSOR)
if(VELLUM_PROCESSOR STREQUAL "aarch64")
  include(${CMAKE_CURRENT_LIST_DIR}/../arm64.cmake)
else()
  set(CMAKE_C_COMPILER gcc)
  set(CMAKE_CXX_COMPILER g++)
  set(CMAKE_LIBRARY_ARCHITECTURE x86_64-linux-gnu)
  set(CMAKE_SYSROOT ${VELLUM_SYSROOT})
  set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
  set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
endif()
# libgcc stays shared: every system has it, and exceptions of other libraries pass through it.
# Debian's compilers search the folders of their own C library before those of a sysroot, unless -B comes first.
set(libraries ${VELLUM_SYSROOT}/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE})
foreach(kind EXE SHARED MODULE)
  set(CMAKE_${kind}_LINKER_FLAGS_INIT "-static-libstdc++ -B${libraries}/ ${libraries}/older_libc.o")
endforeach()
foreach(language C CXX)
  set(CMAKE_${language}_FLAGS_INIT -ffile-prefix-map=${CMAKE_SOURCE_DIR}=.)
endforeach()
