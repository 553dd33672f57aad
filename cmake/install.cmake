# SPDX-License-Identifier: Apache-2.0
# Everything that is installed, by component: layer, command, runtime (libraries that programs load), devel and doc.
# All paths in installed files are relative, so that an installation can be moved.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(VELLUM_PACKAGE_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/Vellum)

# A library with headers, as a target of find_package(Vellum).
function(vellum_install_library TARGET EXPORT)
  install(TARGETS ${TARGET} EXPORT ${EXPORT}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT runtime NAMELINK_COMPONENT devel
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT devel
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT ${EXPORT} NAMESPACE Vellum:: DESTINATION ${VELLUM_PACKAGE_DIR} COMPONENT devel)
  vellum_install_headers(${ARGN})
endfunction()

function(vellum_install_headers)
  list(TRANSFORM ARGN PREPEND include/vellum/)
  install(FILES ${ARGN} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/vellum COMPONENT devel)
endfunction()

function(vellum_install_pkg_config NAME)
  file(RELATIVE_PATH PREFIX_FROM_PKGCONFIG ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
  configure_file(cmake/package/${NAME}.pc.in installed/${NAME}.pc @ONLY)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/installed/${NAME}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
          COMPONENT devel)
endfunction()

# The licence and the notices come with every component.
set(components doc)
set(examples "")

if(NOT VELLUM_LAYER_ONLY)
  list(APPEND components runtime devel)
  list(APPEND examples c cpp python)
  configure_package_config_file(cmake/package/VellumConfig.cmake.in installed/VellumConfig.cmake
                                INSTALL_DESTINATION ${VELLUM_PACKAGE_DIR} NO_SET_AND_CHECK_MACRO)
  write_basic_package_version_file(installed/VellumConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/installed/VellumConfig.cmake
                ${CMAKE_CURRENT_BINARY_DIR}/installed/VellumConfigVersion.cmake
          DESTINATION ${VELLUM_PACKAGE_DIR} COMPONENT devel)
  vellum_install_library(vellum_library VellumTargets vellum.h bake.h spirv.h)
  if(NOT BUILD_SHARED_LIBS)
    set(VELLUM_STATIC_LIBRARIES " -lstdc++ -lm -pthread")
    if(VELLUM_MESH_LIBRARIES)
      string(APPEND VELLUM_GLTF_STATIC_LIBRARIES " -ldraco -lmeshoptimizer")
    endif()
    if(VELLUM_IMAGE_LIBRARIES)
      string(APPEND VELLUM_GLTF_STATIC_LIBRARIES " -lavif -lwebp -lpng -ljpeg")
    endif()
    string(APPEND VELLUM_GLTF_STATIC_LIBRARIES " -lz")
    if(WIN32)
      string(APPEND VELLUM_GLTF_STATIC_LIBRARIES " -lbcrypt")
    else()
      string(APPEND VELLUM_GLTF_STATIC_LIBRARIES " -lcrypto")
    endif()
  endif()
  vellum_install_pkg_config(vellum)
endif()

if(NOT VELLUM_LIBRARY_ONLY)
  list(APPEND components layer devel)
  install(TARGETS VkLayer_vellum_opacity_micromap LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT layer)
  file(RELATIVE_PATH library_dir ${CMAKE_INSTALL_FULL_DATADIR}/vulkan/explicit_layer.d ${CMAKE_INSTALL_FULL_LIBDIR})
  set(library libVkLayer_vellum_opacity_micromap.so)
  if(NOT VELLUM_LAYER_BY_NAME)
    string(PREPEND library ${library_dir}/)
  endif()
  set(manifest ${CMAKE_CURRENT_BINARY_DIR}/installed/VkLayer_vellum_opacity_micromap.json)
  vellum_write_manifest(${manifest} VK_LAYER_VELLUM_opacity_micromap ${library})
  install(FILES ${manifest}
          DESTINATION ${CMAKE_INSTALL_DATADIR}/vulkan/explicit_layer.d COMPONENT layer)
  install(FILES ${PROJECT_BINARY_DIR}/share/reference/VK_LAYER_VELLUM_opacity_micromap.7
          DESTINATION ${CMAKE_INSTALL_MANDIR}/man7 COMPONENT layer)
  vellum_install_headers(vulkan_opacity_micromap.h)
  install(FILES cmake/opacity_micromap_mode.cmake DESTINATION ${VELLUM_PACKAGE_DIR} COMPONENT devel)
endif()

if(TARGET vellum) # not yet on Windows
  list(APPEND components command)
  list(APPEND examples gltf opacity_micromap slurm)
  vellum_install_library(vellum_gltf_library VellumGltfTargets gltf.h)
  vellum_install_library(vellum-gpubake VellumGpuBakeTargets gpu_bake.h)
  vellum_install_pkg_config(vellum-gltf)
  install(TARGETS vellum RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT command)
  set(reference ${PROJECT_BINARY_DIR}/share/reference)
  install(FILES ${PROJECT_SOURCE_DIR}/src/cli/schema.json DESTINATION ${CMAKE_INSTALL_DATADIR}/vellum COMPONENT command)
  install(DIRECTORY ${reference}/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT command FILES_MATCHING PATTERN "*.1")
  install(FILES ${reference}/vellum.bash DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME vellum
          COMPONENT command)
  install(FILES ${reference}/_vellum DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT command)
  install(FILES ${reference}/vellum.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT command)
endif()

list(REMOVE_DUPLICATES components)
foreach(component IN LISTS components)
  install(FILES LICENSE THIRD-PARTY.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT ${component})
endforeach()
install(FILES README.md CHANGELOG.md SECURITY.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT doc)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT doc FILES_MATCHING PATTERN *.md PATTERN *.png PATTERN *.svg)
foreach(example IN LISTS examples)
  install(DIRECTORY examples/${example} DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT doc
          PATTERN __pycache__ EXCLUDE)
endforeach()
# After everything that the documents may lead to.
install(CODE "
  foreach(path IN ITEMS ROOT=${CMAKE_INSTALL_DOCDIR} HEADERS=${CMAKE_INSTALL_INCLUDEDIR}/vellum
          SCHEMA=${CMAKE_INSTALL_DATADIR}/vellum/schema.json)
    string(REGEX MATCH \"^([A-Z]+)=(.*)$\" path \${path})
    cmake_path(APPEND CMAKE_INSTALL_PREFIX \${CMAKE_MATCH_2} OUTPUT_VARIABLE installed) # which may be absolute
    set(\${CMAKE_MATCH_1} \$ENV{DESTDIR}\${installed})
  endforeach()
  include(\"${PROJECT_SOURCE_DIR}/cmake/installed_links.cmake\")" COMPONENT doc)
