# SPDX-License-Identifier: Apache-2.0
# vellum_add_public_library(TARGET NAME name EXPORT name PARTS static_library...)
# A library for programs outside the project, called lib<NAME> (<NAME>.dll) and Vellum::<EXPORT>: shared or static, by
# BUILD_SHARED_LIBS. It has everything in PARTS, of which the first has its functions. exports.map in the target's folder
# lists them.
function(vellum_add_public_library TARGET)
  cmake_parse_arguments(ARG "" "NAME;EXPORT" "PARTS" ${ARGN})
  if(BUILD_SHARED_LIBS)
    list(POP_FRONT ARG_PARTS functions)
    add_library(${TARGET} SHARED)
    target_link_libraries(${TARGET} PRIVATE $<LINK_LIBRARY:WHOLE_ARCHIVE,${functions}> ${ARG_PARTS})
    vellum_export_only(${TARGET} ${CMAKE_CURRENT_SOURCE_DIR}/exports.map)
    if(WIN32)
      set_target_properties(${TARGET} PROPERTIES PREFIX "" IMPORT_PREFIX "")
    else()
      target_link_options(${TARGET} PRIVATE -Wl,--as-needed)
      if(NOT VELLUM_SANITIZE) # the program provides the sanitizers' functions
        target_link_options(${TARGET} PRIVATE -Wl,-z,defs)
      endif()
      # Before 1.0, minor versions may break programs; so their sonames differ.
      set_target_properties(${TARGET} PROPERTIES
        VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
    endif()
  else()
    add_library(${TARGET} STATIC)
    # CMake links these by itself only in projects that enable C++.
    target_link_libraries(${TARGET} INTERFACE $<$<LINK_LANGUAGE:C>:stdc++> $<$<LINK_LANGUAGE:C>:m>)
    foreach(part IN LISTS ARG_PARTS)
      target_sources(${TARGET} PRIVATE $<TARGET_OBJECTS:${part}>)
    endforeach()
  endif()
  target_include_directories(${TARGET} INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include>)
  set_target_properties(${TARGET} PROPERTIES OUTPUT_NAME ${ARG_NAME} EXPORT_NAME ${ARG_EXPORT} LINKER_LANGUAGE CXX)
  add_library(Vellum::${ARG_EXPORT} ALIAS ${TARGET})
  add_dependencies(vellum_products ${TARGET})
endfunction()

# vellum_export_only(TARGET exports.map): a shared library that exports what the linker's version script lists and nothing
# else. For a DLL a module definition file is made from it.
function(vellum_export_only TARGET EXPORTS)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${EXPORTS})
  if(NOT WIN32)
    target_sources(${TARGET} PRIVATE ${EXPORTS})
    target_link_options(${TARGET} PRIVATE -Wl,--version-script=${EXPORTS})
    set_target_properties(${TARGET} PROPERTIES LINK_DEPENDS ${EXPORTS})
    return()
  endif()
  file(STRINGS ${EXPORTS} names REGEX "^    [A-Za-z0-9_]+;$")
  list(TRANSFORM names REPLACE "[ ;]" "")
  list(JOIN names "\n" lines)
  set(definitions ${CMAKE_CURRENT_BINARY_DIR}/${TARGET}.def)
  file(CONFIGURE OUTPUT ${definitions} CONTENT "EXPORTS\n${lines}\n" @ONLY)
  target_sources(${TARGET} PRIVATE ${definitions})
endfunction()
