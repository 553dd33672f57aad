// The states of one triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"
#include "bake/cell_grid.h"

namespace vellum
{

struct TriangleStates {
    std::uint32_t level = 0;
    std::vector<std::uint8_t> packed; // 4-state data of `level`
};

class Classifier
{
public:
    // Both must outlive the classifier. The options must have been checked.
    Classifier(const AlphaTexture &texture, const BakeOptions &options);

    // Level and 4-state data of a triangle. Safe to call from several threads.
    [[nodiscard]] TriangleStates classify(const TriangleUvs &uvs) const;

private:
    struct Work;

    [[nodiscard]] std::uint32_t levelFor(const TriangleUvs &uvs) const;
    void descend(const Work &work, std::uint32_t index, std::uint32_t depth) const;
    [[nodiscard]] State guess(const Work &work, std::uint32_t index, std::uint32_t depth) const;

    const AlphaTexture &m_texture;
    const BakeOptions &m_options;
    CellGrid m_grid;
};

} // namespace vellum
