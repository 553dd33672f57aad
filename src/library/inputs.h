// SPDX-License-Identifier: Apache-2.0
// The input of a caller of vellumBake(), checked and as the baker takes it. Failures name the input.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "vellum/vellum.h"

namespace vellum::library
{

// Throws Failure. Reads everything but the callbacks.
BakeOptions readOptions(const VellumBakeOptions &options);

// The inputs of a bake, and what they point to.
class Inputs
{
public:
    // Throws Failure.
    Inputs(const VellumBakeInput *inputs, size_t count);

    [[nodiscard]] std::span<const BakeInput> get() const { return inputs_; }

private:
    void add(const VellumBakeInput &given);
    std::span<const AlphaTexture> texturesOf(const VellumBakeInput &given);

    std::vector<BakeInput> inputs_;
    std::map<std::string, std::vector<AlphaTexture>> textures_; // by the bytes of their descriptions
    std::vector<std::vector<TriangleUvs>> triangles_;
    std::vector<std::vector<Format>> formats_;
    size_t triangleCount_ = 0;
};

} // namespace vellum::library
