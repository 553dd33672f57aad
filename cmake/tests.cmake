# SPDX-License-Identifier: Apache-2.0
# vellum_add_test(NAME name COMMAND program|target arguments... [UNOPTIMIZED_SHADERS])
# Adds a CTest test whose processor time is recorded (tests/runner/cpu_times.py). Its programs find what lavapipe compiled
# for others; with UNOPTIMIZED_SHADERS lavapipe compiles faster, to slower code whose results may differ in the last bits.
#
# vellum_add_gtests(TARGET [PREFIX name.] [FILTER gtest_filter] [LABELLED] [WITH labels...] [WITHOUT labels...]
#                   [TIMEOUT seconds of one case] [COST seconds of one case] [ENVIRONMENT NAME=value...] [SLOW suites...]
#                   [THREADS suites...])
# Adds a CTest test for each test suite of a GoogleTest program, <PREFIX><suite>. tests/runner/run_cases.py runs all
# cases of it in one process, names each that fails, and survives a crash of one. The suites are looked up when ctest
# starts. WITH and WITHOUT choose cases by labels that the program has for them (run_cases.py). All but the SLOW ones
# and, of a LABELLED program, those with the label "slow", of which the names may be patterns, have the label "quick";
# the THREADS ones, and those with the label "threads", have the label "threads", as they are run with ThreadSanitizer.
# Suites of the highest cost, COST times cases, begin first, so that several jobs end together.
find_package(Python3 REQUIRED COMPONENTS Interpreter)
# The interpreter may be a script that looks for the real one, which takes longer than the test.
execute_process(COMMAND ${Python3_EXECUTABLE} -c "import sys; print(sys.executable)"
  OUTPUT_VARIABLE python OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
set(VELLUM_TEST_PYTHON ${python} CACHE INTERNAL "Python's interpreter")

function(vellum_add_test)
  cmake_parse_arguments(PARSE_ARGV 0 ARG UNOPTIMIZED_SHADERS NAME COMMAND)
  list(POP_FRONT ARG_COMMAND program)
  if(program STREQUAL Python3::Interpreter)
    set(program ${VELLUM_TEST_PYTHON})
  elseif(TARGET ${program})
    set(program ${CMAKE_CROSSCOMPILING_EMULATOR} $<TARGET_FILE:${program}>)
  endif()
  add_test(NAME ${ARG_NAME}
    COMMAND ${VELLUM_TEST_PYTHON} ${PROJECT_SOURCE_DIR}/tests/runner/cpu_times.py test ${ARG_NAME} ${program} ${ARG_COMMAND}
    COMMAND_EXPAND_LISTS)
  set(variables MESA_SHADER_CACHE_DIR=set:${PROJECT_BINARY_DIR}/shader_cache PYTHONDONTWRITEBYTECODE=set:1)
  if(ARG_UNOPTIMIZED_SHADERS)
    list(APPEND variables GALLIVM_PERF=set:nopt)
  endif()
  set_property(TEST ${ARG_NAME} PROPERTY ENVIRONMENT_MODIFICATION ${variables})
endfunction()

function(vellum_add_gtests TARGET)
  cmake_parse_arguments(ARG "LABELLED" "PREFIX;FILTER;TIMEOUT;COST" "ENVIRONMENT;SLOW;THREADS;WITH;WITHOUT" ${ARGN})
  set(runner ${PROJECT_SOURCE_DIR}/tests/runner/run_cases.py)
  set(program $<TARGET_FILE:${TARGET}>)
  set(words ${VELLUM_TEST_PYTHON} ${runner} --ctest --prefix=${ARG_PREFIX})
  if(ARG_TIMEOUT)
    list(APPEND words --timeout=${ARG_TIMEOUT})
  endif()
  if(ARG_COST)
    list(APPEND words --cost=${ARG_COST})
  endif()
  foreach(variable ${ARG_ENVIRONMENT})
    list(APPEND words --environment=${variable})
  endforeach()
  foreach(suite ${ARG_SLOW})
    list(APPEND words --slow=${suite})
  endforeach()
  foreach(suite ${ARG_THREADS})
    list(APPEND words --threads=${suite})
  endforeach()
  if(ARG_LABELLED)
    list(APPEND words --labelled)
  endif()
  foreach(label ${ARG_WITH})
    list(APPEND words --with=${label})
  endforeach()
  foreach(label ${ARG_WITHOUT})
    list(APPEND words --without=${label})
  endforeach()
  foreach(word ${CMAKE_CROSSCOMPILING_EMULATOR})
    list(APPEND words --emulator=${word})
  endforeach()
  list(APPEND words ${program})
  if(ARG_FILTER)
    list(APPEND words --gtest_filter=${ARG_FILTER})
  endif()
  set(command "")
  foreach(word IN LISTS words)
    string(APPEND command " [==[${word}]==]")
  endforeach()
  string(MAKE_C_IDENTIFIER "${TARGET}_${ARG_PREFIX}" name)
  set(listing ${CMAKE_CURRENT_BINARY_DIR}/${name}tests.cmake)
  set(script ${CMAKE_CURRENT_BINARY_DIR}/${name}suites.cmake)
  file(GENERATE OUTPUT ${script} CONTENT "\
if(NOT EXISTS [==[${program}]==])
  add_test([==[${ARG_PREFIX}${TARGET}_NOT_BUILT]==] [==[${TARGET}_NOT_BUILT]==])
else()
  foreach(source [==[${program}]==] [==[${runner}]==] [==[${script}]==])
    if(\"\${source}\" IS_NEWER_THAN [==[${listing}]==]) # also if there is no listing yet
      execute_process(COMMAND${command} OUTPUT_VARIABLE tests RESULT_VARIABLE result)
      if(NOT result EQUAL 0)
        message(FATAL_ERROR \"${TARGET} does not list its tests: \${result}\")
      endif()
      file(WRITE [==[${listing}]==] \"\${tests}\")
      break()
    endif()
  endforeach()
  include([==[${listing}]==])
endif()
")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${script})
endfunction()
