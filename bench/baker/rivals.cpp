#include "rivals.h"

#include <dlfcn.h>

#include <cstring>
#include <numeric>
#include <stdexcept>

namespace vellum::bench
{
namespace
{

class Library
{
public:
    explicit Library(const std::string &path) : m_handle(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL))
    {
        if (m_handle == nullptr)
            throw std::runtime_error(dlerror());
    }
    template <typename Function>
    void load(Function &function, const char *name) const
    {
        void *symbol = dlsym(m_handle, name);
        if (symbol == nullptr)
            throw std::runtime_error(std::string("the library lacks ") + name);
        function = reinterpret_cast<Function>(symbol);
    }

private:
    void *m_handle;
};

class Meshoptimizer : public Rival
{
public:
    explicit Meshoptimizer(const std::string &path)
    {
        name = "meshoptimizer";
        const Library library(path);
        library.load(m_measure, "meshopt_opacityMapMeasure");
        library.load(m_rasterize, "meshopt_opacityMapRasterize");
        library.load(m_compact, "meshopt_opacityMapCompact");
    }

    [[nodiscard]] RivalResult bake(const BakeMesh &mesh, const std::vector<std::uint8_t> &wanted) const override
    {
        const std::vector<TriangleUvs> &triangles = mesh.triangles;
        std::vector<unsigned> indices(triangles.size() * 3);
        std::iota(indices.begin(), indices.end(), 0u);
        RivalResult result;
        result.levels.resize(triangles.size());
        result.indices.resize(triangles.size());
        std::vector<unsigned> sources(triangles.size());
        const float *uvs = &triangles[0][0].u;
        const std::size_t count =
            m_measure(result.levels.data(), sources.data(), result.indices.data(), indices.data(), indices.size(), uvs,
                      indices.size(), sizeof(TexCoord), mesh.width, mesh.height, 12, 0);
        result.offsets.resize(count);
        std::size_t bytes = 0;
        for (std::size_t i = 0; i < count; ++i) {
            result.levels[i] = wanted[sources[i]];
            result.offsets[i] = static_cast<unsigned>(bytes);
            bytes += packedBytes(result.levels[i], Format::FourState);
        }
        result.data.resize(bytes);
        for (std::size_t i = 0; i < count; ++i) {
            const float *t = uvs + std::size_t{sources[i]} * 6;
            m_rasterize(result.data.data() + result.offsets[i], result.levels[i], 4, t, t + 2, t + 4, mesh.alpha.data(),
                        1, mesh.width, mesh.width, mesh.height);
        }
        m_compact(result.data.data(), result.data.size(), result.levels.data(), result.offsets.data(), count,
                  result.indices.data(), triangles.size(), 4);
        return result;
    }

private:
    std::size_t (*m_measure)(unsigned char *, unsigned *, int *, const unsigned *, std::size_t, const float *,
                             std::size_t, std::size_t, unsigned, unsigned, int, float);
    void (*m_rasterize)(unsigned char *, int, int, const float *, const float *, const float *, const unsigned char *,
                        std::size_t, std::size_t, unsigned, unsigned);
    std::size_t (*m_compact)(unsigned char *, std::size_t, unsigned char *, unsigned *, std::size_t, int *, std::size_t,
                             int);
};

class OmmSdk : public Rival
{
public:
    explicit OmmSdk(const std::string &path)
    {
        name = "OMM SDK";
        const Library library(path);
        library.load(m_createBaker, "ommCreateBaker");
        library.load(m_createTexture, "ommCpuCreateTexture");
        library.load(m_destroyTexture, "ommCpuDestroyTexture");
        library.load(m_bake, "ommCpuBake");
        library.load(m_result, "ommCpuGetBakeResultDesc");
        library.load(m_destroyResult, "ommCpuDestroyBakeResult");
        const Creation creation;
        check(m_createBaker(&creation, &m_baker), "ommCreateBaker");
    }

