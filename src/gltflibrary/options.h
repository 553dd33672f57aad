// SPDX-License-Identifier: Apache-2.0
// The options of vellum/gltf.h for what bakes or compares documents.
#pragma once

#include "gltf/micromaps/document_bake.h"
#include "vellum/gltf.h"

namespace vellum::library
{

// Sets what the structures have: not the callbacks, not VELLUM_GLTF_BAKE_EMBED_BIT. Throws Failure.
void readDocumentOptions(const VellumBakeOptions &bake, const VellumGltfBakeOptions &given,
                         DocumentBakeOptions &options);

} // namespace vellum::library
