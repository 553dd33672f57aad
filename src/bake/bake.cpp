#include "bake/bake.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>

#include "bake/classify.h"
#include "core/curve.h"

namespace vellum
{
namespace
{

void check(const AlphaTexture &texture, const BakeOptions &options)
{
    if (texture.width == 0 || texture.height == 0)
        throw BakeError("the alpha texture is empty");
    if (texture.alpha.size() != std::size_t{texture.width} * texture.height)
        throw BakeError("the alpha texture has " + std::to_string(texture.alpha.size()) + " values for " +
                        std::to_string(texture.width) + " x " + std::to_string(texture.height) + " texels");
    const std::uint32_t highest = options.level.value_or(options.maxLevel);
    if (highest > shared::kMaxSubdivisionLevel)
        throw BakeError("subdivision level " + std::to_string(highest) + " is above 12");
    if (options.format != Format::TwoState && options.format != Format::FourState)
        throw BakeError("the micromap format is neither 2-state nor 4-state");
    const double numbers[] = {options.valueTolerance, options.subtexelTolerance, options.barycentricTolerance,
                              options.interpolationTolerance, options.texelsPerEdge};
    for (const double number : numbers)
        if (!(number >= 0) || std::isinf(number))
            throw BakeError("a tolerance of the baker is negative or not finite");
    if (std::isnan(options.cutoff))
        throw BakeError("the alpha cutoff is not a number");
    if (options.maxDataBytes > 0xffffffffu)
        throw BakeError("micromap data cannot be larger than 4 GiB");
}

// Texture coordinates as bits, so that NaNs and zeros of either sign have an order.
using UvKey = std::array<std::uint32_t, 6>;

UvKey keyOf(const TriangleUvs &uvs)
{
    UvKey key{};
    for (std::size_t i = 0; i < 3; ++i) {
        key[2 * i] = std::bit_cast<std::uint32_t>(uvs[i].u);
        key[2 * i + 1] = std::bit_cast<std::uint32_t>(uvs[i].v);
    }
    return key;
}

struct Distinct {
    std::vector<std::size_t> first; // a triangle with these texture coordinates
    std::vector<std::uint64_t> count;
    std::vector<std::size_t> of; // for each triangle
};

Distinct findDistinct(std::span<const TriangleUvs> triangles)
{
    Distinct distinct;
    std::map<UvKey, std::size_t> known;
    for (std::size_t i = 0; i < triangles.size(); ++i) {
        const auto [entry, added] = known.emplace(keyOf(triangles[i]), distinct.first.size());
        if (added) {
            distinct.first.push_back(i);
            distinct.count.push_back(0);
        }
        ++distinct.count[entry->second];
        distinct.of.push_back(entry->second);
    }
    return distinct;
}

// One distinct triangle, in the format of the result.
struct Packed {
    std::uint32_t level = 0;
    std::optional<State> uniform;   // one state all over, and no data
    std::vector<std::uint8_t> data; // packed states
    std::array<std::uint64_t, 4> states{};
};

Packed pack(const Classifier &classifier, const TriangleUvs &uvs, Format format, ClassifierScratch &scratch)
{
    struct {
        std::uint32_t level;
        std::vector<std::uint8_t> packed;
    } triangle;
    triangle.level = classifier.levelFor(uvs);
    triangle.packed.resize(packedBytes(triangle.level, Format::FourState));
    classifier.classify(uvs, triangle.level, triangle.packed.data(), scratch);
    Packed packed;
    packed.level = triangle.level;
    const std::uint32_t count = microTriangleCount(triangle.level);
    if (format == Format::FourState) {
        packed.data = std::move(triangle.packed);
        for (std::uint32_t i = 0; i < count; ++i)
            ++packed.states[static_cast<std::size_t>(readState(packed.data.data(), i, format))];
    } else {
        packed.data.assign(packedBytes(triangle.level, format), 0);
        for (std::uint32_t i = 0; i < count; ++i) {
            writeState(packed.data.data(), i, format, readState(triangle.packed.data(), i, Format::FourState));
            ++packed.states[static_cast<std::size_t>(readState(packed.data.data(), i, format))];
        }
    }
    for (std::size_t s = 0; s < packed.states.size(); ++s)
        if (packed.states[s] == count)
            packed.uniform = static_cast<State>(s);
    if (packed.uniform) {
        packed.data.clear();
        packed.data.shrink_to_fit();
    }
    return packed;
}

std::string tooLarge(const BakeOptions &options)
{
    return "the micromap would be larger than " + std::to_string(options.maxDataBytes) +
           " bytes; choose a lower subdivision level";
}

// Classifies the distinct triangles on all threads. Each has a place of its own in the result, which makes the result
// independent of who did what.
std::vector<Packed> classifyAll(const AlphaTexture &texture, std::span<const TriangleUvs> triangles,
                                const Distinct &distinct, const BakeOptions &options)
{
    const Classifier classifier(texture, options);
    const std::size_t total = distinct.first.size();
    std::vector<Packed> results(total);
    std::atomic<std::size_t> next{0};
    std::atomic<std::uint64_t> bytes{0};
    std::mutex reporting;
    std::size_t done = 0;
    std::exception_ptr failure;

    const auto work = [&] {
        ClassifierScratch scratch;
        for (std::size_t i = next++; i < total; i = next++) {
            try {
                results[i] = pack(classifier, triangles[distinct.first[i]], options.format, scratch);
                // Before deduplication, so a little early; but what was counted is held in memory.
                if ((bytes += results[i].data.size()) > options.maxDataBytes)
                    throw BakeError(tooLarge(options));
                const std::lock_guard lock(reporting);
                ++done;
                if (options.progress)
                    options.progress(done, total);
            } catch (...) {
                const std::lock_guard lock(reporting);
                failure = std::current_exception();
                next = total;
            }
        }
    };
    const unsigned wanted = options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency());
    std::vector<std::jthread> threads;
    for (std::size_t i = 1; i < std::min<std::size_t>(wanted, total); ++i)
        threads.emplace_back(work);
    work();
    threads.clear(); // joins
    if (failure)
        std::rethrow_exception(failure);
    return results;
}

} // namespace

