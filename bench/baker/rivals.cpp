// SPDX-License-Identifier: Apache-2.0
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
    explicit Library(const std::string &path) : handle_(dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL))
    {
        if (handle_ == nullptr)
            throw std::runtime_error(dlerror());
    }
    template <typename Function>
    void load(Function &function, const char *name) const
    {
        void *symbol = dlsym(handle_, name);
        if (symbol == nullptr)
            throw std::runtime_error(std::string("the library lacks ") + name);
        function = reinterpret_cast<Function>(symbol);
    }

private:
    void *handle_;
};

class Meshoptimizer : public Rival
{
public:
    explicit Meshoptimizer(const std::string &path)
    {
        name = "meshoptimizer";
        const Library library(path);
        library.load(measure_, "meshopt_opacityMapMeasure");
        library.load(rasterize_, "meshopt_opacityMapRasterize");
        library.load(compact_, "meshopt_opacityMapCompact");
    }

    [[nodiscard]] RivalResult bake(const BakeMesh &mesh, const std::vector<uint8_t> &wanted) const override
    {
        const std::vector<TriangleUvs> &triangles = mesh.triangles;
        std::vector<unsigned> indices(triangles.size() * 3);
        std::iota(indices.begin(), indices.end(), 0u);
        RivalResult result;
        result.levels.resize(triangles.size());
        result.indices.resize(triangles.size());
        std::vector<unsigned> sources(triangles.size());
        const float *uvs = &triangles[0][0].u;
        const size_t count =
            measure_(result.levels.data(), sources.data(), result.indices.data(), indices.data(), indices.size(), uvs,
                     indices.size(), sizeof(TexCoord), mesh.width, mesh.height, 12, 0);
        result.offsets.resize(count);
        size_t bytes = 0;
        for (size_t i = 0; i < count; ++i) {
            result.levels[i] = wanted[sources[i]];
            result.offsets[i] = static_cast<unsigned>(bytes);
            bytes += packedBytes(result.levels[i], Format::FourState);
        }
        result.data.resize(bytes);
        for (size_t i = 0; i < count; ++i) {
            const float *t = uvs + size_t{sources[i]} * 6;
            rasterize_(result.data.data() + result.offsets[i], result.levels[i], 4, t, t + 2, t + 4, mesh.alpha.data(),
                       1, mesh.width, mesh.width, mesh.height);
        }
        compact_(result.data.data(), result.data.size(), result.levels.data(), result.offsets.data(), count,
                 result.indices.data(), triangles.size(), 4);
        return result;
    }

private:
    size_t (*measure_)(unsigned char *, unsigned *, int *, const unsigned *, size_t, const float *, size_t, size_t,
                       unsigned, unsigned, int, float);
    void (*rasterize_)(unsigned char *, int, int, const float *, const float *, const float *, const unsigned char *,
                       size_t, size_t, unsigned, unsigned);
    size_t (*compact_)(unsigned char *, size_t, unsigned char *, unsigned *, size_t, int *, size_t, int);
};

class OmmSdk : public Rival
{
public:
    explicit OmmSdk(const std::string &path)
    {
        name = "OMM SDK";
        const Library library(path);
        library.load(createBaker_, "ommCreateBaker");
        library.load(createTexture_, "ommCpuCreateTexture");
        library.load(destroyTexture_, "ommCpuDestroyTexture");
        library.load(bake_, "ommCpuBake");
        library.load(result_, "ommCpuGetBakeResultDesc");
        library.load(destroyResult_, "ommCpuDestroyBakeResult");
        const Creation creation;
        check(createBaker_(&creation, &baker_), "ommCreateBaker");
    }

