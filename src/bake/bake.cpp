#include "bake/bake.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "bake/assembly.h"
#include "bake/budget.h"
#include "bake/classify.h"
#include "bake/packed.h"
#include "bake/work.h"
#include "core/curve.h"
#include "core/hash.h"
#include "core/progress.h"

namespace vellum
{
namespace
{

// Bytes of a micromap triangle's record, VkMicromapTriangleEXT.
constexpr std::uint32_t kRecordBytes = 8;

void check(const AlphaTexture &texture)
{
    if (texture.width == 0 || texture.height == 0)
        throw BakeError("the alpha texture is empty");
    constexpr std::uint32_t kMostTexels = 1u << 24;
    if (texture.width > kMostTexels || texture.height > kMostTexels)
        throw BakeError("the alpha texture has more than 2^24 texels along a side");
    if (texture.alpha.size() != std::size_t{texture.width} * texture.height)
        throw BakeError("the alpha texture has " + std::to_string(texture.alpha.size()) + " values for " +
                        std::to_string(texture.width) + " x " + std::to_string(texture.height) + " texels");
}

void checkLevel(std::uint32_t level)
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
    // What is far beyond any GPU's rounding would only make triangles reach over all of the plane.
    const struct {
        const char *name;
        double value;
        double most;
    } numbers[] = {
        {"valueTolerance", options.valueTolerance, std::numeric_limits<double>::max()},
        {"subtexelTolerance", options.subtexelTolerance, 1024},
        {"barycentricTolerance", options.barycentricTolerance, 1},
        {"interpolationTolerance", options.interpolationTolerance, 0x1p-10},
        {"texelsPerEdge", options.texelsPerEdge, std::numeric_limits<double>::max()},
        {"worthwhile", options.worthwhile, 1},
    };
    for (const auto &[name, value, most] : numbers)
        if (!(value >= 0 && value <= most))
            throw BakeError(std::string(name) + " is " + std::to_string(value) + ", not in its range");
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
    if (!input.levels.empty() && input.levels.size() != input.triangles.size())
        throw BakeError("there are " + std::to_string(input.levels.size()) + " levels for " +
                        std::to_string(input.triangles.size()) + " triangles");
    if (!input.formats.empty() && input.formats.size() != input.triangles.size())
        throw BakeError("there are " + std::to_string(input.formats.size()) + " formats for " +
                        std::to_string(input.triangles.size()) + " triangles");
    for (const std::uint8_t level : input.levels)
        checkLevel(level);
    for (const Format format : input.formats)
        checkFormat(format);
}

// One mip chain with a cutoff.
class Material
{
public:
    Material(const BakeInput &input, const BakeOptions &options)
        : m_source(input.textures), m_cutoff(input.cutoff.value_or(options.cutoff)), m_uvTerms(input.uvTerms),
          m_options(options), m_swapped(options.test == AlphaTest::Less || options.test == AlphaTest::Greater)
    {
        std::span<const AlphaTexture> textures = input.textures;
        m_options.valueTolerance = input.valueTolerance.value_or(options.valueTolerance);
        // alpha < cutoff is the contrary of alpha >= cutoff, and alpha <= cutoff is -alpha >= -cutoff.
        m_options.cutoff = m_cutoff;
        if (options.test == AlphaTest::LessOrEqual || options.test == AlphaTest::Greater) {
            m_options.cutoff = -m_cutoff;
            m_negated.assign(textures.begin(), textures.end());
            for (AlphaTexture &texture : m_negated) {
                texture.border = -texture.border;
                for (float &alpha : texture.alpha)
                    alpha = -alpha;
            }
            textures = m_negated;
        }
        for (const AlphaTexture &texture : textures)
            m_levels.push_back(std::make_unique<Classifier>(texture, m_options, m_uvTerms));
    }

    [[nodiscard]] bool isOf(const BakeInput &input, const BakeOptions &options) const
    {
        return input.textures.data() == m_source.data() && input.textures.size() == m_source.size() &&
               input.cutoff.value_or(options.cutoff) == m_cutoff &&
               input.valueTolerance.value_or(options.valueTolerance) == m_options.valueTolerance &&
               input.uvTerms == m_uvTerms;
    }
    [[nodiscard]] std::uint32_t levelFor(const TriangleUvs &uvs) const { return m_levels.front()->levelFor(uvs); }

