# SPDX-License-Identifier: Apache-2.0
# vellum_embed_text(TARGET HEADER <path in the build folder> NAMESPACE <namespace> SOURCES file...)
#  Adds to TARGET a header with a `constexpr std::string_view` for each text file: kPage_<name with _ for each character
#  that is not a letter>, in NAMESPACE.
# As a script (cmake -P), it writes that header.
if(CMAKE_SCRIPT_MODE_FILE)
  set(text "#pragma once\n#include <string_view>\nnamespace ${NAMESPACE}\n{\n")
  foreach(source IN LISTS SOURCES)
    get_filename_component(name ${source} NAME)
    string(MAKE_C_IDENTIFIER "${name}" name)
    file(READ ${source} content)
    string(APPEND text "inline constexpr std::string_view kPage_${name} = R\"vellum(${content})vellum\";\n")
  endforeach()
  file(WRITE ${OUT} "${text}} // namespace ${NAMESPACE}\n")
  return()
endif()

function(vellum_embed_text TARGET)
  cmake_parse_arguments(ARG "" "HEADER;NAMESPACE" "SOURCES" ${ARGN})
  list(TRANSFORM ARG_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
  set(script ${PROJECT_SOURCE_DIR}/cmake/embed_text.cmake)
  add_custom_command(
    OUTPUT ${ARG_HEADER}
    COMMAND ${CMAKE_COMMAND} -DOUT=${ARG_HEADER} -DNAMESPACE=${ARG_NAMESPACE} "-DSOURCES=${ARG_SOURCES}" -P ${script}
    DEPENDS ${ARG_SOURCES} ${script}
    COMMENT "Texts for ${TARGET}"
    VERBATIM)
  target_sources(${TARGET} PRIVATE ${ARG_HEADER})
endfunction()
