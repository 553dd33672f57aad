// SPDX-License-Identifier: Apache-2.0
// Chain copies what it must of an application's const pNext chain, and nothing of the application's changes.
#include "layer/base/pnext.h"

#include <cstring>

#include <gtest/gtest.h>

namespace vellum::layer
{
namespace
{

constexpr auto kUnknown = static_cast<VkStructureType>(1999999999);
constexpr auto kTimeline = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_TIMELINE_SEMAPHORE_FEATURES;
constexpr auto kAddress = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
constexpr auto kMicromap = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_OPACITY_MICROMAP_FEATURES_EXT;

struct ThreeStructures : testing::Test {
    VkPhysicalDeviceBufferDeviceAddressFeatures address{kAddress, nullptr, VK_FALSE, VK_FALSE, VK_FALSE};
    VkPhysicalDeviceOpacityMicromapFeaturesEXT micromap{kMicromap, &address, VK_TRUE, VK_FALSE, VK_FALSE};
    VkPhysicalDeviceTimelineSemaphoreFeatures timeline{kTimeline, &micromap, VK_TRUE};
};

TEST(StructureNames, AreThoseOfTheRegistry)
{
    EXPECT_STREQ(structureName(kMicromap), "VkPhysicalDeviceOpacityMicromapFeaturesEXT");
    EXPECT_EQ(structureName(kUnknown), nullptr);
}

TEST_F(ThreeStructures, RemovesFromTheMiddle)
{
    Chain chain(&timeline);
    chain.remove(kMicromap);
    const auto *first = static_cast<const VkPhysicalDeviceTimelineSemaphoreFeatures *>(chain.head());
    EXPECT_NE(first, &timeline);
    EXPECT_EQ(first->sType, kTimeline);
    EXPECT_TRUE(first->timelineSemaphore);
    EXPECT_EQ(first->pNext, &address);
    EXPECT_EQ(timeline.pNext, &micromap) << "the application's own chain was changed";
}

TEST_F(ThreeStructures, RemovesTheHeadWithoutACopy)
{
    Chain chain(&micromap);
    chain.remove(kMicromap);
    EXPECT_EQ(chain.head(), &address);
}

TEST_F(ThreeStructures, RemovesEveryOneOfAType)
{
    VkPhysicalDeviceOpacityMicromapFeaturesEXT second{kMicromap, &timeline, VK_TRUE, VK_FALSE, VK_FALSE};
    Chain chain(&second);
    chain.remove(kMicromap);
    EXPECT_EQ(findInChain(chain.head(), kMicromap), nullptr);
    EXPECT_NE(findInChain(chain.head(), kAddress), nullptr);
}

TEST_F(ThreeStructures, EditsACopyOfTheLast)
{
    Chain chain(&timeline);
    auto *edited = chain.edit<VkPhysicalDeviceBufferDeviceAddressFeatures>(kAddress);
    ASSERT_NE(edited, nullptr);
    edited->bufferDeviceAddress = VK_TRUE;
    EXPECT_FALSE(address.bufferDeviceAddress);
    EXPECT_TRUE(findInChain<VkPhysicalDeviceBufferDeviceAddressFeatures>(chain.head(), kAddress)->bufferDeviceAddress);
    EXPECT_EQ(chain.edit<VkPhysicalDeviceBufferDeviceAddressFeatures>(kAddress), edited) << "copied twice";
    chain.remove(kMicromap);
    EXPECT_EQ(findInChain(chain.head(), kAddress), reinterpret_cast<VkBaseInStructure *>(edited));
}

TEST_F(ThreeStructures, PrependsAndRemovesBehindWhatWasPrepended)
{
    VkPhysicalDeviceRayQueryFeaturesKHR own{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR, nullptr, VK_TRUE};
    Chain chain(&micromap);
    chain.prepend(reinterpret_cast<VkBaseInStructure *>(&own));
    chain.remove(kMicromap);
    EXPECT_EQ(chain.head(), &own);
    EXPECT_EQ(own.pNext, &address);
}

// A structure of Vulkan 1.4.344, newer than the oldest headers and registry that the project supports.
TEST_F(ThreeStructures, EditsBehindAStructureThatTheHeadersLack)
{
    const struct {
        VkStructureType sType;
        const void *pNext;
        uint64_t members[2];
    } mapping{
        static_cast<VkStructureType>(1000135006), &micromap, {1, 2}}; // VkShaderDescriptorSetAndBindingMappingInfoEXT
    Chain chain(&mapping);
    auto *edited = chain.edit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(kMicromap);
    ASSERT_NE(edited, nullptr);
    EXPECT_NE(edited, &micromap);
    EXPECT_EQ(std::memcmp(static_cast<const char *>(chain.head()) + sizeof(VkBaseInStructure), mapping.members,
                          sizeof mapping.members),
              0);
}

TEST_F(ThreeStructures, KeepsWhatFollowsAnUnknownStructure)
{
    const VkBaseInStructure unknown{kUnknown, reinterpret_cast<const VkBaseInStructure *>(&micromap)};
    Chain chain(&unknown);
    chain.remove(kMicromap);
    EXPECT_EQ(chain.head(), &unknown);
    EXPECT_EQ(unknown.pNext, reinterpret_cast<const VkBaseInStructure *>(&micromap));
    EXPECT_EQ(chain.edit<VkPhysicalDeviceBufferDeviceAddressFeatures>(kAddress), nullptr);
}

TEST_F(ThreeStructures, UnlinksOnlyForAsLongAsItLives)
{
    {
        const Unlinked unlinked(&timeline, kMicromap);
        EXPECT_EQ(unlinked.get<VkPhysicalDeviceOpacityMicromapFeaturesEXT>(), &micromap);
        EXPECT_EQ(timeline.pNext, &address);
    }
    EXPECT_EQ(timeline.pNext, &micromap);
}

} // namespace
} // namespace vellum::layer
