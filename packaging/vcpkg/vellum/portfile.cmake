# SPDX-License-Identifier: Apache-2.0
# An overlay port of the checkout that it is in: vcpkg install "vellum[tools,images,meshes]" --overlay-ports=packaging/vcpkg
get_filename_component(SOURCE_PATH ${CMAKE_CURRENT_LIST_DIR}/../../.. ABSOLUTE)
vcpkg_check_features(OUT_FEATURE_OPTIONS feature_options
  FEATURES images VELLUM_IMAGE_LIBRARIES meshes VELLUM_MESH_LIBRARIES
  INVERTED_FEATURES tools VELLUM_LIBRARY_ONLY)
if("tools" IN_LIST FEATURES)
  vcpkg_check_linkage(ONLY_DYNAMIC_LIBRARY) # libvellum_gltf brings the libraries that it uses
  vcpkg_find_acquire_program(PYTHON3)
  vcpkg_add_to_path(${CURRENT_HOST_INSTALLED_DIR}/tools/spirv-tools)
  list(APPEND feature_options -DPython3_EXECUTABLE=${PYTHON3}
    -DGLSLANG=${CURRENT_HOST_INSTALLED_DIR}/tools/glslang/glslangValidator${VCPKG_HOST_EXECUTABLE_SUFFIX})
endif()
vcpkg_cmake_configure(SOURCE_PATH ${SOURCE_PATH} OPTIONS ${feature_options}
  MAYBE_UNUSED_VARIABLES VELLUM_IMAGE_LIBRARIES VELLUM_MESH_LIBRARIES)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/Vellum)
vcpkg_fixup_pkgconfig()
if("tools" IN_LIST FEATURES)
  vcpkg_copy_tools(TOOL_NAMES vellum AUTO_CLEAN)
endif()
file(REMOVE_RECURSE ${CURRENT_PACKAGES_DIR}/debug/include ${CURRENT_PACKAGES_DIR}/debug/share
  ${CURRENT_PACKAGES_DIR}/share/doc)
vcpkg_install_copyright(FILE_LIST ${SOURCE_PATH}/LICENSE ${SOURCE_PATH}/THIRD-PARTY.md)
