// SPDX-License-Identifier: Apache-2.0
// The states of one triangle.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "bake/bake.h"
#include "bake/piece.h"
#include "bake/stencil.h"
#include "bake/texture/cell_map.h"

namespace vellum
{

// Memory that a classification needs on its way; to be kept from one triangle to the next.
struct ClassifierScratch {
    std::array<Stencil, 2> stencils; // of micro-triangles; the second inverted
    std::vector<CellMap::Place> places;
    std::vector<Cell> cells;
    std::vector<NearCell> near;
    std::vector<uint32_t> lists;
};

class Classifier
{
public:
    // `texture` and `options` must outlive the classifier. The options must have been checked. `uvTerms`: that of
    // BakeInput.
    Classifier(const AlphaTexture &texture, const BakeOptions &options, double uvTerms = 0);

    [[nodiscard]] uint32_t levelFor(const TriangleUvs &uvs) const;
    // Writes the 4-state data of a triangle: packedBytes(level, Format::FourState) bytes, which must be 0. Safe to call
    // from several threads with a scratch each. Throws BakeCancelled when the options say so.
    void classify(const TriangleUvs &uvs, uint32_t level, uint8_t *packed, ClassifierScratch &scratch) const;

private:
    class Walk;

    const AlphaTexture &texture_;
    const BakeOptions &options_;
    double uvTerms_;
    Thresholds thresholds_;
    CellMap map_;
};

} // namespace vellum
