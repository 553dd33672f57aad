// SPDX-License-Identifier: Apache-2.0
// VK_KHR_pipeline_binary as an application uses it.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "harness/harness.h"
#include "layer/base/vulkan_newer.h"

namespace vt
{

inline constexpr VkFlags64 kCaptureData = VkFlags64{1} << 31; // VK_PIPELINE_CREATE_2_CAPTURE_DATA_BIT_KHR

inline newer::PipelineBinaryKey emptyKey()
{
    return {static_cast<VkStructureType>(1000483003), nullptr, 0, {}};
}

inline std::vector<uint8_t> bytesOf(const newer::PipelineBinaryKey &key)
{
    return {key.key, key.key + key.keySize};
}

// What an application keeps.
struct Kept {
    newer::PipelineBinaryKey key = emptyKey();
    std::vector<uint8_t> data;
};

class Binaries
{
public:
    explicit Binaries(Device &gpu) : gpu_(gpu)
    {
        const auto load = [&gpu](auto &function, const char *name) {
            function =
                reinterpret_cast<std::remove_reference_t<decltype(function)>>(vkGetDeviceProcAddr(gpu.device(), name));
        };
        load(create_, "vkCreatePipelineBinariesKHR");
        load(destroy_, "vkDestroyPipelineBinaryKHR");
        load(key_, "vkGetPipelineKeyKHR");
        load(data_, "vkGetPipelineBinaryDataKHR");
    }
    Binaries(const Binaries &) = delete;
    Binaries &operator=(const Binaries &) = delete;
    ~Binaries()
    {
        for (const newer::PipelineBinary binary : made_)
            destroy_(gpu_.device(), binary, nullptr);
    }

    // Null: not made.
    newer::PipelineBinary from(VkPipeline pipeline)
    {
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pipeline = pipeline;
        return create(info);
    }
    std::vector<newer::PipelineBinary> allFrom(VkPipeline pipeline)
    {
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pipeline = pipeline;
        newer::PipelineBinaryHandlesInfo handles{static_cast<VkStructureType>(1000483009), nullptr, 0, nullptr};
        VT_CHECK(create_(gpu_.device(), &info, nullptr, &handles));
        std::vector<newer::PipelineBinary> all(handles.pipelineBinaryCount);
        handles.pPipelineBinaries = all.data();
        VT_CHECK(create_(gpu_.device(), &info, nullptr, &handles));
        made_.insert(made_.end(), all.begin(), all.end());
        return all;
    }
    newer::PipelineBinary from(const Kept &kept)
    {
        const newer::PipelineBinaryData data{kept.data.size(), const_cast<uint8_t *>(kept.data.data())};
        const newer::PipelineBinaryKeysAndData all{1, &kept.key, &data};
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pKeysAndDataInfo = &all;
        return create(info);
    }
    // Null where one was not made.
    std::vector<newer::PipelineBinary> fromAll(const std::vector<Kept> &kept)
    {
        std::vector<newer::PipelineBinaryKey> keys;
        std::vector<newer::PipelineBinaryData> data;
        for (const Kept &one : kept) {
            keys.push_back(one.key);
            data.push_back({one.data.size(), const_cast<uint8_t *>(one.data.data())});
        }
        const auto count = static_cast<uint32_t>(kept.size());
        const newer::PipelineBinaryKeysAndData all{count, keys.data(), data.data()};
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pKeysAndDataInfo = &all;
        std::vector<newer::PipelineBinary> made(count,
                                                reinterpret_cast<newer::PipelineBinary>(this)); // to be overwritten
        newer::PipelineBinaryHandlesInfo handles{static_cast<VkStructureType>(1000483009), nullptr, count, made.data()};
        last_ = create_(gpu_.device(), &info, nullptr, &handles);
        for (const newer::PipelineBinary binary : made) {
            if (binary != nullptr)
                made_.push_back(binary);
        }
        return made;
    }
    newer::PipelineBinary fromCache(const void *pipelineInfo)
    {
        const newer::PipelineCreateInfo pipeline = pipelineCreateInfo(pipelineInfo);
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pPipelineCreateInfo = &pipeline;
        return create(info);
    }
    // Without asking before how many there are.
    newer::PipelineBinary fromCacheAtOnce(const void *pipelineInfo)
    {
        const newer::PipelineCreateInfo pipeline = pipelineCreateInfo(pipelineInfo);
        newer::PipelineBinaryCreateInfo info = createInfo();
        info.pPipelineCreateInfo = &pipeline;
        newer::PipelineBinary binary = nullptr;
        newer::PipelineBinaryHandlesInfo handles{static_cast<VkStructureType>(1000483009), nullptr, 1, &binary};
        last_ = create_(gpu_.device(), &info, nullptr, &handles);
        EXPECT_EQ(handles.pipelineBinaryCount, last_ == VK_SUCCESS ? 1u : 0u);
        if (binary != nullptr)
            made_.push_back(binary);
        return binary;
    }
    std::vector<uint8_t> key(const void *pipelineInfo)
    {
        const newer::PipelineCreateInfo pipeline = pipelineCreateInfo(pipelineInfo);
        newer::PipelineBinaryKey key = emptyKey();
        EXPECT_EQ(key_(gpu_.device(), pipelineInfo != nullptr ? &pipeline : nullptr, &key), VK_SUCCESS);
        return bytesOf(key);
    }
    Kept keep(newer::PipelineBinary binary)
    {
        const newer::PipelineBinaryDataInfo info{static_cast<VkStructureType>(1000483006), nullptr, binary};
        Kept kept;
        size_t size = 0;
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &size, nullptr), VK_SUCCESS);
        kept.data.resize(size);
        size_t less = size - 1;
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &less, kept.data.data()), newer::kNotEnoughSpace);
        EXPECT_EQ(less, size);
        EXPECT_EQ(kept.data, std::vector<uint8_t>(size));
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &size, kept.data.data()), VK_SUCCESS);
        EXPECT_EQ(size, kept.data.size());
        return kept;
    }
    [[nodiscard]] VkResult last() const { return last_; }

