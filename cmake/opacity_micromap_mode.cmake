# SPDX-License-Identifier: Apache-2.0
# cmake -DIN=<plain.spv> -DOUT=<file.spv> -P opacity_micromap_mode.cmake
# Lets the ray queries of a SPIR-V module consume opacity micromaps: declares OpacityMicromapIdKHR for its entry point.
# On a device with VK_KHR_opacity_micromap and without VK_EXT_opacity_micromap, queries consume none unless a shader
# says so. In GLSL that is GL_EXT_opacity_micromap_ray_query_mode, which needs a newer glslang than Debian 12's; with one
# this step is not needed. The enumerants go as numbers, since assemblers of that age know no names for them.
find_program(SPIRV_AS spirv-as REQUIRED)
find_program(SPIRV_DIS spirv-dis REQUIRED)
find_program(SPIRV_VAL spirv-val REQUIRED)
set(CAPABILITY RayTracingOpacityMicromapExecutionModeKHR)
set(CAPABILITY_NUMBER 6032)
set(MODE_NUMBER 6031) # OpacityMicromapIdKHR

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    file(REMOVE ${OUT})
    message(FATAL_ERROR "${ARGV0}: ${errors}")
  endif()
endfunction()

run(${SPIRV_DIS} --raw-id --no-color ${IN} -o ${OUT}.txt)
file(READ ${OUT}.txt text)

# glslang writes one entry point, and the extension of ray queries in every module that has some. The layout of a module is fixed,
# so each of the four instructions goes next to one of its kind.
string(REGEX MATCHALL "OpEntryPoint [A-Za-z]+ %[0-9]+" entry "${text}")
string(REGEX MATCH "%[0-9]+ = OpTypeBool" bool "${text}")
string(FIND "${text}" "OpExtension \"SPV_KHR_ray_query\"\n" queries)
if(NOT entry MATCHES "^[^;]*(%[0-9]+)$" OR NOT bool OR queries EQUAL -1)
  message(FATAL_ERROR "${IN}: not a module with one entry point, ray queries and the type bool")
endif()
string(REGEX MATCH "%[0-9]+$" entry "${entry}")
string(REGEX MATCH "^%[0-9]+" bool "${bool}")
function(insert BEHIND LINE)
  string(REGEX REPLACE "(\n *${BEHIND}[^\n]*\n)" "\\1${LINE}\n" text "${text}")
  set(text "${text}" PARENT_SCOPE)
endfunction()
insert("OpCapability RayQueryKHR" "OpCapability !${CAPABILITY_NUMBER}")
insert("OpExtension \"SPV_KHR_ray_query\"" "OpExtension \"SPV_KHR_opacity_micromap\"")
insert("OpEntryPoint" "OpExecutionModeId ${entry} !${MODE_NUMBER} %consumes_micromaps")
insert("${bool} = OpTypeBool" "%consumes_micromaps = OpConstantTrue ${bool}")
file(WRITE ${OUT}.txt "${text}")
string(REGEX MATCH "; Version: ([0-9.]+)" version "${text}")
run(${SPIRV_AS} --target-env spv${CMAKE_MATCH_1} ${OUT}.txt -o ${OUT})

# A validator that does not know the capability can only reject it.
file(WRITE ${OUT}.probe "OpCapability ${CAPABILITY}\n")
execute_process(COMMAND ${SPIRV_AS} ${OUT}.probe -o ${OUT}.probe RESULT_VARIABLE unknown ERROR_QUIET)
if(unknown EQUAL 0)
  if(version MATCHES "1\\.6")
    set(environment vulkan1.3)
  else()
    set(environment vulkan1.2)
  endif()
  run(${SPIRV_VAL} --target-env ${environment} --scalar-block-layout ${OUT})
endif()
file(REMOVE ${OUT}.txt ${OUT}.probe)