    [[nodiscard]] RivalResult bake(const BakeMesh &mesh, const std::vector<std::uint8_t> &wanted) const override
    {
        const Mip mip{mesh.width, mesh.height, mesh.width, mesh.alpha.data()};
        const TextureInput textureInput{0, 0, &mip, 1, static_cast<float>(mesh.cutoff)};
        void *texture = nullptr;
        check(m_createTexture(m_baker, &textureInput, &texture), "ommCpuCreateTexture");
        std::vector<std::uint32_t> indices(mesh.triangles.size() * 3);
        std::iota(indices.begin(), indices.end(), 0u);
        constexpr int kModes[] = {0, 1, 2, 3, 4}; // by Wrap
        Input input;
        input.texture = texture;
        input.addressMode = kModes[static_cast<std::size_t>(mesh.wrapU)];
        input.texCoords = mesh.triangles.data();
        input.indices = indices.data();
        input.indexCount = static_cast<std::uint32_t>(indices.size());
        input.alphaCutoff = static_cast<float>(mesh.cutoff);
        input.levels = wanted.data();
        void *baked = nullptr;
        check(m_bake(m_baker, &input, &baked), "ommCpuBake");
        const Output *output = nullptr;
        check(m_result(baked, &output), "ommCpuGetBakeResultDesc");
        RivalResult result;
        const auto *data = static_cast<const std::uint8_t *>(output->data);
        result.data.assign(data, data + output->dataSize);
        for (std::uint32_t i = 0; i < output->triangleCount; ++i) {
            result.levels.push_back(static_cast<std::uint8_t>(output->triangles[i].subdivisionLevel));
            result.offsets.push_back(output->triangles[i].dataOffset);
        }
        const auto *ommIndices = static_cast<const std::int32_t *>(output->indices);
        result.indices.assign(ommIndices, ommIndices + output->indexCount);
        m_destroyResult(baked);
        m_destroyTexture(m_baker, texture);
        return result;
    }

private:
    // The structures of its header, as far as they matter here, with the values that a bake like ours needs.
    struct Creation {
        int type = 1; // for the CPU
        const void *memoryAndMessages[6] = {};
    };
    struct Mip {
        std::uint32_t width, height, rowPitch;
        const void *texels;
    };
    struct TextureInput {
        int format; // 0: 8-bit unorm
        int flags;
        const Mip *mips;
        std::uint32_t mipCount;
        float alphaCutoff;
    };
    struct Input {
        int flags = 1 << 2; // 32-bit indices
        void *texture = nullptr;
        int addressMode = 0;
        int filter = 1; // linear
        float borderAlpha = 0;
        int alphaMode = 0;      // test
        int texCoordFormat = 2; // two floats
        const void *texCoords = nullptr;
        std::uint32_t texCoordStride = 0;
        int indexFormat = 1; // 32 bits
        const void *indices = nullptr;
        std::uint32_t indexCount = 0;
        float texelsPerEdge = 0; // levels are given
        float rejectionThreshold = 0;
        float alphaCutoff = 0.5f;
        float nearDuplicates = 0.15f;
        int below = 0;  // is transparent
        int above = 1;  // is opaque
        int format = 2; // 4-state
        const void *formats = nullptr;
        int unknown = 0; // nearest
        int unresolved = -4;
        std::uint8_t maxLevel = 12;
        std::uint32_t maxDataSize = 0xffffffff;
        const std::uint8_t *levels = nullptr;
        std::uint64_t maxWorkload = ~std::uint64_t{0};
    };
    struct Output {
        const void *data;
        std::uint32_t dataSize;
        const MicromapTriangle *triangles;
        std::uint32_t triangleCount;
        const void *usages;
        std::uint32_t usageCount;
        const void *indices;
        std::uint32_t indexCount;
    };

    static void check(int result, const char *function)
    {
        if (result != 0)
            throw std::runtime_error(std::string(function) + " returned " + std::to_string(result));
    }

    int (*m_createBaker)(const Creation *, void **);
    int (*m_createTexture)(void *, const TextureInput *, void **);
    int (*m_destroyTexture)(void *, void *);
    int (*m_bake)(void *, const Input *, void **);
    int (*m_result)(void *, const Output **);
    int (*m_destroyResult)(void *);
    void *m_baker = nullptr;
};

} // namespace

std::unique_ptr<Rival> loadMeshoptimizer(const std::string &library)
{
    return std::make_unique<Meshoptimizer>(library);
}

std::unique_ptr<Rival> loadOmmSdk(const std::string &library)
{
    return std::make_unique<OmmSdk>(library);
}

void addScore(RivalScore &score, const RivalResult &theirs, const Micromap &exact,
              const std::vector<std::uint8_t> &levels)
{
    constexpr double kMostMicro = 1 << 26;
    for (std::size_t t = 0; t < theirs.indices.size() && score.micro < kMostMicro; ++t) {
        const std::int32_t index = exact.indices[t];
        for (std::uint32_t i = 0; i < microTriangleCount(levels[t]); ++i) {
            const auto at = [i](std::int32_t which, const std::uint8_t *data, const auto &offset) {
                return which < 0 ? *specialState(which)
                                 : readState(data + offset(static_cast<std::size_t>(which)), i, Format::FourState);
            };
            const State claim =
                at(theirs.indices[t], theirs.data.data(), [&](std::size_t k) { return theirs.offsets[k]; });
            const State truth =
                at(index, exact.data.data(), [&](std::size_t k) { return exact.triangles[k].dataOffset; });
            ++score.micro;
            if (claim != State::Opaque && claim != State::Transparent)
                continue;
            ++score.known;
            score.wrong += claim != truth ? 1 : 0;
        }
    }
}

} // namespace vellum::bench