private:
    static newer::PipelineBinaryCreateInfo createInfo()
    {
        return {static_cast<VkStructureType>(1000483001), nullptr, nullptr, VK_NULL_HANDLE, nullptr};
    }
    static newer::PipelineCreateInfo pipelineCreateInfo(const void *info)
    {
        return {static_cast<VkStructureType>(1000483007), const_cast<void *>(info)};
    }
    newer::PipelineBinary create(const newer::PipelineBinaryCreateInfo &info)
    {
        newer::PipelineBinary binary = nullptr;
        newer::PipelineBinaryHandlesInfo handles{static_cast<VkStructureType>(1000483009), nullptr, 1, nullptr};
        if (info.pKeysAndDataInfo == nullptr) {
            last_ = create_(gpu_.device(), &info, nullptr, &handles);
            if (last_ == newer::kPipelineBinaryMissing) {
                EXPECT_EQ(handles.pipelineBinaryCount, 0u);
            }
            if (last_ != VK_SUCCESS)
                return nullptr;
            EXPECT_EQ(handles.pipelineBinaryCount, 1u);
        }
        handles.pPipelineBinaries = &binary;
        last_ = create_(gpu_.device(), &info, nullptr, &handles);
        if (last_ == VK_SUCCESS)
            made_.push_back(binary);
        return binary;
    }

    Device &gpu_;
    VkResult last_ = VK_SUCCESS;
    newer::PFN_CreatePipelineBinaries create_ = nullptr;
    newer::PFN_DestroyPipelineBinary destroy_ = nullptr;
    newer::PFN_GetPipelineKey key_ = nullptr;
    newer::PFN_GetPipelineBinaryData data_ = nullptr;
    std::vector<newer::PipelineBinary> made_;
};

// The chain of a pipeline that is made of a binary.
struct OfBinary {
    explicit OfBinary(const newer::PipelineBinary &binary, const void *next = nullptr)
        : info{newer::kPipelineBinaryInfo, next, 1, &binary}
    {
    }
    newer::PipelineBinaryInfo info;
};

} // namespace vt
