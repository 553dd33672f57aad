// SPDX-License-Identifier: Apache-2.0
// The functions of vellum/vellum.h.
#include "vellum/vellum.h"

#include <atomic>
#include <cstring>
#include <limits>
#include <memory>
#include <span>

#include "bake/bake.h"
#include "library/call.h"
#include "library/inputs.h"

namespace vellum::library
{

VellumTexture Structure<VellumTexture>::defaults()
{
    VellumTexture texture{};
    texture.structSize = sizeof texture;
    texture.format = VELLUM_FORMAT_R8_UNORM;
    texture.filter = VELLUM_FILTER_LINEAR;
    texture.addressModeU = VELLUM_ADDRESS_MODE_REPEAT;
    texture.addressModeV = VELLUM_ADDRESS_MODE_REPEAT;
    texture.scale = 1;
    return texture;
}

VellumBakeInput Structure<VellumBakeInput>::defaults()
{
    VellumBakeInput input{};
    input.structSize = sizeof input;
    input.uvFormat = VELLUM_FORMAT_R32G32_SFLOAT;
    input.indexType = VELLUM_INDEX_TYPE_NONE;
    input.uvTransform[0] = 1;
    input.uvTransform[4] = 1;
    input.cutoff = 0.5;
    return input;
}

VellumBakeOptions Structure<VellumBakeOptions>::defaults()
{
    const BakeOptions core;
    VellumBakeOptions options{};
    options.structSize = sizeof options;
    options.format = VELLUM_MICROMAP_FORMAT_4_STATE;
    options.twoStateRule = VELLUM_TWO_STATE_NEAREST;
    options.level = VELLUM_LEVEL_AUTOMATIC;
    options.maxLevel = core.maxLevel;
    options.compareOp = VELLUM_COMPARE_OP_GREATER_OR_EQUAL;
    options.budget = VELLUM_NO_BUDGET;
    for (size_t i = 0; i < kBakeNumbers.size(); ++i)
        options.*kNumbers[i] = core.*kBakeNumbers[i].member;
    options.maxDataSize = core.maxDataBytes;
    return options;
}

} // namespace vellum::library

using namespace vellum;
using namespace vellum::library;

struct VellumMicromap {
    // A geometry's part of the result.
    struct Geometry {
        size_t first;
        size_t count;
        std::vector<VellumMicromapUsage> usages;
    };

    BakeResult result;
    std::vector<VellumMicromapUsage> usages;
    std::vector<Geometry> geometries;
};

namespace
{

void countUsages(std::span<const BakeInput> inputs, VellumMicromap &made)
{
    const Micromap &micromap = made.result.micromap;
    made.usages = libraryUsages(usageOf(micromap.triangles));
    size_t first = 0;
    for (const BakeInput &input : inputs) {
        const auto indices = std::span(micromap.indices).subspan(first, input.triangles.size());
        made.geometries.push_back({first, indices.size(), libraryUsages(usageOf(micromap.triangles, indices, 0))});
        first += indices.size();
    }
}

std::unique_ptr<VellumMicromap> bakeAll(const Inputs &inputs, const VellumBakeOptions &given)
{
    BakeOptions options = readOptions(given);
    const Callbacks callbacks(given, options);
    auto made = std::make_unique<VellumMicromap>();
    made->result = bake(inputs.get(), options);
    if (callbacks.stopped())
        throw BakeCancelled();
    countUsages(inputs.get(), *made);
    return made;
}

template <typename Index>
VellumResult writeIndices(std::span<const int32_t> indices, void *output)
{
    auto *bytes = static_cast<unsigned char *>(output);
    for (const int32_t index : indices) {
        // The four highest values of each type are special.
        constexpr uint32_t kHighest = std::numeric_limits<Index>::max() - 4u;
        if (index < 0 ? index < VELLUM_SPECIAL_INDEX_FULLY_UNKNOWN_OPAQUE : static_cast<uint32_t>(index) > kHighest)
            return VELLUM_ERROR_INVALID_ARGUMENT;
        const auto written = static_cast<Index>(index);
        std::memcpy(bytes, &written, sizeof written);
        bytes += sizeof written;
    }
    return VELLUM_SUCCESS;
}

} // namespace

uint32_t vellumGetVersion()
{
    return VELLUM_HEADER_VERSION;
}

uint32_t vellumGetBakeVersion()
{
    return kBakeVersion;
}

