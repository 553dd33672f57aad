// SPDX-License-Identifier: Apache-2.0
// The device that --device selects from a list of invented ones.
#include <gtest/gtest.h>

#include "gpu/device_selection.h"

using namespace vellum::gpu;

namespace
{

constexpr VkPhysicalDeviceType kCpu = VK_PHYSICAL_DEVICE_TYPE_CPU;
constexpr VkPhysicalDeviceType kDiscrete = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;

std::vector<DeviceInfo> devices(std::initializer_list<DeviceInfo> list)
{
    std::vector<DeviceInfo> all = list;
    for (size_t i = 0; i < all.size(); ++i)
        all[i].number = static_cast<uint32_t>(i);
    return all;
}

DeviceInfo device(const char *name, VkPhysicalDeviceType type, bool tracesRays = true)
{
    DeviceInfo info;
    info.name = name;
    info.type = type;
    info.rayTracingPipelines = tracesRays;
    return info;
}

// The chosen device's number, or the error.
std::string chosen(const std::vector<DeviceInfo> &list, const std::optional<std::string> &wish)
{
    try {
        return std::to_string(DeviceSelection(wish).from(list).number);
    } catch (const std::runtime_error &error) {
        return error.what();
    }
}

} // namespace

TEST(ChooseDevice, DigitsAreANumberOnly)
{
    const auto all = devices({device("GTX 1080", kDiscrete), device("RTX 3090", kDiscrete)});
    EXPECT_EQ(chosen(all, "1"), "1");
    EXPECT_EQ(chosen(all, "0"), "0");
    EXPECT_EQ(chosen(all, "3090"), "--device 3090 is neither the number of a Vulkan device nor a part of the name of "
                                   "one; there is 0 (GTX 1080), 1 (RTX 3090)");
    EXPECT_EQ(chosen(all, "rtx 30"), "1");
    EXPECT_EQ(chosen(all, ""), "--device  is neither the number of a Vulkan device nor a part of the name of one; "
                               "there is 0 (GTX 1080), 1 (RTX 3090)");
}

TEST(ChooseDevice, TheMostPowerful)
{
    const auto all = devices({device("llvmpipe", kCpu), device("Radeon A", kDiscrete), device("Radeon B", kDiscrete)});
    EXPECT_EQ(chosen(all, std::nullopt), "1");
    EXPECT_EQ(chosen(all, "radeon"), "1");
    EXPECT_EQ(chosen(all, "e"), "1");
    EXPECT_EQ(chosen(all, "pipe"), "0");
}

TEST(ChooseDevice, DevicesThatTraceRays)
{
    const auto all = devices({device("Radeon HD", kDiscrete, false), device("Radeon RX", kDiscrete)});
    EXPECT_EQ(chosen(all, std::nullopt), "1");
    EXPECT_EQ(chosen(all, "Radeon"), "1");
    EXPECT_EQ(chosen(all, "Radeon HD"),
              "the Vulkan device Radeon HD has neither ray queries nor ray tracing pipelines");
    EXPECT_EQ(chosen(all, "0"), "the Vulkan device Radeon HD has neither ray queries nor ray tracing pipelines");
    EXPECT_EQ(chosen(devices({device("Radeon HD", kDiscrete, false)}), std::nullopt),
              "no Vulkan device has Vulkan 1.3 and ray queries or ray tracing pipelines; there is 0 (Radeon HD)");
    EXPECT_EQ(chosen({}, "0"), "there is no Vulkan device");
}
