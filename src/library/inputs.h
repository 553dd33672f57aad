// What a caller of vellumBake() gives, checked and as the baker wants it. Failures name the input.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "vellum/vellum.h"

namespace vellum::library
{

// Throws Failure. Callbacks, `budget` included, are left out of neither.
BakeOptions readOptions(const VellumBakeOptions &options);

// The inputs of a bake, and what they point to.
class Inputs
{
public:
    // Throws Failure.
    Inputs(const VellumBakeInput *inputs, std::size_t count);

    [[nodiscard]] std::span<const BakeInput> get() const { return m_inputs; }

private:
    void add(const VellumBakeInput &given);
    std::span<const AlphaTexture> texturesOf(const VellumBakeInput &given);

    std::vector<BakeInput> m_inputs;
    std::map<std::string, std::vector<AlphaTexture>> m_textures; // by the bytes of their descriptions
    std::vector<std::vector<TriangleUvs>> m_triangles;
    std::vector<std::vector<Format>> m_formats;
    std::size_t m_triangleCount = 0;
};

} // namespace vellum::library
