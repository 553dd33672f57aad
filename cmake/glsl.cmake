# SPDX-License-Identifier: Apache-2.0
# Shaders: GLSL that is compiled when the project is built, as headers "shaders/<symbol>.h" with `const uint32_t <symbol>[]`,
# the words of the module. Include one after what declares uint32_t. shaders.txt in the build folder lists all of them;
# the test shaders.Shaders validates them.
find_program(GLSLANG glslangValidator REQUIRED)
add_custom_target(vellum_shaders) # all of them; <TARGET>_shaders: those of one target
cmake_language(DEFER DIRECTORY ${PROJECT_SOURCE_DIR} CALL vellum_list_shaders)
function(vellum_list_shaders)
  get_property(shaders GLOBAL PROPERTY VELLUM_SHADERS)
  list(JOIN shaders "\n" lines)
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/shaders.txt CONTENT "${lines}\n" @ONLY)
endfunction()

function(vellum_add_shader_header TARGET HEADER)
  if(NOT TARGET ${TARGET}_shaders)
    add_custom_target(${TARGET}_shaders)
    add_dependencies(${TARGET} ${TARGET}_shaders)
    add_dependencies(vellum_shaders ${TARGET}_shaders)
  endif()
  target_sources(${TARGET}_shaders PRIVATE ${HEADER})
  target_sources(${TARGET} PRIVATE ${HEADER})
  target_include_directories(${TARGET} PRIVATE ${CMAKE_CURRENT_BINARY_DIR})
  set_property(GLOBAL APPEND PROPERTY VELLUM_SHADERS ${HEADER})
endfunction()

# vellum_embed_glsl(TARGET NAME symbol SOURCE file.comp [FLAGS ...] [TARGET_ENV env] [OPACITY_MICROMAP_MODE | OPTIMIZED])
# TARGET_ENV: the environment that the SPIR-V is for, as spirv-val names it: vulkan1.2 (the default), vulkan1.1spv1.4, ...
# The symbols of all shaders of TARGET are in its property VELLUM_SHADERS.
# OPACITY_MICROMAP_MODE: its ray queries may consume micromaps (opacity_micromap_mode.cmake).
# OPTIMIZED: by spirv-opt -O, as engines ship their modules.
function(vellum_embed_glsl TARGET)
  cmake_parse_arguments(ARG "OPACITY_MICROMAP_MODE;OPTIMIZED" "NAME;SOURCE;TARGET_ENV" "FLAGS" ${ARGN})
  cmake_path(ABSOLUTE_PATH ARG_SOURCE BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  if(NOT ARG_TARGET_ENV)
    set(ARG_TARGET_ENV vulkan1.2)
  endif()
  string(REPLACE spv ";--target-env;spirv" glslang_env ${ARG_TARGET_ENV}) # glslang names the two parts separately
  set_property(TARGET ${TARGET} APPEND PROPERTY VELLUM_SHADERS ${ARG_NAME})
  set(compile ${GLSLANG} --quiet --target-env ${glslang_env} -I${PROJECT_SOURCE_DIR}/src/core
      -I${PROJECT_SOURCE_DIR}/src/shaders -I${PROJECT_SOURCE_DIR}/src/gpu/shaders ${ARG_FLAGS} ${ARG_SOURCE})
  set(out ${CMAKE_CURRENT_BINARY_DIR}/shaders/${ARG_NAME}.h)
  set(embedded TRUE)
  if(ARG_OPACITY_MICROMAP_MODE OR ARG_OPTIMIZED)
    set(embedded FALSE)
    set(out ${CMAKE_CURRENT_BINARY_DIR}/modules/${ARG_NAME}.plain.spv)
  else()
    list(APPEND compile --vn ${ARG_NAME})
  endif()
  cmake_path(GET out PARENT_PATH folder)
  file(MAKE_DIRECTORY ${folder})
  add_custom_command(
    OUTPUT ${out}
    COMMAND ${compile} --depfile ${out}.d -o ${out}
    DEPENDS ${ARG_SOURCE}
    DEPFILE ${out}.d
    COMMENT "GLSL ${ARG_NAME}"
    VERBATIM)
  if(embedded)
    vellum_add_shader_header(${TARGET} ${out})
    return()
  endif()
  set(module ${CMAKE_CURRENT_BINARY_DIR}/modules/${ARG_NAME}.spv)
  if(ARG_OPTIMIZED)
    find_program(SPIRV_OPT spirv-opt REQUIRED)
    find_program(SPIRV_VAL spirv-val REQUIRED)
    set(second ${SPIRV_OPT} --target-env=${ARG_TARGET_ENV} -O ${out} -o ${module}
      COMMAND ${SPIRV_VAL} --target-env ${ARG_TARGET_ENV} ${module})
    set(tool)
  else()
    set(tool ${PROJECT_SOURCE_DIR}/cmake/opacity_micromap_mode.cmake)
    set(second ${CMAKE_COMMAND} -DIN=${out} -DOUT=${module} -P ${tool})
  endif()
  add_custom_command(OUTPUT ${module} COMMAND ${second} DEPENDS ${out} ${tool} VERBATIM)
  vellum_embed_module(${TARGET} ${ARG_NAME} ${module})
endfunction()

# vellum_embed_module(TARGET symbol file.spv): a module that is not made by glslang alone.
function(vellum_embed_module TARGET NAME MODULE)
  set(header ${CMAKE_CURRENT_BINARY_DIR}/shaders/${NAME}.h)
  set(script ${PROJECT_SOURCE_DIR}/cmake/embed_words.cmake)
  add_custom_command(
    OUTPUT ${header}
    COMMAND ${CMAKE_COMMAND} -DIN=${MODULE} -DOUT=${header} -DSYMBOL=${NAME} -P ${script}
    DEPENDS ${MODULE} ${script}
    VERBATIM)
  vellum_add_shader_header(${TARGET} ${header})
endfunction()

# vellum_embed_stages(TARGET NAME prefix SOURCE file.glsl STAGES stage... [FLAGS ...] [TARGET_ENV env])
# <prefix>_<stage> for each stage. The file finds out which it is by a macro, the stage's name in capitals.
set(VELLUM_SUFFIXES_OF_STAGES vertex vert geometry geom task task mesh mesh fragment frag compute comp query comp queries comp raygen rgen
    miss rmiss closest_hit rchit any_hit rahit intersection rint callable rcall)
function(vellum_embed_stages TARGET)
  cmake_parse_arguments(ARG "" "NAME;SOURCE;TARGET_ENV" "STAGES;FLAGS" ${ARGN})
  foreach(stage IN LISTS ARG_STAGES)
    vellum_stage_flags(flags ${stage})
    vellum_embed_glsl(${TARGET} NAME ${ARG_NAME}_${stage} SOURCE ${ARG_SOURCE} FLAGS ${flags} ${ARG_FLAGS}
      TARGET_ENV ${ARG_TARGET_ENV})
  endforeach()
endfunction()

# Sets the flags that glslang needs to compile such a file as one stage.
function(vellum_stage_flags FLAGS STAGE)
  list(FIND VELLUM_SUFFIXES_OF_STAGES ${STAGE} at)
  if(at EQUAL -1)
    message(FATAL_ERROR "${STAGE} is no stage; add it to VELLUM_SUFFIXES_OF_STAGES")
  endif()
  math(EXPR at "${at} + 1")
  list(GET VELLUM_SUFFIXES_OF_STAGES ${at} suffix)
  string(TOUPPER ${STAGE} macro)
  set(${FLAGS} -S ${suffix} -D${macro} PARENT_SCOPE)
endfunction()
