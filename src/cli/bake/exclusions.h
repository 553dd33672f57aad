// SPDX-License-Identifier: Apache-2.0
// Finds mistakes in --exclude-material and --exclude-mesh.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "gltf/micromaps/document_bake.h"

namespace vellum::cli
{

// The patterns that match nothing in any of the documents. Several threads may note documents.
class UnmatchedExclusions
{
public:
    explicit UnmatchedExclusions(const DocumentBakeOptions &options)
        : materials_(options.excludedMaterials), meshes_(options.excludedMeshes)
    {
    }
    void note(const Document &document);
    // A document that was not read: any pattern may match in it.
    void noteUnread();
    // To stderr, a line each.
    void print() const;

private:
    std::mutex noting_;
    std::vector<std::string> materials_;
    std::vector<std::string> meshes_;
};

} // namespace vellum::cli
