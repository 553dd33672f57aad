// SPDX-License-Identifier: Apache-2.0
// vellumBake() for JavaScript: inputs are added one by one, then baked.
#include <deque>
#include <memory>
#include <vector>

#include "wasm/call.h"

using namespace vellum;
using namespace vellum::wasm;

namespace
{

struct Bake {
    std::deque<std::vector<VellumTexture>> textures; // of each input, and of the next one
    std::vector<VellumBakeInput> inputs;
};

void describe(const VellumMicromap *micromap, size_t inputs, Result &result)
{
    VellumMicromapInfo info{};
    info.structSize = sizeof info;
    vellumGetMicromapInfo(micromap, &info);
    JsonWriter json(JsonStyle::Compact);
    json.beginObject().member("data", result.add(info.data, info.dataSize));
    json.member("triangles", result.add(info.triangles, info.triangleCount * sizeof *info.triangles));
    json.member("indices", result.add(info.indices, info.indexCount * sizeof *info.indices));
    writeUsages(json, std::span(info.usages, info.usageCount));
    json.key("geometries").beginArray();
    for (size_t i = 0; i < inputs; ++i) {
        VellumGeometryInfo geometry{};
        geometry.structSize = sizeof geometry;
        vellumGetGeometryInfo(micromap, i, &geometry);
        json.beginObject().member("indices", result.add(geometry.indices, geometry.indexCount * sizeof(int32_t)));
        writeUsages(json, std::span(geometry.usages, geometry.usageCount));
        json.end();
    }
    json.end().values("stateCounts", info.stateCounts).values("specialCounts", info.specialCounts);
    json.member("distinctCount", info.distinctCount).end();
    result.text = json.text();
}

} // namespace

VELLUM_EXPORT("createBake") Bake *vellumCreateBakeOfCall()
{
    return guardedExport([] {
        auto bake = std::make_unique<Bake>();
        bake->textures.emplace_back();
        return bake.release();
    });
}

VELLUM_EXPORT("destroyBake") void vellumDestroyBakeOfCall(Bake *bake)
{
    delete bake;
}

// Adds a mip level of the next input.
VELLUM_EXPORT("addTexture")
bool vellumAddTextureOfCall(Bake *bake, const void *texels, size_t texelsSize, uint32_t width, uint32_t height,
                            uint32_t format, uint32_t filter, uint32_t addressModeU, uint32_t addressModeV,
                            size_t offset, size_t pixelStride, size_t rowStride, float scale, float border)
{
    VellumTexture texture;
    vellumInitTexture(&texture, sizeof texture);
    texture.texels = texels;
    texture.texelsSize = texelsSize;
    texture.width = width;
    texture.height = height;
    texture.format = format;
    texture.filter = filter;
    texture.addressModeU = addressModeU;
    texture.addressModeV = addressModeV;
    texture.offset = offset;
    texture.pixelStride = pixelStride;
    texture.rowStride = rowStride;
    texture.scale = scale;
    texture.border = border;
    return guardedExport([&] {
        bake->textures.back().push_back(texture);
        return true;
    });
}

// `transform`: 6 floats; it, `levels` and `formats` may be null.
VELLUM_EXPORT("addInput")
bool vellumAddInputOfCall(Bake *bake, const void *uvs, size_t uvsSize, size_t uvStride, uint32_t uvFormat,
                          const void *indices, size_t indicesSize, uint32_t indexType, size_t triangleCount,
                          const float *transform, const uint8_t *levels, const uint8_t *formats, double cutoff)
{
    VellumBakeInput input;
    vellumInitBakeInput(&input, sizeof input);
    input.textures = bake->textures.back().data();
    input.textureCount = bake->textures.back().size();
    input.uvs = uvs;
    input.uvsSize = uvsSize;
    input.uvStride = uvStride;
    input.uvFormat = uvFormat;
    input.indices = indices;
    input.indicesSize = indicesSize;
    input.indexType = indexType;
    input.triangleCount = triangleCount;
    for (int i = 0; transform != nullptr && i < 6; ++i)
        input.uvTransform[i] = transform[i];
    input.levels = levels;
    input.formats = formats;
    input.cutoff = cutoff;
    return guardedExport([&] {
        bake->inputs.push_back(input);
        bake->textures.emplace_back();
        return true;
    });
}

VELLUM_EXPORT("bake") const Result::Words *vellumBakeOfCall(const Bake *bake, const double *numbers)
{
    return guardedExport([&] {
        auto result = std::make_unique<Result>();
        const VellumBakeOptions options = optionsOf(numbers, *result);
        VellumMicromap *micromap = nullptr;
        const VellumResult code = vellumBake(bake->inputs.data(), bake->inputs.size(), &options, &micromap);
        if (code == VELLUM_SUCCESS) {
            result->owner = std::shared_ptr<void>(
                micromap, [](void *made) { vellumDestroyMicromap(static_cast<VellumMicromap *>(made)); });
            describe(micromap, bake->inputs.size(), *result);
        }
        return finish(std::move(result), code);
    });
}
