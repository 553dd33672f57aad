// SPDX-License-Identifier: Apache-2.0
#include "library/structures.h"

#include "bake/bake.h"

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

void vellumInitTexture(VellumTexture *texture, size_t structSize)
{
    vellum::library::initialize(texture, structSize);
}

void vellumInitBakeInput(VellumBakeInput *input, size_t structSize)
{
    vellum::library::initialize(input, structSize);
}

void vellumInitBakeOptions(VellumBakeOptions *options, size_t structSize)
{
    vellum::library::initialize(options, structSize);
}
