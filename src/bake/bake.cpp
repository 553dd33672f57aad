// SPDX-License-Identifier: Apache-2.0
#include "bake/bake.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>

#include "bake/budget.h"
#include "bake/classify.h"
#include "bake/option_ranges.h"
#include "bake/packed.h"
#include "core/curve.h"
#include "core/hash.h"
#include "core/large_memory.h"
#include "core/parallel.h"

namespace vellum
{
namespace
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

// The micromap as it grows, each different piece of data once.
class MicromapAssembly
{
public:
    // `bytes` of data are not exceeded, as far as is known.
    explicit MicromapAssembly(uint64_t bytes);

    // The index of a micromap triangle with this data, which becomes part of the micromap unless it is already. Throws
    // BakeTooLarge where that takes it beyond `maxDataBytes`.
    int32_t add(const uint8_t *data, uint32_t level, Format format, uint64_t hash, uint64_t maxDataBytes);

    Micromap micromap;

private:
    void grow();

    std::vector<uint64_t> hashes_; // of each micromap triangle
    std::vector<int32_t> slots_;   // by hash: micromap triangles, -1 if empty
};

MicromapAssembly::MicromapAssembly(uint64_t bytes) : slots_(64, -1)
{
    // Capacity that is never used costs addresses only; a vector that grows needs the old and the new memory at once.
    reserveLarge(micromap.data, bytes);
}

void MicromapAssembly::grow()
{
    std::vector<int32_t> slots(slots_.size() * 2, -1);
    for (size_t i = 0; i < hashes_.size(); ++i) {
        size_t slot = hashes_[i] & (slots.size() - 1);
        while (slots[slot] >= 0)
            slot = (slot + 1) & (slots.size() - 1);
        slots[slot] = static_cast<int32_t>(i);
    }
    slots_ = std::move(slots);
}

int32_t MicromapAssembly::add(const uint8_t *data, uint32_t level, Format format, uint64_t hash, uint64_t maxDataBytes)
{
    const size_t bytes = packedBytes(level, format);
    size_t slot = hash & (slots_.size() - 1);
    for (; slots_[slot] >= 0; slot = (slot + 1) & (slots_.size() - 1)) {
        const auto which = static_cast<size_t>(slots_[slot]);
        const MicromapTriangle &t = micromap.triangles[which];
        if (hashes_[which] == hash && t.subdivisionLevel == level && t.format == format &&
            std::memcmp(micromap.data.data() + t.dataOffset, data, bytes) == 0)
            return slots_[slot];
    }
    if (micromap.data.size() + bytes > maxDataBytes)
        throw BakeTooLarge("the micromap would be larger than " + std::to_string(maxDataBytes) +
                           " bytes; choose a lower subdivision level or a budget");
    const auto index = static_cast<int32_t>(micromap.triangles.size());
    slots_[slot] = index;
    hashes_.push_back(hash);
    micromap.triangles.push_back({static_cast<uint32_t>(micromap.data.size()), static_cast<uint16_t>(level), format});
    micromap.data.insert(micromap.data.end(), data, data + bytes);
    if (hashes_.size() * 2 > slots_.size())
        grow();
    return index;
}

void check(const AlphaTexture &texture)
{
    if (texture.width == 0 || texture.height == 0)
        throw BakeError("the alpha texture is empty");
    constexpr uint32_t kMostTexels = 1u << 24;
    if (texture.width > kMostTexels || texture.height > kMostTexels)
        throw BakeError("the alpha texture has more than 2^24 texels along a side");
    if (texture.alpha.size() != size_t{texture.width} * texture.height)
        throw BakeError("the alpha texture has " + std::to_string(texture.alpha.size()) + " values for " +
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

// One mip chain with a cutoff.
class Material
{
public:
    Material(const BakeInput &input, const BakeOptions &options)
        : source_(input.textures), cutoff_(input.cutoff.value_or(options.cutoff)), uvTerms_(input.uvTerms),
          options_(options), swapped_(options.test == AlphaTest::Less || options.test == AlphaTest::Greater)
    {
        std::span<const AlphaTexture> textures = input.textures;
        options_.valueTolerance = input.valueTolerance.value_or(options.valueTolerance);
        // alpha < cutoff is the contrary of alpha >= cutoff, and alpha <= cutoff is -alpha >= -cutoff.
        options_.cutoff = cutoff_;
        if (options.test == AlphaTest::LessOrEqual || options.test == AlphaTest::Greater) {
            options_.cutoff = -cutoff_;
            negated_.assign(textures.begin(), textures.end());
            for (AlphaTexture &texture : negated_) {
                texture.border = -texture.border;
                for (float &alpha : texture.alpha)
                    alpha = -alpha;
            }
            textures = negated_;
        }
        for (const AlphaTexture &texture : textures)
            levels_.push_back(std::make_unique<Classifier>(texture, options_, uvTerms_));
    }

    [[nodiscard]] bool isOf(const BakeInput &input, const BakeOptions &options) const
    {
        return input.textures.data() == source_.data() && input.textures.size() == source_.size() &&
               input.cutoff.value_or(options.cutoff) == cutoff_ &&
               input.valueTolerance.value_or(options.valueTolerance) == options_.valueTolerance &&
               input.uvTerms == uvTerms_;
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
    std::span<const AlphaTexture> source_;
    double cutoff_;
    double uvTerms_;
    BakeOptions options_;
    bool swapped_;
    std::vector<AlphaTexture> negated_;
    std::vector<std::unique_ptr<Classifier>> levels_;
};

// A triangle that is different from all before it.
struct Distinct {
    const Material *material;
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
struct Key {
    uint32_t material;
    uint32_t request; // level, or none, and format
    uint32_t group;
    std::array<uint32_t, 6> uvs; // bits, so that NaNs are equal to themselves
    bool operator==(const Key &) const = default;
};

class DistinctTriangles
{
public:
    DistinctTriangles(std::span<const BakeInput> inputs, const BakeOptions &options)
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

    std::vector<Distinct> triangles;
    std::vector<uint32_t> of; // for each triangle of all inputs

private:
    uint32_t materialOf(const BakeInput &input, const BakeOptions &options)
    {
        for (size_t i = 0; i < materials_.size(); ++i)
            if (materials_[i]->isOf(input, options))
                return static_cast<uint32_t>(i);
        materials_.push_back(std::make_unique<Material>(input, options));
        return static_cast<uint32_t>(materials_.size() - 1);
    }

    void add(const BakeInput &input, const BakeOptions &options)
    {
        const uint32_t which = materialOf(input, options);
        const Material &material = *materials_[which];
        for (size_t i = 0; i < input.triangles.size(); ++i) {
            const TriangleUvs &uvs = input.triangles[i];
            const Format format = input.formats.empty() ? options.format : input.formats[i];
            constexpr uint32_t kNoLevel = 255;
            const uint32_t level = input.levels.empty() ? kNoLevel : input.levels[i];
            Key key{which, level << 8 | static_cast<uint32_t>(format), input.group, {}};
            for (size_t k = 0; k < 3; ++k) {
                key.uvs[2 * k] = std::bit_cast<uint32_t>(uvs[k].u);
                key.uvs[2 * k + 1] = std::bit_cast<uint32_t>(uvs[k].v);
            }
            const uint64_t hash = hashBytes(&key, sizeof key);
            size_t slot = hash & (slots_.size() - 1);
            while (slots_[slot] != 0 && keys_[slots_[slot] - 1] != key)
                slot = (slot + 1) & (slots_.size() - 1);
            if (slots_[slot] == 0) {
                keys_.push_back(key);
                const bool automatic = level == kNoLevel && !options.level;
                triangles.push_back({&material, &uvs, level == kNoLevel ? material.levelFor(uvs) : level, 0, format,
                                     automatic, input.group, 0, 0});
                slots_[slot] = static_cast<uint32_t>(triangles.size());
            }
            ++triangles[slots_[slot] - 1].uses;
            triangles[slots_[slot] - 1].weight += input.weights.empty() ? 1 : double{input.weights[i]};
            of.push_back(slots_[slot] - 1);
        }
    }

    std::vector<std::unique_ptr<Material>> materials_;
    std::vector<Key> keys_;       // of each distinct triangle
    std::vector<uint32_t> slots_; // by hash: one more than a distinct triangle, or 0
};

// The states of a distinct triangle, packed.
struct Packed {
    uint8_t *data;
    std::optional<State> uniform;
    StateCounts counts{};
    uint64_t hash = 0;
};

// Returns whether a triangle with so many known micro-triangles gets a special index for unknown.
bool isTooLittle(uint64_t known, uint32_t level, Format format, const BakeOptions &options)
{
    const uint64_t all = microTriangleCount(level);
    return format == Format::FourState && known != all &&
           static_cast<double>(known) < options.minKnown * static_cast<double>(all);
}

void pack(const Distinct &triangle, const BakeOptions &options, Packed &packed, Material::Scratch &scratch)
{
    std::fill_n(packed.data, triangle.classifiedBytes(), uint8_t{0});
    triangle.material->classify(*triangle.uvs, triangle.level + triangle.folds, packed.data, scratch);
    for (uint32_t fold = triangle.folds; fold > 0; --fold)
        foldOnce(packed.data, triangle.level + fold);
    packed.counts = countStates(packed.data, triangle.level);
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

// A hash of all that triangles must have in common to share data; not 0.
uint64_t dataKey(const Distinct &triangle, uint32_t level, const uint8_t *data, Format format)
{
    const uint64_t seed = uint64_t{triangle.group} << 32 | level << 8 | static_cast<uint32_t>(triangle.format);
    return std::max<uint64_t>(1, hashBytes(data, packedBytes(level, format), seed));
}

// What a triangle is at the levels from `from` to `to`, by folding what it is at `to`.
void describe(const Distinct &triangle, uint32_t from, uint32_t to, const BakeOptions &options, LevelChoice &choice,
              Material::Scratch &classifier, std::vector<uint8_t> &packed)
{
    packed.assign(packedBytes(to, Format::FourState), 0);
    triangle.material->classify(*triangle.uvs, to, packed.data(), classifier);
    for (uint32_t level = to + 1; level-- > from;) {
        if (level < to)
            foldOnce(packed.data(), level + 1);
        const StateCounts counts = countStates(packed.data(), level);
        const uint64_t known = counts[0] + counts[1];
        const uint64_t all = microTriangleCount(level);
        const bool special = uniformState(counts) || isTooLittle(known, level, triangle.format, options);
        choice.known[level] = special && known != all ? 0 : static_cast<float>(known) / static_cast<float>(all);
        choice.data[level] = special ? 0 : dataKey(triangle, level, packed.data(), Format::FourState);
    }
}

// The bytes of the groups of which no triangle has data.
uint64_t emptyBytes(const DistinctTriangles &distinct, std::span<const LevelChoice> choices, const BakeOptions &options)
{
    std::map<uint32_t, bool> haveData;
    for (size_t i = 0; i < choices.size(); ++i) {
        bool &hasData = haveData[distinct.triangles[i].group];
        hasData = hasData || choices[i].data[choices[i].level] != 0;
    }
    const auto empty = std::count_if(haveData.begin(), haveData.end(), [](const auto &group) { return !group.second; });
    return options.emptyGroupBytes * static_cast<uint64_t>(empty);
}

// The bytes without a budget. 2-state data is often equal where the states that it is made from are not.
uint64_t unchangedBytes(const DistinctTriangles &distinct, std::span<const LevelChoice> choices,
                        const BakeOptions &options, unsigned threads)
{
    std::vector<LevelChoice> stored(choices.begin(), choices.end());
    struct Scratch {
        Material::Scratch classifier;
        std::vector<uint8_t> packed;
    };
    inParallel<Scratch>(threads, stored.size(), options.cancelled, [&](size_t i, Scratch &scratch) {
        const Distinct &triangle = distinct.triangles[i];
        if (triangle.format != Format::TwoState)
            return;
        scratch.packed.resize(triangle.classifiedBytes());
        Packed packed{scratch.packed.data(), {}, {}, 0};
        pack(triangle, options, packed, scratch.classifier);
        stored[i].data[triangle.level] =
            packed.uniform ? 0 : dataKey(triangle, triangle.level, packed.data, triangle.format);
    });
    return sharedBytes(stored) + emptyBytes(distinct, stored, options);
}

// Above the level of about texelsPerEdge, levels can be raised by that many: to an eighth of it.
constexpr uint32_t kMostRaised = 3;

// Levels that keep the result within the budget and make the most known, by what each triangle would be at each of
// them.
void applyBudget(DistinctTriangles &distinct, const BakeOptions &options, unsigned threads, Progress &progress)
{
    // The most bytes that separateSpecialIndices() adds.
    const uint64_t more = options.disallowMixedSpecialIndices ? 4 * (kRecordBytes + 1) : 0;
    const uint64_t budget = *options.budget - std::min(*options.budget, more);
    std::vector<LevelChoice> choices(distinct.triangles.size());
    struct Scratch {
        Material::Scratch classifier;
        std::vector<uint8_t> packed;
    };
    inParallel<Scratch>(threads, choices.size(), options.cancelled, [&](size_t i, Scratch &scratch) {
        const Distinct &triangle = distinct.triangles[i];
        LevelChoice &choice = choices[i];
        choice.weight = triangle.weight;
        choice.level = choice.highest = triangle.level;
        choice.format = triangle.format;
        describe(triangle, 0, triangle.level, options, choice, scratch.classifier, scratch.packed);
        progress.done(triangle.uses);
    });
    const bool any2State = std::any_of(distinct.triangles.begin(), distinct.triangles.end(),
                                       [](const Distinct &triangle) { return triangle.format == Format::TwoState; });
    uint64_t empty = emptyBytes(distinct, choices, options);
    const uint64_t bytes =
        any2State ? unchangedBytes(distinct, choices, options, threads) : sharedBytes(choices) + empty;
    if (bytes > budget) {
        // Groups that lose their data on the way take bytes, for which others have to be lowered.
        for (uint64_t before = ~uint64_t{0}; before != empty;) {
            before = empty;
            lowerLevels(choices, budget - std::min(budget, empty));
            empty = emptyBytes(distinct, choices, options);
        }
    } else {
        inParallel<Scratch>(threads, choices.size(), options.cancelled, [&](size_t i, Scratch &scratch) {
            const Distinct &triangle = distinct.triangles[i];
            uint32_t highest = triangle.automatic ? std::min(triangle.level + kMostRaised, options.maxLevel) : 0;
            while (highest > triangle.level && packedBytes(highest, triangle.format) > budget - bytes)
                --highest;
            if (highest <= triangle.level || choices[i].known[triangle.level] >= 1)
                return;
            choices[i].highest = highest;
            describe(triangle, triangle.level + 1, highest, options, choices[i], scratch.classifier, scratch.packed);
        });
    }
    raiseLevels(choices, std::min(budget - std::min(budget, empty), options.maxDataBytes));
    for (size_t i = 0; i < choices.size(); ++i) {
        Distinct &triangle = distinct.triangles[i];
        const uint32_t classified = choices[i].level > triangle.level ? choices[i].highest : triangle.level;
        triangle.folds = classified - choices[i].level;
        triangle.level = choices[i].level;
    }
}

// Where an input has both kinds, its special indices become micromap triangles of level 0.
void separateSpecialIndices(std::span<const BakeInput> inputs, const BakeOptions &options, MicromapAssembly &assembly)
{
    size_t first = 0;
    for (const BakeInput &input : inputs) {
        const auto begin = assembly.micromap.indices.begin() + static_cast<ptrdiff_t>(first);
        const auto end = begin + static_cast<ptrdiff_t>(input.triangles.size());
        first += input.triangles.size();
        if (std::none_of(begin, end, [](int32_t index) { return index >= 0; }))
            continue;
        for (auto index = begin; index != end; ++index) {
            const std::optional<State> state = specialState(*index);
            if (!state)
                continue;
            const bool known = *state == State::Opaque || *state == State::Transparent;
            const Format format = known && options.format == Format::TwoState ? Format::TwoState : Format::FourState;
            const auto data = static_cast<uint8_t>(*state);
            *index = assembly.add(&data, 0, format, hashBytes(&data, 1), options.maxDataBytes);
        }
    }
}

} // namespace

BakeResult bake(std::span<const BakeInput> inputs, const BakeOptions &options)
{
    check(options);
    for (const BakeInput &input : inputs)
        check(input, options);
    const unsigned threads = threadCount(options.threads);

    DistinctTriangles distinct(inputs, options);
    const size_t total = distinct.of.size();
    Progress progress(options.progress, options.budget ? 2 * total : total);
    if (options.budget)
        applyBudget(distinct, options, threads, progress);

    BakeResult result;
    result.statistics.distinct = distinct.triangles.size();
    uint64_t most = 0;
    for (const Distinct &triangle : distinct.triangles)
        most += packedBytes(triangle.level, Format::FourState);
    MicromapAssembly assembly(std::min(most, options.maxDataBytes));
    std::vector<int32_t> indexOf(distinct.triangles.size());

    // In batches: threads pack the triangles of a batch into a buffer, in any order; then the batch is appended to the
    // micromap in its own order. The buffer is a fraction of the largest possible result, but not too small to share
    // work.
    const uint64_t capacity = std::clamp<uint64_t>(most / 8, 1u << 18, 1u << 26);
    std::vector<uint8_t> buffer;
    std::vector<Packed> batch;
    for (size_t begin = 0; begin < indexOf.size(); begin += batch.size()) {
        size_t bytes = 0;
        batch.clear();
        std::vector<size_t> offsets;
        for (size_t i = begin; i < indexOf.size() && (bytes < capacity || batch.empty()); ++i) {
            offsets.push_back(bytes);
            bytes += distinct.triangles[i].classifiedBytes();
            batch.push_back({nullptr, {}, {}, 0});
        }
        if (buffer.size() < bytes)
            buffer.resize(bytes);
        inParallel<Material::Scratch>(threads, batch.size(), options.cancelled,
                                      [&](size_t i, Material::Scratch &scratch) {
                                          batch[i].data = buffer.data() + offsets[i];
                                          pack(distinct.triangles[begin + i], options, batch[i], scratch);
                                          progress.done(distinct.triangles[begin + i].uses);
                                      });
        for (size_t i = 0; i < batch.size(); ++i) {
            const Packed &packed = batch[i];
            const Distinct &triangle = distinct.triangles[begin + i];
            for (size_t s = 0; s < 4; ++s)
                result.statistics.states[s] += packed.counts[s] * triangle.uses;
            if (packed.uniform)
                result.statistics.special[static_cast<size_t>(*packed.uniform)] += triangle.uses;
            indexOf[begin + i] = packed.uniform ? specialIndex(*packed.uniform)
                                                : assembly.add(packed.data, triangle.level, triangle.format,
                                                               packed.hash, options.maxDataBytes);
        }
    }
    assembly.micromap.indices.reserve(total);
    for (const uint32_t which : distinct.of)
        assembly.micromap.indices.push_back(indexOf[which]);
    if (options.disallowMixedSpecialIndices)
        separateSpecialIndices(inputs, options, assembly);
    result.micromap = std::move(assembly.micromap);
    return result;
}

BakeResult bake(const AlphaTexture &texture, std::span<const TriangleUvs> triangles, const BakeOptions &options)
{
    const BakeInput input{std::span(&texture, 1), triangles};
    return bake(std::span(&input, 1), options);
}

} // namespace vellum
