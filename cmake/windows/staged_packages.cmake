# SPDX-License-Identifier: Apache-2.0
# vellum_stage_packages(FOLDER DLLTOOL): a folder in which find_package() and find_path() find what a cross build for Windows
# uses of Debian's packages: links to headers, data files and sources, and an import library of vulkan-1.dll.
function(vellum_stage_packages FOLDER DLLTOOL)
  file(MAKE_DIRECTORY ${FOLDER}/include ${FOLDER}/share ${FOLDER}/lib)
  foreach(name boost CLI fmt rapidjson spirv stb vk_video vulkan)
    file(CREATE_LINK /usr/include/${name} ${FOLDER}/include/${name} SYMBOLIC)
  endforeach()
  foreach(name fonts vulkan)
    file(CREATE_LINK /usr/share/${name} ${FOLDER}/share/${name} SYMBOLIC)
  endforeach()
  vellum_stage_package(CLI11 "add_library(CLI11::CLI11 INTERFACE IMPORTED)\n")
  vellum_stage_package(fmt "add_library(fmt::fmt INTERFACE IMPORTED)
set_target_properties(fmt::fmt PROPERTIES INTERFACE_COMPILE_DEFINITIONS FMT_HEADER_ONLY=1)\n")
  vellum_stage_package(GTest "set(BUILD_SHARED_LIBS OFF)
set(INSTALL_GTEST OFF)
add_subdirectory(/usr/src/googletest \${CMAKE_BINARY_DIR}/googletest EXCLUDE_FROM_ALL)\n")
  vellum_stage_vulkan(${FOLDER} ${DLLTOOL})
endfunction()

# A package's configuration file.
macro(vellum_stage_package NAME CONTENT)
  file(CONFIGURE OUTPUT ${FOLDER}/lib/cmake/${NAME}/${NAME}Config.cmake
    CONTENT "if(NOT TARGET ${NAME}::staged)\nadd_library(${NAME}::staged INTERFACE IMPORTED)\n${CONTENT}endif()\n" @ONLY)
endmacro()

# Every command of the headers. The library loads vulkan-1.dll when the first of them is called, so that a program starts
# without it.
function(vellum_stage_vulkan FOLDER DLLTOOL)
  set(library ${FOLDER}/lib/libvulkan-1.a)
  set(header /usr/include/vulkan/vulkan_core.h)
  if(NOT ${header} IS_NEWER_THAN ${library})
    return()
  endif()
  file(STRINGS ${header} lines REGEX " VKAPI_CALL vk[A-Za-z0-9]+\\($")
  list(TRANSFORM lines REPLACE ".* VKAPI_CALL (vk[A-Za-z0-9]+)\\($" "\\1")
  list(JOIN lines "\n" names)
  file(WRITE ${FOLDER}/vulkan-1.def "LIBRARY vulkan-1.dll\nEXPORTS\n${names}\n")
  execute_process(COMMAND ${DLLTOOL} -d ${FOLDER}/vulkan-1.def -D vulkan-1.dll -y ${library} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
