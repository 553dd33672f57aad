// SPDX-License-Identifier: Apache-2.0
// VK_KHR_pipeline_binary as an application uses it.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "harness/harness.h"
#include "vk/newer.h"

namespace vt
{

inline constexpr VkFlags64 kCaptureData = VkFlags64{1} << 31; // VK_PIPELINE_CREATE_2_CAPTURE_DATA_BIT_KHR

inline VkPipelineBinaryKeyKHR emptyKey()
{
    return {VK_STRUCTURE_TYPE_PIPELINE_BINARY_KEY_KHR, nullptr, 0, {}};
}

inline std::vector<uint8_t> bytesOf(const VkPipelineBinaryKeyKHR &key)
{
    return {key.key, key.key + key.keySize};
}

// The data that an application stores.
struct Kept {
    VkPipelineBinaryKeyKHR key = emptyKey();
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
        for (const VkPipelineBinaryKHR binary : made_)
            destroy_(gpu_.device(), binary, nullptr);
    }

    // Null: not made.
    VkPipelineBinaryKHR from(VkPipeline pipeline)
    {
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pipeline = pipeline;
        return create(info);
    }
    std::vector<VkPipelineBinaryKHR> allFrom(VkPipeline pipeline)
    {
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pipeline = pipeline;
        VkPipelineBinaryHandlesInfoKHR handles{VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR, nullptr, 0, nullptr};
        VT_CHECK(create_(gpu_.device(), &info, nullptr, &handles));
        std::vector<VkPipelineBinaryKHR> all(handles.pipelineBinaryCount);
        handles.pPipelineBinaries = all.data();
        VT_CHECK(create_(gpu_.device(), &info, nullptr, &handles));
        made_.insert(made_.end(), all.begin(), all.end());
        return all;
    }
    VkPipelineBinaryKHR from(const Kept &kept)
    {
        const VkPipelineBinaryDataKHR data{kept.data.size(), const_cast<uint8_t *>(kept.data.data())};
        const VkPipelineBinaryKeysAndDataKHR all{1, &kept.key, &data};
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pKeysAndDataInfo = &all;
        return create(info);
    }
    // Null where one was not made.
    std::vector<VkPipelineBinaryKHR> fromAll(const std::vector<Kept> &kept)
    {
        std::vector<VkPipelineBinaryKeyKHR> keys;
        std::vector<VkPipelineBinaryDataKHR> data;
        for (const Kept &one : kept) {
            keys.push_back(one.key);
            data.push_back({one.data.size(), const_cast<uint8_t *>(one.data.data())});
        }
        const auto count = static_cast<uint32_t>(kept.size());
        const VkPipelineBinaryKeysAndDataKHR all{count, keys.data(), data.data()};
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pKeysAndDataInfo = &all;
        std::vector<VkPipelineBinaryKHR> made(count,
                                              reinterpret_cast<VkPipelineBinaryKHR>(this)); // to be overwritten
        VkPipelineBinaryHandlesInfoKHR handles{VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR, nullptr, count,
                                               made.data()};
        last_ = create_(gpu_.device(), &info, nullptr, &handles);
        for (const VkPipelineBinaryKHR binary : made) {
            if (binary != nullptr)
                made_.push_back(binary);
        }
        return made;
    }
    VkPipelineBinaryKHR fromCache(const void *pipelineInfo)
    {
        const VkPipelineCreateInfoKHR pipeline = pipelineCreateInfo(pipelineInfo);
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pPipelineCreateInfo = &pipeline;
        return create(info);
    }
    // Without querying the count first.
    VkPipelineBinaryKHR fromCacheAtOnce(const void *pipelineInfo)
    {
        const VkPipelineCreateInfoKHR pipeline = pipelineCreateInfo(pipelineInfo);
        VkPipelineBinaryCreateInfoKHR info = createInfo();
        info.pPipelineCreateInfo = &pipeline;
        VkPipelineBinaryKHR binary = nullptr;
        VkPipelineBinaryHandlesInfoKHR handles{VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR, nullptr, 1, &binary};
        last_ = create_(gpu_.device(), &info, nullptr, &handles);
        EXPECT_EQ(handles.pipelineBinaryCount, last_ == VK_SUCCESS ? 1u : 0u);
        if (binary != nullptr)
            made_.push_back(binary);
        return binary;
    }
    std::vector<uint8_t> key(const void *pipelineInfo)
    {
        const VkPipelineCreateInfoKHR pipeline = pipelineCreateInfo(pipelineInfo);
        VkPipelineBinaryKeyKHR key = emptyKey();
        EXPECT_EQ(key_(gpu_.device(), pipelineInfo != nullptr ? &pipeline : nullptr, &key), VK_SUCCESS);
        return bytesOf(key);
    }
    Kept keep(VkPipelineBinaryKHR binary)
    {
        const VkPipelineBinaryDataInfoKHR info{VK_STRUCTURE_TYPE_PIPELINE_BINARY_DATA_INFO_KHR, nullptr, binary};
        Kept kept;
        size_t size = 0;
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &size, nullptr), VK_SUCCESS);
        kept.data.resize(size);
        size_t less = size - 1;
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &less, kept.data.data()), VK_ERROR_NOT_ENOUGH_SPACE_KHR);
        EXPECT_EQ(less, size);
        EXPECT_EQ(kept.data, std::vector<uint8_t>(size));
        EXPECT_EQ(data_(gpu_.device(), &info, &kept.key, &size, kept.data.data()), VK_SUCCESS);
        EXPECT_EQ(size, kept.data.size());
        return kept;
    }
    [[nodiscard]] VkResult last() const { return last_; }

private:
    static VkPipelineBinaryCreateInfoKHR createInfo()
    {
        return {VK_STRUCTURE_TYPE_PIPELINE_BINARY_CREATE_INFO_KHR, nullptr, nullptr, VK_NULL_HANDLE, nullptr};
    }
    static VkPipelineCreateInfoKHR pipelineCreateInfo(const void *info)
    {
        return {VK_STRUCTURE_TYPE_PIPELINE_CREATE_INFO_KHR, const_cast<void *>(info)};
    }
    VkPipelineBinaryKHR create(const VkPipelineBinaryCreateInfoKHR &info)
    {
        VkPipelineBinaryKHR binary = nullptr;
        VkPipelineBinaryHandlesInfoKHR handles{VK_STRUCTURE_TYPE_PIPELINE_BINARY_HANDLES_INFO_KHR, nullptr, 1, nullptr};
        if (info.pKeysAndDataInfo == nullptr) {
            last_ = create_(gpu_.device(), &info, nullptr, &handles);
            if (last_ == VK_PIPELINE_BINARY_MISSING_KHR) {
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
    PFN_vkCreatePipelineBinariesKHR create_ = nullptr;
    PFN_vkDestroyPipelineBinaryKHR destroy_ = nullptr;
    PFN_vkGetPipelineKeyKHR key_ = nullptr;
    PFN_vkGetPipelineBinaryDataKHR data_ = nullptr;
    std::vector<VkPipelineBinaryKHR> made_;
};

// The chain of a pipeline that is made of a binary.
struct OfBinary {
    explicit OfBinary(const VkPipelineBinaryKHR &binary, const void *next = nullptr)
        : info{VK_STRUCTURE_TYPE_PIPELINE_BINARY_INFO_KHR, next, 1, &binary}
    {
    }
    VkPipelineBinaryInfoKHR info;
};

} // namespace vt