    struct Scratch {
        ClassifierScratch classifier;
        std::vector<std::uint8_t> packed;
    };
    // As Classifier::classify, for all mip levels.
    void classify(const TriangleUvs &uvs, std::uint32_t level, std::uint8_t *packed, Scratch &scratch) const
    {
        m_levels.front()->classify(uvs, level, packed, scratch.classifier);
        for (std::size_t i = 1; i < m_levels.size(); ++i) {
            scratch.packed.assign(packedBytes(level, Format::FourState), 0);
            m_levels[i]->classify(uvs, level, scratch.packed.data(), scratch.classifier);
            keepCommon(packed, scratch.packed.data(), level);
        }
        if (m_swapped)
            swapOutcomes(packed, level);
    }

private:
    std::span<const AlphaTexture> m_source;
    double m_cutoff;
    double m_uvTerms;
    BakeOptions m_options;
    bool m_swapped;
    std::vector<AlphaTexture> m_negated;
    std::vector<std::unique_ptr<Classifier>> m_levels;
};

// A triangle that is different from all before it.
struct Distinct {
    const Material *material;
    const TriangleUvs *uvs;
    std::uint32_t level;
    std::uint32_t folds; // levels that a budget takes from what is classified, `level + folds`
    Format format;
    std::uint64_t uses;

    [[nodiscard]] std::uint32_t classifiedBytes() const { return packedBytes(level + folds, Format::FourState); }
};

// Everything that decides the data of a triangle.
struct Key {
    std::uint32_t material;
    std::uint32_t request;            // level, or none, and format
    std::array<std::uint32_t, 6> uvs; // as bits, so that NaNs are equal to themselves
    bool operator==(const Key &) const = default;
};

class DistinctTriangles
{
public:
    DistinctTriangles(std::span<const BakeInput> inputs, const BakeOptions &options)
    {
        std::size_t total = 0;
        for (const BakeInput &input : inputs)
            total += input.triangles.size();
        of.reserve(total);
        m_slots.assign(std::bit_ceil(total * 2 + 2), 0);
        for (const BakeInput &input : inputs)
            add(input, options);
        m_slots = {};
        m_keys = {};
    }

    std::vector<Distinct> triangles;
    std::vector<std::uint32_t> of; // for each triangle of all inputs

private:
    std::uint32_t materialOf(const BakeInput &input, const BakeOptions &options)
    {
        for (std::size_t i = 0; i < m_materials.size(); ++i)
            if (m_materials[i]->isOf(input, options))
                return static_cast<std::uint32_t>(i);
        m_materials.push_back(std::make_unique<Material>(input, options));
        return static_cast<std::uint32_t>(m_materials.size() - 1);
    }

    void add(const BakeInput &input, const BakeOptions &options)
    {
        const std::uint32_t which = materialOf(input, options);
        const Material &material = *m_materials[which];
        for (std::size_t i = 0; i < input.triangles.size(); ++i) {
            const TriangleUvs &uvs = input.triangles[i];
            const Format format = input.formats.empty() ? options.format : input.formats[i];
            constexpr std::uint32_t kNoLevel = 255;
            const std::uint32_t level = input.levels.empty() ? kNoLevel : input.levels[i];
            Key key{which, level << 8 | static_cast<std::uint32_t>(format), {}};
            for (std::size_t k = 0; k < 3; ++k) {
                key.uvs[2 * k] = std::bit_cast<std::uint32_t>(uvs[k].u);
                key.uvs[2 * k + 1] = std::bit_cast<std::uint32_t>(uvs[k].v);
            }
            const std::uint64_t hash = hashBytes(&key, sizeof key);
            std::size_t slot = hash & (m_slots.size() - 1);
            while (m_slots[slot] != 0 && m_keys[m_slots[slot] - 1] != key)
                slot = (slot + 1) & (m_slots.size() - 1);
            if (m_slots[slot] == 0) {
                m_keys.push_back(key);
                triangles.push_back(
                    {&material, &uvs, level == kNoLevel ? material.levelFor(uvs) : level, 0, format, 0});
                m_slots[slot] = static_cast<std::uint32_t>(triangles.size());
            }
            ++triangles[m_slots[slot] - 1].uses;
            of.push_back(m_slots[slot] - 1);
        }
    }

