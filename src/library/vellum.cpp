// The functions of vellum/vellum.h.
#include "vellum/vellum.h"

#include <atomic>
#include <memory>
#include <new>
#include <utility>

#include "bake/bake.h"
#include "library/inputs.h"
#include "library/structures.h"

static_assert(VELLUM_HEADER_VERSION ==
                  VELLUM_MAKE_VERSION(VELLUM_LIBRARY_MAJOR, VELLUM_LIBRARY_MINOR, VELLUM_LIBRARY_PATCH),
              "vellum/vellum.h has another version than the project");
static_assert(sizeof(VellumMicromapTriangle) == sizeof(vellum::MicromapTriangle));

using namespace vellum;
using namespace vellum::library;

struct VellumMicromap {
    // A geometry's part of the result.
    struct Geometry {
        std::size_t first;
        std::size_t count;
        std::vector<VellumMicromapUsage> usages;
    };

    BakeResult result;
    std::vector<VellumMicromapUsage> usages;
    std::vector<Geometry> geometries;
};

namespace
{

// How many micromap triangles there are of each format and level, or uses of them.
class UsageCounts
{
public:
    void add(const MicromapTriangle &triangle)
    {
        ++m_counts[triangle.format == Format::TwoState ? 0 : 1][triangle.subdivisionLevel];
    }
    [[nodiscard]] std::vector<VellumMicromapUsage> get() const
    {
        std::vector<VellumMicromapUsage> usages;
        for (std::size_t i = 0; i < m_counts.size(); ++i)
            for (std::uint32_t level = 0; level < m_counts[i].size(); ++level)
                if (m_counts[i][level] != 0)
                    usages.push_back({m_counts[i][level], level,
                                      i == 0 ? std::uint32_t{VELLUM_MICROMAP_FORMAT_2_STATE}
                                             : std::uint32_t{VELLUM_MICROMAP_FORMAT_4_STATE}});
        return usages;
    }

private:
    std::array<std::array<std::uint32_t, 13>, 2> m_counts{};
};

void countUsages(std::span<const BakeInput> inputs, VellumMicromap &made)
{
    const Micromap &micromap = made.result.micromap;
    UsageCounts all;
    for (const MicromapTriangle &triangle : micromap.triangles)
        all.add(triangle);
    made.usages = all.get();
    std::size_t first = 0;
    for (const BakeInput &input : inputs) {
        UsageCounts used;
        for (std::size_t i = first; i < first + input.triangles.size(); ++i)
            if (micromap.indices[i] >= 0)
                used.add(micromap.triangles[static_cast<std::size_t>(micromap.indices[i])]);
        made.geometries.push_back({first, input.triangles.size(), used.get()});
        first += input.triangles.size();
    }
}

std::unique_ptr<VellumMicromap> bakeAll(const Inputs &inputs, const VellumBakeOptions &given)
{
    BakeOptions options = readOptions(given);
    std::atomic<bool> stopped{false};
    if (given.progress != nullptr)
        options.progress = [&](std::size_t done, std::size_t total) {
            if (given.progress(given.userData, done, total) != 0)
                stopped = true;
        };
    if (given.progress != nullptr || given.cancelled != nullptr)
        options.cancelled = [&] {
            return stopped || (given.cancelled != nullptr && given.cancelled(given.userData) != 0);
        };
    auto made = std::make_unique<VellumMicromap>();
    made->result = bake(inputs.get(), options);
    if (stopped)
        throw BakeCancelled();
    countUsages(inputs.get(), *made);
    return made;
}

// What a function of the library does, with its exceptions turned into a result.
template <typename Function>
VellumResult guarded(VellumMessageCallback message, void *userData, Function &&function) noexcept
{
    const auto fail = [&](VellumResult result, const char *why) {
        if (message != nullptr)
            message(userData, result, why);
        return result;
    };
    try {
        function();
        return VELLUM_SUCCESS;
    } catch (const BakeCancelled &) {
        return VELLUM_CANCELLED;
    } catch (const Failure &failure) {
        return fail(failure.result(), failure.what());
    } catch (const BakeTooLarge &error) {
        return fail(VELLUM_ERROR_TOO_LARGE, error.what());
    } catch (const BakeError &error) {
        return fail(VELLUM_ERROR_INVALID_ARGUMENT, error.what());
    } catch (const std::bad_alloc &) {
        return fail(VELLUM_ERROR_OUT_OF_MEMORY, "out of memory");
    } catch (const std::length_error &) {
        return fail(VELLUM_ERROR_OUT_OF_MEMORY, "more memory is needed than there can be");
    } catch (const std::exception &error) {
        return fail(VELLUM_ERROR_INTERNAL, error.what());
    } catch (...) {
        return fail(VELLUM_ERROR_INTERNAL, "unknown exception");
    }
}

template <typename Function>
VellumResult guarded(Function &&function) noexcept
{
    return guarded(nullptr, nullptr, std::forward<Function>(function));
}

} // namespace

uint32_t vellumGetVersion()
{
    return VELLUM_HEADER_VERSION;
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
    default: return "unknown VellumResult";
    }
}

VellumResult vellumBake(const VellumBakeInput *inputs, size_t inputCount, const VellumBakeOptions *options,
                        VellumMicromap **micromap)
{
    if (micromap != nullptr)
        *micromap = nullptr;
    VellumBakeOptions known{};
    // Who to tell of mistakes is among what may be mistaken.
    const VellumResult readable =
        guarded([&] { known = options != nullptr ? knownPart(options) : Structure<VellumBakeOptions>::defaults(); });
    if (readable != VELLUM_SUCCESS)
        return readable;
    return guarded(known.message, known.userData, [&] {
        if (options != nullptr)
            checkUnknownPart(options);
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
        // The same structure, by VellumMicromapTriangle's comment and MicromapTriangle's.
        values.triangles = reinterpret_cast<const VellumMicromapTriangle *>(made.triangles.data());
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

VellumResult vellumGetState(const VellumMicromap *micromap, size_t triangle, float u, float v, uint32_t *state)
{
    if (micromap == nullptr || state == nullptr || triangle >= micromap->result.micromap.indices.size())
        return VELLUM_ERROR_INVALID_ARGUMENT;
    *state = static_cast<uint32_t>(micromap->result.micromap.stateAt(static_cast<std::uint32_t>(triangle), u, v));
    return VELLUM_SUCCESS;
}