const char *vellumResultName(VellumResult result)
{
    switch (static_cast<int>(result)) {
    case VELLUM_SUCCESS: return "VELLUM_SUCCESS";
    case VELLUM_CANCELLED: return "VELLUM_CANCELLED";
    case VELLUM_ERROR_INVALID_ARGUMENT: return "VELLUM_ERROR_INVALID_ARGUMENT";
    case VELLUM_ERROR_OUT_OF_MEMORY: return "VELLUM_ERROR_OUT_OF_MEMORY";
    case VELLUM_ERROR_TOO_LARGE: return "VELLUM_ERROR_TOO_LARGE";
    case VELLUM_ERROR_UNSUPPORTED: return "VELLUM_ERROR_UNSUPPORTED";
    case VELLUM_ERROR_INTERNAL: return "VELLUM_ERROR_INTERNAL";
    case VELLUM_ERROR_FILE: return "VELLUM_ERROR_FILE";
    default: return "unknown VellumResult";
    }
}

int vellumIsFlagSet(void *userData)
{
    // The caller's writes may be plain ones of another language.
    static_assert(sizeof(std::atomic<int32_t>) == sizeof(int32_t) && std::atomic<int32_t>::is_always_lock_free);
    const auto *flag = static_cast<const std::atomic<int32_t> *>(userData);
    return flag != nullptr && flag->load(std::memory_order_relaxed) != 0 ? 1 : 0;
}

void vellumInitTexture(VellumTexture *texture, size_t structSize)
{
    initialize(texture, structSize);
}

void vellumInitBakeInput(VellumBakeInput *input, size_t structSize)
{
    initialize(input, structSize);
}

void vellumInitBakeOptions(VellumBakeOptions *options, size_t structSize)
{
    initialize(options, structSize);
}

VellumResult vellumBake(const VellumBakeInput *inputs, size_t inputCount, const VellumBakeOptions *options,
                        VellumMicromap **micromap)
{
    if (micromap != nullptr)
        *micromap = nullptr;
    return guardedWith(options, [&](const VellumBakeOptions &known) {
        if (micromap == nullptr)
            throw invalid("there is no place for the result");
        *micromap = bakeAll(Inputs(inputs, inputCount), known).release();
    });
}

void vellumDestroyMicromap(VellumMicromap *micromap)
{
    delete micromap;
}

VellumResult vellumGetMicromapInfo(const VellumMicromap *micromap, VellumMicromapInfo *info)
{
    return guarded([&] {
        if (micromap == nullptr)
            throw invalid("there is no micromap");
        const Micromap &made = micromap->result.micromap;
        VellumMicromapInfo values{};
        values.data = made.data.data();
        values.dataSize = made.data.size();
        values.triangles = trianglesOf(made.triangles);
        values.triangleCount = made.triangles.size();
        values.usages = micromap->usages.data();
        values.usageCount = micromap->usages.size();
        values.indices = made.indices.data();
        values.indexCount = made.indices.size();
        const BakeStatistics &statistics = micromap->result.statistics;
        std::copy(statistics.states.begin(), statistics.states.end(), values.stateCounts);
        std::copy(statistics.special.begin(), statistics.special.end(), values.specialCounts);
        values.distinctCount = statistics.distinct;
        fill(info, values);
    });
}

VellumResult vellumGetGeometryInfo(const VellumMicromap *micromap, size_t input, VellumGeometryInfo *info)
{
    return guarded([&] {
        if (micromap == nullptr)
            throw invalid("there is no micromap");
        if (input >= micromap->geometries.size())
            throw invalid("there is no such input");
        const VellumMicromap::Geometry &geometry = micromap->geometries[input];
        VellumGeometryInfo values{};
        values.indices = micromap->result.micromap.indices.data() + geometry.first;
        values.indexCount = geometry.count;
        values.usages = geometry.usages.data();
        values.usageCount = geometry.usages.size();
        fill(info, values);
    });
}

VellumResult vellumWriteIndices(const int32_t *indices, size_t indexCount, uint32_t indexSize, void *output)
{
    if (indices == nullptr || output == nullptr)
        return VELLUM_ERROR_INVALID_ARGUMENT;
    const std::span all(indices, indexCount);
    switch (indexSize) {
    case 1: return writeIndices<uint8_t>(all, output);
    case 2: return writeIndices<uint16_t>(all, output);
    case 4: return writeIndices<uint32_t>(all, output);
    default: return VELLUM_ERROR_INVALID_ARGUMENT;
    }
}

VellumResult vellumGetState(const VellumMicromap *micromap, size_t triangle, float u, float v, uint32_t *state)
{
    if (micromap == nullptr || state == nullptr || triangle >= micromap->result.micromap.indices.size())
        return VELLUM_ERROR_INVALID_ARGUMENT;
    *state = static_cast<uint32_t>(micromap->result.micromap.stateAt(static_cast<uint32_t>(triangle), u, v));
    return VELLUM_SUCCESS;
}
