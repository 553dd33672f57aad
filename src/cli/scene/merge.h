// SPDX-License-Identifier: Apache-2.0
// Makes a scene quicker to trace.
#pragma once

#include "gltf/scene.h"

namespace vellum::cli
{

// Makes one mesh of all meshes that have one instance and are not mirrored, in the world's space and first of all: rays
// visit one structure then where there would be many, one over the other. Leaves out instances that their transform
// flattens (VUID-VkTransformMatrixKHR-matrix-03799) of meshes that have others.
void mergeSingleMeshes(Scene &scene);

} // namespace vellum::cli
