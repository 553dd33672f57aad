# vellum_embed_glsl(TARGET NAME symbol SOURCE file.comp [FLAGS ...] [TARGET_ENV env] [OPACITY_MICROMAP_MODE])
# Compiles a GLSL shader at build time and adds to TARGET a header "shaders/<symbol>.h" that defines
# `inline constexpr std::uint32_t <symbol>[]` (SPIR-V words). The shader is validated with spirv-val.
# TARGET_ENV: the environment that the SPIR-V is for, as spirv-val names it: vulkan1.2 (the default), vulkan1.1spv1.4, ...
# OPACITY_MICROMAP_MODE: its ray queries may consume micromaps (opacity_micromap_mode.cmake).
# The names of all shaders of TARGET are in its property VELLUM_SHADERS.
find_program(GLSLANG glslangValidator REQUIRED)
find_program(SPIRV_VAL spirv-val REQUIRED)

function(vellum_embed_glsl TARGET)
  cmake_parse_arguments(ARG "OPACITY_MICROMAP_MODE" "NAME;SOURCE;TARGET_ENV" "FLAGS" ${ARGN})
  cmake_path(ABSOLUTE_PATH ARG_SOURCE BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  set(dir ${CMAKE_CURRENT_BINARY_DIR}/shaders)
  set(spv ${dir}/${ARG_NAME}.spv)
  set(header ${dir}/${ARG_NAME}.h)
  set(words ${spv})
  set(scripts ${PROJECT_SOURCE_DIR}/cmake/embed_words.cmake)
  if(ARG_OPACITY_MICROMAP_MODE)
    set(words ${dir}/${ARG_NAME}.mode.spv)
    set(script ${PROJECT_SOURCE_DIR}/cmake/opacity_micromap_mode.cmake)
    set(set_mode COMMAND ${CMAKE_COMMAND} -DIN=${spv} -DOUT=${words} -P ${script})
    list(APPEND scripts ${script})
  endif()
  if(NOT ARG_TARGET_ENV)
    set(ARG_TARGET_ENV vulkan1.2)
  endif()
  string(REPLACE spv ";--target-env;spirv" glslang_env ${ARG_TARGET_ENV}) # glslang names the two parts separately
  file(MAKE_DIRECTORY ${dir})
  add_custom_command(
    OUTPUT ${spv} ${header} # the first must be what glslang's list of included files names
    COMMAND ${GLSLANG} --quiet --target-env ${glslang_env} -I${PROJECT_SOURCE_DIR}/src/core
            -I${PROJECT_SOURCE_DIR}/src/shaders ${ARG_FLAGS}
            --depfile ${spv}.d -o ${spv} ${ARG_SOURCE}
    COMMAND ${SPIRV_VAL} --target-env ${ARG_TARGET_ENV} --scalar-block-layout ${spv}
    ${set_mode}
    COMMAND ${CMAKE_COMMAND} -DIN=${words} -DOUT=${header} -DSYMBOL=${ARG_NAME}
            -P ${PROJECT_SOURCE_DIR}/cmake/embed_words.cmake
    DEPENDS ${ARG_SOURCE} ${scripts}
    DEPFILE ${spv}.d
    COMMENT "GLSL ${ARG_NAME}"
    VERBATIM)
  target_sources(${TARGET} PRIVATE ${header})
  set_property(TARGET ${TARGET} APPEND PROPERTY VELLUM_SHADERS ${ARG_NAME})
  target_include_directories(${TARGET} PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
endfunction()
