// SPDX-License-Identifier: Apache-2.0
// The triangles of a bake that differ, and their classification.
#pragma once

#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "bake/bake.h"
#include "bake/classify.h"
#include "bake/packed.h"
#include "core/hash.h"
#include "core/parallel.h"

namespace vellum
{

// inParallel() of work that may be cancelled: then it throws BakeCancelled.
template <typename State, typename Function>
void inParallel(unsigned threads, size_t count, const std::function<bool()> &cancelled, Function &&function)
{
    vellum::inParallel<State>(threads, count, [&](size_t i, State &state) {
        if (cancelled && cancelled())
            throw BakeCancelled();
        function(i, state);
    });
}

// One mip chain with a cutoff.
class BakeMaterial
{
public:
    BakeMaterial(const BakeInput &input, const BakeOptions &options)
        : options_(options), swapped_(options.test == AlphaTest::Less || options.test == AlphaTest::Greater)
    {
        std::span<const AlphaTexture> textures = input.textures;
        options_.valueTolerance = input.valueTolerance.value_or(options.valueTolerance);
        // alpha < cutoff is the contrary of alpha >= cutoff, and alpha <= cutoff is -alpha >= -cutoff.
        options_.cutoff = input.cutoff.value_or(options.cutoff);
        if (options.test == AlphaTest::LessOrEqual || options.test == AlphaTest::Greater) {
            options_.cutoff = -options_.cutoff;
            negated_.assign(textures.begin(), textures.end());
            for (AlphaTexture &texture : negated_)
                texture.negate();
            textures = negated_;
        }
        for (const AlphaTexture &texture : textures)
            levels_.push_back(std::make_unique<Classifier>(texture, options_, input.uvTerms));
    }

    // Inputs with the same key have the same material.
    using Key = std::tuple<const AlphaTexture *, size_t, double, double, double>;
    static Key keyOf(const BakeInput &input, const BakeOptions &options)
    {
        return {input.textures.data(), input.textures.size(), input.cutoff.value_or(options.cutoff),
                input.valueTolerance.value_or(options.valueTolerance), input.uvTerms};
    }
    [[nodiscard]] uint32_t levelFor(const TriangleUvs &uvs) const { return levels_.front()->levelFor(uvs); }

    struct Scratch {
        ClassifierScratch classifier;
        std::vector<uint8_t> packed;
    };
    // Classifies like Classifier::classify, for all mip levels.
    void classify(const TriangleUvs &uvs, uint32_t level, uint8_t *packed, Scratch &scratch) const
    {
        levels_.front()->classify(uvs, level, packed, scratch.classifier);
        for (size_t i = 1; i < levels_.size(); ++i) {
            scratch.packed.assign(packedBytes(level, Format::FourState), 0);
            levels_[i]->classify(uvs, level, scratch.packed.data(), scratch.classifier);
            keepCommon(packed, scratch.packed.data(), level);
        }
        if (swapped_)
            swapOutcomes(packed, level);
    }

private:
    BakeOptions options_;
    bool swapped_;
    std::vector<AlphaTexture> negated_;
    std::vector<std::unique_ptr<Classifier>> levels_;
};

// A triangle that is different from all before it.
struct Distinct {
    const BakeMaterial *material;
    const TriangleUvs *uvs;
    uint32_t level;
    uint32_t folds; // levels that a budget takes from what is classified, `level + folds`
    Format format;
    bool automatic; // its level
    uint32_t group;
    uint64_t uses;
    double weight; // of all uses

    [[nodiscard]] uint32_t classifiedBytes() const { return packedBytes(level + folds, Format::FourState); }
};

// Everything that decides the data of a triangle.
struct DistinctKey {
    uint32_t material;
    uint32_t request; // level, or none, and format
    uint32_t group;
    const TriangleUvs *uvs; // compared by bits, so that NaNs are equal to themselves

    [[nodiscard]] uint64_t hash() const
    {
        return hashBytes(uvs, sizeof *uvs, uint64_t{material} << 32 ^ uint64_t{request} << 8 ^ group);
    }
    bool operator==(const DistinctKey &other) const
    {
        return material == other.material && request == other.request && group == other.group &&
               std::memcmp(uvs, other.uvs, sizeof *uvs) == 0;
    }
};

class DistinctTriangles
{
public:
    DistinctTriangles(std::span<const BakeInput> inputs, const BakeOptions &options);

    std::vector<Distinct> triangles;
    std::vector<uint32_t> of; // for each triangle of all inputs

private:
    uint32_t materialOf(const BakeInput &input, const BakeOptions &options);
    void add(const BakeInput &input, const BakeOptions &options);
    // The triangle with this key, or the next one.
    uint32_t find(const DistinctKey &key);

    std::vector<std::unique_ptr<BakeMaterial>> materials_;
    std::map<BakeMaterial::Key, uint32_t> materialOf_;
    std::vector<DistinctKey> keys_; // of each distinct triangle
    std::vector<uint32_t> slots_;   // by hash: one more than a distinct triangle, or 0
};

// The states of a distinct triangle, packed.
struct Packed {
    uint8_t *data;
    std::optional<State> uniform;
    StateCounts counts{};
    uint64_t hash = 0;
};

// Memory of a thread that classifies triangles one at a time.
struct PackedScratch {
    BakeMaterial::Scratch classifier;
    std::vector<uint8_t> packed;
};

// Returns whether a triangle with so many known micro-triangles gets a special index for unknown.
bool isTooLittle(uint64_t known, uint32_t level, Format format, const BakeOptions &options);

// Classifies a triangle into `packed.data`, which has its classifiedBytes().
void pack(const Distinct &triangle, const BakeOptions &options, Packed &packed, BakeMaterial::Scratch &scratch);

// The last part of pack(): turns 4-state data, with its counts, into what the format and the options make of it.
void finish(const Distinct &triangle, const BakeOptions &options, Packed &packed);

// A hash of all that triangles must have in common to share data; not 0.
uint64_t dataKey(const Distinct &triangle, uint32_t level, const uint8_t *data, Format format);

// Throws BakeError for options, levels or a texture out of range.
void checkBake(std::span<const BakeInput> inputs, const BakeOptions &options);

} // namespace vellum
