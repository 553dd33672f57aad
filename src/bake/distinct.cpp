// SPDX-License-Identifier: Apache-2.0
#include "bake/distinct.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "bake/option_ranges.h"
#include "core/curve.h"

namespace vellum
{
namespace
{

void check(const AlphaTexture &texture)
{
    if (texture.width == 0 || texture.height == 0)
        throw BakeError("the alpha texture is empty");
    constexpr uint32_t kMostTexels = 1u << 24;
    if (texture.width > kMostTexels || texture.height > kMostTexels)
        throw BakeError("the alpha texture has more than 2^24 texels along a side");
    if (!texture.isComplete())
        throw BakeError("the alpha texture has no codes, and " + std::to_string(texture.alpha.size()) + " values for " +
                        std::to_string(texture.width) + " x " + std::to_string(texture.height) + " texels");
}

void checkLevel(uint32_t level)
{
    if (level > shared::kMaxSubdivisionLevel)
        throw BakeError("subdivision level " + std::to_string(level) + " is above 12");
}

void checkFormat(Format format)
{
    if (format != Format::TwoState && format != Format::FourState)
        throw BakeError("the micromap format is neither 2-state nor 4-state");
}

void check(const BakeOptions &options)
{
    checkLevel(options.level.value_or(options.maxLevel));
    checkFormat(options.format);
    for (const BakeNumber &number : kBakeNumbers)
        if (!number.accepts(options.*number.member))
            throw BakeError(std::string(number.name) + " is " + std::to_string(options.*number.member) + ", not " +
                            number.range);
    if (options.maxDataBytes > 0xffffffffu)
        throw BakeError("micromap data cannot be larger than 4 GiB");
    if (options.leastKnown && std::isnan(*options.leastKnown))
        throw BakeError("what has to be known is not a number");
    if (options.leastKnown && options.budget)
        throw BakeError("a budget and a least share that is known exclude each other");
}

void check(const BakeInput &input, const BakeOptions &options)
{
    if (input.textures.empty())
        throw BakeError("there is no alpha texture");
    for (const AlphaTexture &texture : input.textures)
        check(texture);
    if (!(input.uvTerms >= 0 && std::isfinite(input.uvTerms)))
        throw BakeError("what texture coordinates were computed from is not in its range");
    if (std::isnan(input.cutoff.value_or(options.cutoff)))
        throw BakeError("the alpha cutoff is not a number");
    if (!(input.valueTolerance.value_or(0) >= 0 && std::isfinite(input.valueTolerance.value_or(0))))
        throw BakeError("the tolerance of an input's values is not in its range");
    if (!input.weights.empty() && input.weights.size() != input.triangles.size())
        throw BakeError("there are " + std::to_string(input.weights.size()) + " weights for " +
                        std::to_string(input.triangles.size()) + " triangles");
    if (!input.levels.empty() && input.levels.size() != input.triangles.size())
        throw BakeError("there are " + std::to_string(input.levels.size()) + " levels for " +
                        std::to_string(input.triangles.size()) + " triangles");
    if (!input.formats.empty() && input.formats.size() != input.triangles.size())
        throw BakeError("there are " + std::to_string(input.formats.size()) + " formats for " +
                        std::to_string(input.triangles.size()) + " triangles");
    for (const uint8_t level : input.levels)
        checkLevel(level);
    for (const Format format : input.formats)
        checkFormat(format);
}

} // namespace

DistinctTriangles::DistinctTriangles(std::span<const BakeInput> inputs, const BakeOptions &options)
{
    size_t total = 0;
    for (const BakeInput &input : inputs)
        total += input.triangles.size();
    of.reserve(total);
    slots_.assign(std::bit_ceil(total * 2 + 2), 0);
    for (const BakeInput &input : inputs)
        add(input, options);
    slots_ = {};
    keys_ = {};
}

uint32_t DistinctTriangles::materialOf(const BakeInput &input, const BakeOptions &options)
{
    const auto [found, isNew] =
        materialOf_.try_emplace(BakeMaterial::keyOf(input, options), static_cast<uint32_t>(materials_.size()));
    if (isNew)
        materials_.push_back(std::make_unique<BakeMaterial>(input, options));
    return found->second;
}

void DistinctTriangles::add(const BakeInput &input, const BakeOptions &options)
{
    const uint32_t which = materialOf(input, options);
    const BakeMaterial &material = *materials_[which];
    for (size_t i = 0; i < input.triangles.size(); ++i) {
        const TriangleUvs &uvs = input.triangles[i];
        const Format format = input.formats.empty() ? options.format : input.formats[i];
        constexpr uint32_t kNoLevel = 255;
        const uint32_t level = input.levels.empty() ? kNoLevel : input.levels[i];
        const DistinctKey key{which, level << 8 | static_cast<uint32_t>(format), input.group, &uvs};
        // Cards repeat their two triangles.
        const size_t before = of.size();
        uint32_t found = before >= 2 && keys_[of[before - 2]] == key ? of[before - 2] : find(key);
        if (found == keys_.size()) {
            keys_.push_back(key);
            const bool automatic = level == kNoLevel && !options.level;
            triangles.push_back({&material, &uvs, level == kNoLevel ? material.levelFor(uvs) : level, 0, format,
                                 automatic, input.group, 0, 0});
        }
        Distinct &triangle = triangles[found];
        ++triangle.uses;
        triangle.weight += input.weights.empty() ? 1 : input.weights[i];
        of.push_back(found);
    }
}

uint32_t DistinctTriangles::find(const DistinctKey &key)
{
    size_t slot = key.hash() & (slots_.size() - 1);
    while (slots_[slot] != 0 && !(keys_[slots_[slot] - 1] == key))
        slot = (slot + 1) & (slots_.size() - 1);
    if (slots_[slot] == 0)
        slots_[slot] = static_cast<uint32_t>(keys_.size()) + 1;
    return slots_[slot] - 1;
}

bool isTooLittle(uint64_t known, uint32_t level, Format format, const BakeOptions &options)
{
    const uint64_t all = microTriangleCount(level);
    return format == Format::FourState && known != all &&
           static_cast<double>(known) < options.minKnown * static_cast<double>(all);
}

void pack(const Distinct &triangle, const BakeOptions &options, Packed &packed, BakeMaterial::Scratch &scratch)
{
    std::fill_n(packed.data, triangle.classifiedBytes(), uint8_t{0});
    triangle.material->classify(*triangle.uvs, triangle.level + triangle.folds, packed.data, scratch);
    for (uint32_t fold = triangle.folds; fold > 0; --fold)
        foldOnce(packed.data, triangle.level + fold);
    packed.counts = countStates(packed.data, triangle.level);
    finish(triangle, options, packed);
}

void finish(const Distinct &triangle, const BakeOptions &options, Packed &packed)
{
    auto &[transparent, opaque, unknownTransparent, unknownOpaque] = packed.counts;
    const uint64_t unknown = unknownTransparent + unknownOpaque;
    if (triangle.format == Format::TwoState) {
        toTwoState(packed.data, triangle.level, options.twoStateRule);
        const bool toOpaque = options.twoStateRule == TwoStateRule::UnknownIsOpaque;
        const bool nearest = options.twoStateRule == TwoStateRule::Nearest;
        const uint64_t more = toOpaque ? unknown : nearest ? unknownOpaque : 0;
        opaque += more;
        transparent += unknown - more;
        unknownTransparent = unknownOpaque = 0;
    } else if (isTooLittle(transparent + opaque, triangle.level, triangle.format, options)) {
        const bool mostlyOpaque = 2 * (opaque + unknownOpaque) >= microTriangleCount(triangle.level);
        packed.counts = {};
        packed.counts[static_cast<size_t>(mostlyOpaque ? State::UnknownOpaque : State::UnknownTransparent)] =
            microTriangleCount(triangle.level);
    }
    packed.uniform = uniformState(packed.counts);
    if (!packed.uniform)
        packed.hash = hashBytes(packed.data, packedBytes(triangle.level, triangle.format), triangle.level);
}

uint64_t dataKey(const Distinct &triangle, uint32_t level, const uint8_t *data, Format format)
{
    const uint64_t seed = uint64_t{triangle.group} << 32 | level << 8 | static_cast<uint32_t>(triangle.format);
    return std::max<uint64_t>(1, hashBytes(data, packedBytes(level, format), seed));
}

void checkBake(std::span<const BakeInput> inputs, const BakeOptions &options)
{
    check(options);
    for (const BakeInput &input : inputs)
        check(input, options);
}

} // namespace vellum