BakeResult bake(const AlphaTexture &texture, std::span<const TriangleUvs> triangles, const BakeOptions &options)
{
    check(texture, options);
    const Distinct distinct = findDistinct(triangles);
    std::vector<Packed> packed = classifyAll(texture, triangles, distinct, options);

    BakeResult result;
    result.statistics.distinct = distinct.first.size();
    Micromap &micromap = result.micromap;
    std::vector<std::int32_t> indexOf(packed.size());
    // Different texture coordinates can give the same data: cards that use the same part of a repeated texture.
    std::map<std::pair<std::uint32_t, std::vector<std::uint8_t>>, std::int32_t> known;
    for (std::size_t i = 0; i < packed.size(); ++i) {
        Packed &p = packed[i];
        for (std::size_t s = 0; s < 4; ++s)
            result.statistics.states[s] += p.states[s] * distinct.count[i];
        if (p.uniform) {
            indexOf[i] = specialIndex(*p.uniform);
            result.statistics.special[static_cast<std::size_t>(*p.uniform)] += distinct.count[i];
            continue;
        }
        const auto next = static_cast<std::int32_t>(micromap.triangles.size());
        const auto [entry, added] = known.emplace(std::pair{p.level, std::move(p.data)}, next);
        indexOf[i] = entry->second;
        if (!added)
            continue;
        const auto offset = static_cast<std::uint32_t>(micromap.data.size());
        micromap.triangles.push_back({offset, static_cast<std::uint16_t>(p.level), options.format});
        micromap.data.insert(micromap.data.end(), entry->first.second.begin(), entry->first.second.end());
    }
    micromap.indices.reserve(triangles.size());
    for (const std::size_t which : distinct.of)
        micromap.indices.push_back(indexOf[which]);
    return result;
}

} // namespace vellum
