// SPDX-License-Identifier: Apache-2.0
#include "core/lossy.h"

#include <algorithm>

namespace vellum
{
namespace
{

using namespace shared;

constexpr uint8_t kMixed = kStateUnknownTransparent;

} // namespace

uint32_t lossyLevel(const uint8_t *data, uint32_t level, uint32_t priceLog2)
{
    const uint32_t micros = microTriangleCount(level);
    std::vector<uint8_t> nodes(micros); // kStateTransparent, kStateOpaque: all over; or kMixed
    uint32_t known = 0;
    for (uint32_t i = 0; i < micros; ++i) {
        const auto state = static_cast<uint8_t>(readState(data, i, Format::FourState));
        nodes[i] = std::min(state, kMixed);
        known += state < kMixed ? 1 : 0;
    }
    uint32_t best = level;
    uint32_t leastCost = micros;
    for (uint32_t l = level; l > kCoarseLevel; --l) {
        uint32_t left = 0; // known micro-triangles one level lower
        for (uint32_t i = 0; i < microTriangleCount(l - 1); ++i) {
            const uint8_t *child = &nodes[size_t{4} * i];
            const bool same = child[0] == child[1] && child[0] == child[2] && child[0] == child[3];
            nodes[i] = same ? child[0] : kMixed;
            left += nodes[i] < kMixed ? microTriangleCount(level - (l - 1)) : 0;
        }
        const uint32_t states = l - 1 > kCoarseLevel ? microTriangleCount(l - 1) : 0;
        const uint32_t cost = states + ((known - left) << priceLog2);
        if (cost <= leastCost) {
            leastCost = cost;
            best = l - 1;
        }
    }
    return best;
}

std::vector<uint8_t> coarsenedStates(const uint8_t *data, uint32_t level, uint32_t to)
{
    std::vector<uint8_t> out(packedBytes(to, Format::FourState));
    const uint32_t each = microTriangleCount(level - to);
    for (uint32_t node = 0; node < microTriangleCount(to); ++node) {
        uint32_t opaque = 0;
        bool unknown = false;
        for (uint32_t i = 0; i < each; ++i) {
            const auto state = static_cast<uint32_t>(readState(data, node * each + i, Format::FourState));
            opaque += state & 1;
            unknown |= state >= kStateUnknownTransparent;
        }
        const bool known = !unknown && (opaque == 0 || opaque == each);
        const uint32_t guess = 2 * opaque >= each ? 1 : 0;
        writeState(out.data(), node, Format::FourState, static_cast<State>(known ? guess : 2 | guess));
    }
    return out;
}

Micromap lossyMicromap(const Micromap &micromap, uint32_t priceLog2)
{
    Micromap out;
    out.indices = micromap.indices;
    out.baseTriangle = micromap.baseTriangle;
    for (const MicromapTriangle &t : micromap.triangles) {
        const uint8_t *data = micromap.data.data() + t.dataOffset;
        MicromapTriangle lossy = t;
        lossy.dataOffset = static_cast<uint32_t>(out.data.size());
        if (t.format == Format::FourState) {
            const uint32_t level = lossyLevel(data, t.subdivisionLevel, priceLog2);
            const std::vector<uint8_t> states = coarsenedStates(data, t.subdivisionLevel, level);
            lossy.subdivisionLevel = static_cast<uint16_t>(level);
            out.data.insert(out.data.end(), states.begin(), states.end());
        } else {
            out.data.insert(out.data.end(), data, data + packedBytes(t.subdivisionLevel, t.format));
        }
        out.triangles.push_back(lossy);
    }
    return out;
}

} // namespace vellum