    std::vector<std::unique_ptr<Material>> m_materials;
    std::vector<Key> m_keys;            // of each distinct triangle
    std::vector<std::uint32_t> m_slots; // by hash: one more than a distinct triangle, or 0
};

// The states of a distinct triangle, packed.
struct Packed {
    std::uint8_t *data;
    std::optional<State> uniform;
    StateCounts counts{};
    std::uint64_t hash = 0;
};

void pack(const Distinct &triangle, const BakeOptions &options, Packed &packed, Material::Scratch &scratch)
{
    std::fill_n(packed.data, triangle.classifiedBytes(), std::uint8_t{0});
    triangle.material->classify(*triangle.uvs, triangle.level + triangle.folds, packed.data, scratch);
    for (std::uint32_t fold = triangle.folds; fold > 0; --fold)
        foldOnce(packed.data, triangle.level + fold);
    packed.counts = countStates(packed.data, triangle.level);
    auto &[transparent, opaque, unknownTransparent, unknownOpaque] = packed.counts;
    const std::uint64_t unknown = unknownTransparent + unknownOpaque;
    if (triangle.format == Format::TwoState) {
        toTwoState(packed.data, triangle.level, options.twoStateRule);
        const bool toOpaque = options.twoStateRule == TwoStateRule::UnknownIsOpaque;
        const bool nearest = options.twoStateRule == TwoStateRule::Nearest;
        const std::uint64_t more = toOpaque ? unknown : nearest ? unknownOpaque : 0;
        opaque += more;
        transparent += unknown - more;
        unknownTransparent = unknownOpaque = 0;
    } else if (unknown != 0 &&
               static_cast<double>(transparent + opaque) < options.worthwhile * microTriangleCount(triangle.level)) {
        const bool mostlyOpaque = 2 * (opaque + unknownOpaque) >= microTriangleCount(triangle.level);
        packed.counts = {};
        packed.counts[static_cast<std::size_t>(mostlyOpaque ? State::UnknownOpaque : State::UnknownTransparent)] =
            microTriangleCount(triangle.level);
    }
    packed.uniform = uniformState(packed.counts);
    if (!packed.uniform)
        packed.hash = hashBytes(packed.data, packedBytes(triangle.level, triangle.format), triangle.level);
}

// Levels that keep the result within the budget, by what each triangle would be at each of them.
void applyBudget(DistinctTriangles &distinct, const BakeOptions &options, unsigned threads, Progress &progress)
{
    std::vector<LevelChoice> choices(distinct.triangles.size());
    struct Scratch {
        Material::Scratch classifier;
        std::vector<std::uint8_t> packed;
    };
    inParallel<Scratch>(threads, choices.size(), options.cancelled, [&](std::size_t i, Scratch &scratch) {
        const Distinct &triangle = distinct.triangles[i];
        LevelChoice &choice = choices[i];
        choice.uses = triangle.uses;
        choice.level = triangle.level;
        scratch.packed.assign(packedBytes(triangle.level, Format::FourState), 0);
        triangle.material->classify(*triangle.uvs, triangle.level, scratch.packed.data(), scratch.classifier);
        for (std::uint32_t level = triangle.level + 1; level-- > 0;) {
            if (level < triangle.level)
                foldOnce(scratch.packed.data(), level + 1);
            const StateCounts counts = countStates(scratch.packed.data(), level);
            const auto known = static_cast<float>(counts[0] + counts[1]);
            choice.known[level] = known / static_cast<float>(microTriangleCount(level));
            choice.bytes[level] = uniformState(counts) ? 0 : packedBytes(level, triangle.format) + kRecordBytes;
        }
        progress.done(triangle.uses);
    });
    // What separateSpecialIndices() may add.
    const std::uint64_t more = options.disallowMixedSpecialIndices ? 4 * (kRecordBytes + 1) : 0;
    fitBudget(choices, *options.budget - std::min(*options.budget, more));
    for (std::size_t i = 0; i < choices.size(); ++i) {
        Distinct &triangle = distinct.triangles[i];
        triangle.folds = triangle.level - choices[i].level;
        triangle.level = choices[i].level;
    }
}

// Where an input has both, its special indices become micromap triangles of level 0.
void separateSpecialIndices(std::span<const BakeInput> inputs, const BakeOptions &options, MicromapAssembly &assembly)
{
    std::size_t first = 0;
    for (const BakeInput &input : inputs) {
        const auto begin = assembly.micromap.indices.begin() + static_cast<std::ptrdiff_t>(first);
        const auto end = begin + static_cast<std::ptrdiff_t>(input.triangles.size());
        first += input.triangles.size();
        if (std::none_of(begin, end, [](std::int32_t index) { return index >= 0; }))
            continue;
        for (auto index = begin; index != end; ++index) {
            const std::optional<State> state = specialState(*index);
            if (!state)
                continue;
            const bool known = *state == State::Opaque || *state == State::Transparent;
            const Format format = known && options.format == Format::TwoState ? Format::TwoState : Format::FourState;
            const auto data = static_cast<std::uint8_t>(*state);
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
    const unsigned threads = options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency());

    DistinctTriangles distinct(inputs, options);
    const std::size_t total = distinct.of.size();
    Progress progress(options.progress, options.budget ? 2 * total : total);
    if (options.budget)
        applyBudget(distinct, options, threads, progress);

    BakeResult result;
    result.statistics.distinct = distinct.triangles.size();
    std::uint64_t most = 0;
    for (const Distinct &triangle : distinct.triangles)
        most += packedBytes(triangle.level, Format::FourState);
    MicromapAssembly assembly(std::min(most, options.maxDataBytes));
    std::vector<std::int32_t> indexOf(distinct.triangles.size());

    // In batches: threads pack the triangles of one into a buffer, in any order; then they become part of the micromap
    // in their own. The buffer is a part of what the result may become, but not too small to share work.
    const std::uint64_t room = std::clamp<std::uint64_t>(most / 8, 1u << 18, 1u << 26);
    std::vector<std::uint8_t> buffer;
    std::vector<Packed> batch;
    for (std::size_t begin = 0; begin < indexOf.size(); begin += batch.size()) {
        std::size_t bytes = 0;
        batch.clear();
        std::vector<std::size_t> offsets;
        for (std::size_t i = begin; i < indexOf.size() && (bytes < room || batch.empty()); ++i) {
            offsets.push_back(bytes);
            bytes += distinct.triangles[i].classifiedBytes();
            batch.push_back({nullptr, {}, {}, 0});
        }
        if (buffer.size() < bytes)
            buffer.resize(bytes);
        inParallel<Material::Scratch>(threads, batch.size(), options.cancelled,
                                      [&](std::size_t i, Material::Scratch &scratch) {
                                          batch[i].data = buffer.data() + offsets[i];
                                          pack(distinct.triangles[begin + i], options, batch[i], scratch);
                                          progress.done(distinct.triangles[begin + i].uses);
                                      });
        for (std::size_t i = 0; i < batch.size(); ++i) {
            const Packed &packed = batch[i];
            const Distinct &triangle = distinct.triangles[begin + i];
            for (std::size_t s = 0; s < 4; ++s)
                result.statistics.states[s] += packed.counts[s] * triangle.uses;
            if (packed.uniform)
                result.statistics.special[static_cast<std::size_t>(*packed.uniform)] += triangle.uses;
            indexOf[begin + i] = packed.uniform ? specialIndex(*packed.uniform)
                                                : assembly.add(packed.data, triangle.level, triangle.format,
                                                               packed.hash, options.maxDataBytes);
        }
    }
    assembly.micromap.indices.reserve(total);
    for (const std::uint32_t which : distinct.of)
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
