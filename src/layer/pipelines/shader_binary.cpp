// SPDX-License-Identifier: Apache-2.0
#include "layer/pipelines/shader_binary.h"

#include <cstring>
#include <random>
#include <span>
#include <string_view>

#include "core/hash.h"
#include "layer/pipelines/device_pipelines.h"
#include "layer/pipelines/driver_stages.h"

namespace vellum::layer
{

const std::array<uint8_t, VK_UUID_SIZE> &rewriterUuid()
{
    static const auto uuid = [] {
        const uint64_t linked = spirv::linkedCodeHash();
        const uint64_t version = Hash::of(std::as_bytes(std::span(std::string_view(VELLUM_VERSION))));
        std::array<uint8_t, VK_UUID_SIZE> bytes{};
        std::memcpy(bytes.data(), &linked, sizeof linked);
        std::memcpy(bytes.data() + sizeof linked, &version, sizeof version);
        return bytes;
    }();
    return uuid;
}

const std::array<uint8_t, VK_UUID_SIZE> &processUuid()
{
    static const auto uuid = [] {
        std::random_device random;
        std::array<uint8_t, VK_UUID_SIZE> bytes{};
        for (uint8_t &byte : bytes)
            byte = static_cast<uint8_t>(random());
        return bytes;
    }();
    return uuid;
}

ShaderBinaryHeader shaderBinaryHeader(DevicePipelines &device)
{
    const spirv::RewriteOptions options = rewriteOptions(device);
    const uint64_t all = options.queriesConsume == spirv::QueriesConsume::Always ? 1 : 0;
    return {rewriterUuid(), options.rootAddress, options.firstSlots | all << 63};
}

VkResult getShaderBinaryData(DevicePipelines &device, VkDevice handle, VkShaderEXT shader, size_t *size, void *data)
{
    constexpr size_t kHeader = sizeof(ShaderBinaryHeader);
    if (!data) {
        const VkResult result = device.driver.next.GetShaderBinaryDataEXT(handle, shader, size, nullptr);
        *size += kHeader;
        return result;
    }
    if (*size < kHeader) {
        *size = 0; // "If pDataSize is less than the size of the binary ... nothing is written"
        return VK_INCOMPLETE;
    }
    size_t driverSize = *size - kHeader;
    const VkResult result = device.driver.next.GetShaderBinaryDataEXT(handle, shader, &driverSize,
                                                                      static_cast<std::byte *>(data) + kHeader);
    if (result == VK_SUCCESS) {
        const ShaderBinaryHeader header = shaderBinaryHeader(device);
        std::memcpy(data, &header, kHeader);
        *size = driverSize + kHeader;
    } else {
        *size = 0;
    }
    return result;
}

} // namespace vellum::layer
