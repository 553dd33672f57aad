#include "opacity_map_rival.h"

#include <dlfcn.h>

#include <numeric>
#include <stdexcept>

namespace vellum::bench
{
namespace
{

template <typename Function>
Function load(void *library, const char *name)
{
    void *symbol = dlsym(library, name);
    if (symbol == nullptr)
        throw std::runtime_error(std::string("the library lacks ") + name);
    return reinterpret_cast<Function>(symbol);
}

// Triangles that are one state all over have lost their level.
constexpr std::uint32_t kLevelOfUniform = 5;

std::uint32_t levelOf(const Micromap &micromap, std::size_t triangle)
{
    const std::int32_t index = micromap.indices[triangle];
    if (index >= 0)
        return micromap.triangles[static_cast<std::size_t>(index)].subdivisionLevel;
    return micromap.triangles.empty() ? kLevelOfUniform : micromap.triangles.front().subdivisionLevel;
}

} // namespace

OpacityMapRival::OpacityMapRival(const std::string &path)
{
    void *library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr)
        throw std::runtime_error(dlerror());
    m_measure = load<Measure>(library, "meshopt_opacityMapMeasure");
    m_rasterize = load<Rasterize>(library, "meshopt_opacityMapRasterize");
    m_compact = load<Compact>(library, "meshopt_opacityMapCompact");
}

RivalResult OpacityMapRival::bake(const std::vector<std::uint8_t> &alpha, std::uint32_t size,
                                  const std::vector<TriangleUvs> &triangles, const Micromap &own) const
{
    std::vector<unsigned> indices(triangles.size() * 3);
    std::iota(indices.begin(), indices.end(), 0u);
    std::vector<unsigned char> levels(triangles.size());
    std::vector<unsigned> sources(triangles.size());
    std::vector<int> ommIndices(triangles.size());
    const float *uvs = &triangles[0][0].u;
    const std::size_t count = m_measure(levels.data(), sources.data(), ommIndices.data(), indices.data(),
                                        indices.size(), uvs, indices.size(), sizeof(TexCoord), size, size, 12, 0);
    std::vector<unsigned> offsets(count);
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < count; ++i) {
        levels[i] = static_cast<unsigned char>(levelOf(own, sources[i]));
        offsets[i] = static_cast<unsigned>(bytes);
        bytes += packedBytes(levels[i], Format::FourState);
    }
    std::vector<unsigned char> data(bytes);
    for (std::size_t i = 0; i < count; ++i) {
        const float *t = uvs + std::size_t{sources[i]} * 6;
        m_rasterize(data.data() + offsets[i], levels[i], 4, t, t + 2, t + 4, alpha.data(), 1, size, size, size);
    }
    m_compact(data.data(), data.size(), levels.data(), offsets.data(), count, ommIndices.data(), triangles.size(), 4);

    return {std::move(data), std::move(levels), std::move(offsets), std::move(ommIndices)};
}

RivalScore score(const RivalResult &theirs, const Micromap &exact)
{
    std::uint64_t all = 0;
    std::uint64_t known = 0;
    std::uint64_t wrong = 0;
    for (std::size_t t = 0; t < theirs.indices.size(); ++t) {
        const std::uint32_t level = levelOf(exact, t);
        const std::int32_t index = exact.indices[t];
        for (std::uint32_t i = 0; i < microTriangleCount(level); ++i) {
            const auto at = [i](std::int32_t which, const std::uint8_t *data, const auto &offset) {
                return which < 0 ? *specialState(which)
                                 : readState(data + offset(static_cast<std::size_t>(which)), i, Format::FourState);
            };
            const State claim =
                at(theirs.indices[t], theirs.data.data(), [&](std::size_t k) { return theirs.offsets[k]; });
            const State truth =
                at(index, exact.data.data(), [&](std::size_t k) { return exact.triangles[k].dataOffset; });
            ++all;
            if (claim != State::Opaque && claim != State::Transparent)
                continue;
            ++known;
            wrong += claim != truth ? 1u : 0u;
        }
    }
    return {1 - static_cast<double>(known) / static_cast<double>(all),
            1e6 * static_cast<double>(wrong) / static_cast<double>(known)};
}

} // namespace vellum::bench
