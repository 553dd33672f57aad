// SPDX-License-Identifier: Apache-2.0
#include "bake/bake.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "bake/distinct.h"
#include "bake/levels.h"
#include "bake/packed.h"
#include "core/hash.h"
#include "core/large_memory.h"
#include "core/parallel.h"

namespace vellum
{
namespace
{

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
    // Addresses of 32 bits are memory.
    constexpr uint64_t kMost = sizeof(size_t) > 4 ? UINT64_MAX : uint64_t{1} << 24;
    reserveLarge(micromap.data, static_cast<size_t>(std::min(bytes, kMost)));
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
    checkBake(inputs, options);
    const unsigned threads = threadCount(options.threads);

    DistinctTriangles distinct(inputs, options);
    const size_t total = distinct.of.size();
    Progress progress(options.progress, options.budget || options.leastKnown ? 2 * total : total);
    if (options.budget)
        applyLevels(distinct, LevelChooser(distinct, options, threads, progress).withinBudget(*options.budget));
    else if (options.leastKnown)
        applyLevels(distinct, levelsForKnown(distinct, options, threads, progress));

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
        inParallel<BakeMaterial::Scratch>(threads, batch.size(), options.cancelled,
                                          [&](size_t i, BakeMaterial::Scratch &scratch) {
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
