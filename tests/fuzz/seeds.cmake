# cmake -DFROM=<build directory> -DTO=<directory> -P seeds.cmake
# Copies the SPIR-V modules of tests and layer to TO, and no others. Names tell where each comes from.
file(GLOB modules RELATIVE ${FROM} ${FROM}/tests/spirv/*.spv ${FROM}/tests/layer/shaders/*.spv
     ${FROM}/src/layer/shaders/*.spv ${FROM}/src/spirv/shaders/*.spv)
if(NOT modules)
  message(FATAL_ERROR "no SPIR-V modules under ${FROM}")
endif()
file(REMOVE_RECURSE ${TO})
file(MAKE_DIRECTORY ${TO})
foreach(module ${modules})
  string(REPLACE "/" "-" name ${module})
  file(CREATE_LINK ${FROM}/${module} ${TO}/${name} COPY_ON_ERROR SYMBOLIC)
endforeach()
