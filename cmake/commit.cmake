# SPDX-License-Identifier: Apache-2.0
# Writes the header HEADER with kCommit, the commit of the checkout or source archive SOURCE; empty if SOURCE is neither.
# usage: cmake -DSOURCE=folder -DHEADER=file [-DGIT=program] -P commit.cmake
cmake_minimum_required(VERSION 3.25)
file(READ ${SOURCE}/cmake/commit.txt commit) # scripts/archive replaces the placeholder in it
if(commit MATCHES "Format")
  set(commit "")
  if(GIT AND EXISTS ${SOURCE}/.git)
    execute_process(COMMAND ${GIT} -C ${SOURCE} rev-parse HEAD OUTPUT_VARIABLE commit ERROR_QUIET)
  endif()
endif()
string(SUBSTRING "${commit}" 0 12 commit)
string(STRIP "${commit}" commit)
file(CONFIGURE OUTPUT ${HEADER} CONTENT "inline constexpr const char *kCommit = \"${commit}\";\n" @ONLY)