    [[nodiscard]] RivalResult bake(const BakeMesh &mesh, const std::vector<uint8_t> &wanted) const override
    {
        const Mip mip{mesh.width, mesh.height, mesh.width, mesh.alpha.data()};
        const TextureInput textureInput{0, 0, &mip, 1, static_cast<float>(mesh.cutoff)};
        void *texture = nullptr;
        check(createTexture_(baker_, &textureInput, &texture), "ommCpuCreateTexture");
        std::vector<uint32_t> indices(mesh.triangles.size() * 3);
        std::iota(indices.begin(), indices.end(), 0u);
        constexpr int kModes[] = {0, 1, 2, 3, 4}; // by Wrap
        Input input;
        input.texture = texture;
        input.addressMode = kModes[static_cast<size_t>(mesh.wrapU)];
        input.texCoords = mesh.triangles.data();
        input.indices = indices.data();
        input.indexCount = static_cast<uint32_t>(indices.size());
        input.alphaCutoff = static_cast<float>(mesh.cutoff);
        input.levels = wanted.data();
        void *baked = nullptr;
        check(bake_(baker_, &input, &baked), "ommCpuBake");
        const Output *output = nullptr;
        check(result_(baked, &output), "ommCpuGetBakeResultDesc");
        RivalResult result;
        const auto *data = static_cast<const uint8_t *>(output->data);
        result.data.assign(data, data + output->dataSize);
        for (uint32_t i = 0; i < output->triangleCount; ++i) {
            result.levels.push_back(static_cast<uint8_t>(output->triangles[i].subdivisionLevel));
            result.offsets.push_back(output->triangles[i].dataOffset);
        }
        const auto *ommIndices = static_cast<const int32_t *>(output->indices);
        result.indices.assign(ommIndices, ommIndices + output->indexCount);
        destroyResult_(baked);
        destroyTexture_(baker_, texture);
        return result;
    }

private:
    // The structures of its header, as far as they matter here, with the values that a comparable bake needs.
    struct Creation {
        int type = 1; // for the CPU
        const void *memoryAndMessages[6] = {};
    };
    struct Mip {
        uint32_t width, height, rowPitch;
        const void *texels;
    };
    struct TextureInput {
        int format; // 0: 8-bit unorm
        int flags;
        const Mip *mips;
        uint32_t mipCount;
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
        uint32_t texCoordStride = 0;
        int indexFormat = 1; // 32 bits
        const void *indices = nullptr;
        uint32_t indexCount = 0;
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
        uint8_t maxLevel = 12;
        uint32_t maxDataSize = 0xffffffff;
        const uint8_t *levels = nullptr;
        uint64_t maxWorkload = ~uint64_t{0};
    };
    struct Output {
        const void *data;
        uint32_t dataSize;
        const MicromapTriangle *triangles;
        uint32_t triangleCount;
        const void *usages;
        uint32_t usageCount;
        const void *indices;
        uint32_t indexCount;
    };

    static void check(int result, const char *function)
    {
        if (result != 0)
            throw std::runtime_error(std::string(function) + " returned " + std::to_string(result));
    }

    int (*createBaker_)(const Creation *, void **);
    int (*createTexture_)(void *, const TextureInput *, void **);
    int (*destroyTexture_)(void *, void *);
    int (*bake_)(void *, const Input *, void **);
    int (*result_)(void *, const Output **);
    int (*destroyResult_)(void *);
    void *baker_ = nullptr;
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

void addScore(RivalScore &score, const RivalResult &theirs, const Micromap &exact, const std::vector<uint8_t> &levels)
{
    constexpr double kMostMicro = 1 << 26;
    for (size_t t = 0; t < theirs.indices.size() && score.micro < kMostMicro; ++t) {
        const int32_t index = exact.indices[t];
        for (uint32_t i = 0; i < microTriangleCount(levels[t]); ++i) {
            const auto at = [i](int32_t which, const uint8_t *data, const auto &offset) {
                return which < 0 ? *specialState(which)
                                 : readState(data + offset(static_cast<size_t>(which)), i, Format::FourState);
            };
            const State claim = at(theirs.indices[t], theirs.data.data(), [&](size_t k) { return theirs.offsets[k]; });
            const State truth = at(index, exact.data.data(), [&](size_t k) { return exact.triangles[k].dataOffset; });
            ++score.micro;
            if (claim != State::Opaque && claim != State::Transparent)
                continue;
            ++score.known;
            score.wrong += claim != truth ? 1 : 0;
        }
    }
}

} // namespace vellum::bench
