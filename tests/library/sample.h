// SPDX-License-Identifier: Apache-2.0
// A texture and triangles for tests of libvellum.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "vellum/vellum.h"

namespace vellum::test
{

// RGBA texels whose alpha is a soft disc with holes; the other channels are not it.
inline std::vector<uint8_t> discTexels(int size)
{
    std::vector<uint8_t> texels;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) {
            const int dx = 2 * x - size + 1;
            const int dy = 2 * y - size + 1;
            const int inside = 3 * size * size / 4 - dx * dx - dy * dy;
            const int soft = inside > 1000 ? 255 : inside < -1000 ? 0 : 128 + inside / 8;
            const int alpha = (x / 4 + y / 6) % 5 == 0 ? 0 : soft;
            for (const int value : {255 - alpha, 3, 200, alpha})
                texels.push_back(static_cast<uint8_t>(value < 0 ? 0 : value > 255 ? 255 : value));
        }
    return texels;
}

// One input with its texture, and options. Not copyable: they point to each other.
struct Sample {
    static constexpr int kSize = 32;

    Sample()
    {
        vellumInitTexture(&texture, sizeof texture);
        texture.texels = texels.data();
        texture.texelsSize = texels.size();
        texture.width = texture.height = kSize;
        texture.offset = 3;
        texture.pixelStride = 4;
        vellumInitBakeInput(&input, sizeof input);
        input.textures = &texture;
        input.textureCount = 1;
        input.uvs = uvs.data();
        input.uvsSize = uvs.size() * sizeof(float);
        input.indexType = VELLUM_INDEX_TYPE_UINT16;
        input.indices = indices.data();
        input.indicesSize = indices.size() * sizeof(uint16_t);
        input.triangleCount = indices.size() / 3;
        vellumInitBakeOptions(&options, sizeof options);
        options.level = 3;
        options.threads = 1;
        options.message = [](void *self, VellumResult result, const char *text) {
            auto &sample = *static_cast<Sample *>(self);
            ++sample.messages;
            sample.reported = result;
            sample.message = text;
        };
        options.userData = this;
    }
    Sample(const Sample &) = delete;
    Sample &operator=(const Sample &) = delete;
    ~Sample() { vellumDestroyMicromap(micromap); }

    VellumResult bake()
    {
        vellumDestroyMicromap(micromap);
        messages = 0;
        message.clear();
        return vellumBake(&input, 1, &options, &micromap);
    }
    VellumMicromapInfo info() const
    {
        VellumMicromapInfo info{};
        info.structSize = sizeof info;
        vellumGetMicromapInfo(micromap, &info);
        return info;
    }
    // Everything that a renderer reads of the result, to compare.
    std::vector<uint8_t> bytes() const
    {
        const VellumMicromapInfo i = info();
        std::vector<uint8_t> all;
        const auto add = [&](const void *from, size_t size) {
            const auto *first = static_cast<const uint8_t *>(from);
            all.insert(all.end(), first, first + size);
        };
        add(i.data, i.dataSize);
        add(i.triangles, i.triangleCount * sizeof *i.triangles);
        add(i.indices, i.indexCount * sizeof *i.indices);
        return all;
    }

    std::vector<uint8_t> texels = discTexels(kSize);
    std::vector<float> uvs = {0, 0, 1, 0, 0, 1, 1, 1, 0.4f, 0.3f, 1.7f, 0.2f, 0.9f, -0.8f};
    // The fourth triangle is a point, which has one state all over; the fifth is the first.
    std::vector<uint16_t> indices = {0, 1, 2, 1, 3, 2, 0, 4, 5, 0, 0, 0, 0, 1, 2, 2, 3, 6};
    VellumTexture texture{};
    VellumBakeInput input{};
    VellumBakeOptions options{};
    VellumMicromap *micromap = nullptr;
    int messages = 0;
    VellumResult reported = VELLUM_SUCCESS;
    std::string message;
};

} // namespace vellum::test
