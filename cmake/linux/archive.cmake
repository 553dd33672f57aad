# SPDX-License-Identifier: Apache-2.0
# For the Linux archives of a release, which run on older systems: VELLUM_SYSROOT has an older C library, and no shared
# libraries but that and the Vulkan loader. VELLUM_PROCESSOR is x86_64 or aarch64.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES VELLUM_SYSROOT VELLUM_PROCESSOR)
if(VELLUM_PROCESSOR STREQUAL "aarch64")
  include(${CMAKE_CURRENT_LIST_DIR}/../arm64.cmake)
  list(APPEND CMAKE_CROSSCOMPILING_EMULATOR -E LD_LIBRARY_PATH=${VELLUM_SYSROOT}/loader)
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
  set(CMAKE_${kind}_LINKER_FLAGS_INIT "-static-libstdc++ -pthread -B${libraries}/ ${libraries}/older_libc.o")
endforeach()
# The Vulkan loader in the sysroot needs a newer C library than lies there; programs use the system's loader, and in
# the emulator the older one (scripts/sysroot).
string(APPEND CMAKE_EXE_LINKER_FLAGS_INIT " -Wl,--allow-shlib-undefined")
foreach(language C CXX)
  set(CMAKE_${language}_FLAGS_INIT -ffile-prefix-map=${CMAKE_SOURCE_DIR}=.)
endforeach()
# The cross compiler also searches the headers of its own C library first.
if(VELLUM_PROCESSOR STREQUAL "aarch64")
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} -dumpversion
    OUTPUT_VARIABLE version OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=include
    OUTPUT_VARIABLE own OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  set(cxx /usr/${CMAKE_LIBRARY_ARCHITECTURE}/include/c++/${version})
  set(headers "-isystem ${own}")
  foreach(folder ${CMAKE_LIBRARY_ARCHITECTURE} "")
    string(APPEND headers " -isystem ${VELLUM_SYSROOT}/usr/include/${folder}")
  endforeach()
  string(APPEND CMAKE_C_FLAGS_INIT " -nostdinc ${headers}")
  string(APPEND CMAKE_CXX_FLAGS_INIT
    " -nostdinc -isystem ${cxx} -isystem ${cxx}/${CMAKE_LIBRARY_ARCHITECTURE} -isystem ${cxx}/backward ${headers}")
endif()
