// SPDX-License-Identifier: Apache-2.0
// Behaviour that drivers other than lavapipe may have, and what must not reach the driver (layers/spy.cpp).
#include <algorithm>
#include <array>
#include <cstdlib>

#include "check/gpu/scene.h"
#include "harness/harness.h"

namespace
{

using namespace vt;

// An environment variable for as long as this lives.
class Environment
{
public:
    explicit Environment(const char *name, const char *value = "1") : name_(name) { setenv(name, value, 1); }
    ~Environment() { unsetenv(name_); }
    Environment(const Environment &) = delete;
    Environment &operator=(const Environment &) = delete;

private:
    const char *name_;
};

// Of memory that is local to the device and visible to the host there is little, on some: the layer's tables go
// elsewhere then.
TEST(Driver, WithoutLocalMemoryLeft)
{
    std::unique_ptr<Gpu> gpu;
    {
        const Environment full("VELLUM_TEST_SPY_MEMORY");
        ASSERT_NO_THROW(gpu = std::make_unique<Gpu>(Options{.quirks = "hostmemory"}));
    }
    for (const Message &m : gpu->takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// Names, tags and private data of a micromap of that API, by all extensions that have such: none reaches the driver,
// and those of other objects do.
void nameMicromap(Api api)
{
    // The validation layer has its own ideas about handles that it does not know.
    Gpu gpu(Options{.validation = false, .api = api, .debugMarker = true});
    MicromapInput input;
    input.add(1, kFourState, std::vector<uint8_t>(4, 1));
    const Micromap micromap(gpu, input);
    const VkObjectType type = api == Api::Khr ? VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR : VK_OBJECT_TYPE_MICROMAP_EXT;
    const uint64_t object = api == Api::Khr ? reinterpret_cast<uint64_t>(micromap.handle().khr)
                                            : reinterpret_cast<uint64_t>(micromap.handle().ext);
    const auto set = [&](VkObjectType kind, uint64_t handle) {
        const auto function = [&]<class Function>(Function, const char *name) {
            const auto loaded = reinterpret_cast<Function>(vkGetDeviceProcAddr(gpu.device(), name));
            EXPECT_NE(loaded, nullptr) << name;
            return loaded;
        };
        auto name = vkInit<VkDebugUtilsObjectNameInfoEXT>(
            {.objectType = kind, .objectHandle = handle, .pObjectName = "leaves"});
        function(PFN_vkSetDebugUtilsObjectNameEXT{}, "vkSetDebugUtilsObjectNameEXT")(gpu.device(), &name);
        auto tag = vkInit<VkDebugUtilsObjectTagInfoEXT>(
            {.objectType = kind, .objectHandle = handle, .tagSize = 1, .pTag = "x"});
        function(PFN_vkSetDebugUtilsObjectTagEXT{}, "vkSetDebugUtilsObjectTagEXT")(gpu.device(), &tag);
        auto marker = vkInit<VkDebugMarkerObjectNameInfoEXT>();
        marker.objectType = static_cast<VkDebugReportObjectTypeEXT>(kind); // the same numbers
        marker.object = handle;
        marker.pObjectName = "leaves";
        function(PFN_vkDebugMarkerSetObjectNameEXT{}, "vkDebugMarkerSetObjectNameEXT")(gpu.device(), &marker);
        auto markerTag = vkInit<VkDebugMarkerObjectTagInfoEXT>(
            {.objectType = marker.objectType, .object = handle, .tagSize = 1, .pTag = "x"});
        function(PFN_vkDebugMarkerSetObjectTagEXT{}, "vkDebugMarkerSetObjectTagEXT")(gpu.device(), &markerTag);
        auto slotInfo = vkInit<VkPrivateDataSlotCreateInfo>();
        VkPrivateDataSlot slot = VK_NULL_HANDLE;
        VT_CHECK(vkCreatePrivateDataSlot(gpu.device(), &slotInfo, nullptr, &slot));
        VT_CHECK(vkSetPrivateData(gpu.device(), kind, handle, slot, 42));
        uint64_t value = 0;
        vkGetPrivateData(gpu.device(), kind, handle, slot, &value);
        EXPECT_EQ(value, 42u);
        vkDestroyPrivateDataSlot(gpu.device(), slot, nullptr);
    };
    set(type, object);
    const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
    set(VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(blas.handle()));
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
    // The spy would have told.
    const auto stranger = reinterpret_cast<uint64_t>(&gpu);
    auto marker = vkInit<VkDebugMarkerObjectNameInfoEXT>(
        {.objectType = VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT,
         .object = stranger,
         .pObjectName = "stranger"});
    reinterpret_cast<PFN_vkDebugMarkerSetObjectNameEXT>(
        vkGetDeviceProcAddr(gpu.device(), "vkDebugMarkerSetObjectNameEXT"))(gpu.device(), &marker);
    EXPECT_EQ(gpu.takeUnexpectedMessages().size(), 1u);
}

TEST(Driver, NamesOfMicromapsStayInTheLayer)
{
    nameMicromap(Api::Ext);
}

TEST(Driver, NamesOfMicromapStructuresStayInTheLayer)
{
    nameMicromap(Api::Khr);
}

// 1,000 triangles that share the data of one: as much as the usage counts have space for would reach from the data into
// the micromap behind it, in the same buffer. Transfers must not overlap; the validation layer would tell.
TEST(Driver, InputAndMicromapInOneBuffer)
{
    Gpu gpu(Options{.api = Api::Ext});
    MicromapInput input;
    const std::vector<uint8_t> states(256, 1);
    input.add(4, kFourState, states);
    input.triangles.resize(1000, input.triangles[0]);
    Micromap other(gpu, input); // for its build info
    constexpr VkDeviceSize kPlace = 1024;
    const Buffer both(gpu, kPlace + other.size(),
                      VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT | VK_BUFFER_USAGE_MICROMAP_STORAGE_BIT_EXT |
                          VK_BUFFER_USAGE_MICROMAP_BUILD_INPUT_READ_ONLY_BIT_EXT);
    ASSERT_EQ(both.address() % 256, 0u);
    std::memcpy(both.bytes(), input.data.data(), input.data.size());
    auto create = vkInit<VkMicromapCreateInfoEXT>({.buffer = both.handle(),
                                                   .offset = kPlace,
                                                   .size = other.size(),
                                                   .type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT});
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    VT_CHECK(gpu.vk().CreateMicromapEXT(gpu.device(), &create, nullptr, &micromap));
    Micromap folded(gpu, input, VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT);
    folded.build();
    VkMicromapBuildInfoEXT info = other.buildInfo();
    info.dstMicromap = micromap;
    info.data.deviceAddress = both.address();
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 1, &info); });
    // Data that is not copied as it lies does not stay either: uniform triangles are folded.
    EXPECT_EQ(std::memcmp(both.bytes() + kPlace + 64, folded.memory() + 64, 1000 * 8), 0);
    gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, nullptr);
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// What messages that an application sends itself name: object by object, by VK_EXT_debug_utils and, the last one, by
// VK_EXT_debug_report.
using Named = std::vector<std::pair<int, uint64_t>>;

VKAPI_ATTR VkBool32 VKAPI_CALL noteObjects(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                           const VkDebugUtilsMessengerCallbackDataEXT *data, void *named)
{
    for (uint32_t i = 0; i < data->objectCount; ++i)
        static_cast<Named *>(named)->emplace_back(data->pObjects[i].objectType, data->pObjects[i].objectHandle);
    return VK_FALSE;
}

VKAPI_ATTR VkBool32 VKAPI_CALL noteObject(VkDebugReportFlagsEXT, VkDebugReportObjectTypeEXT type, uint64_t object,
                                          size_t, int32_t, const char *, const char *, void *named)
{
    static_cast<Named *>(named)->emplace_back(type, object);
    return VK_FALSE;
}

// Objects of the layer's own keep their handles and names, but below the layer nobody looks them up by their type. The
// messengers are below it.
TEST(Driver, MessagesOfTheApplicationNameNoMicromaps)
{
    for (const Api api : {Api::Ext, Api::Khr}) {
        Gpu gpu(Options{.validation = false, .api = api});
        MicromapInput input;
        input.add(1, kFourState, std::vector<uint8_t>(4, 1));
        const Micromap micromap(gpu, input);
        const Blas blas(gpu, {Geometry{.vertices = triangleRow(1)}});
        const bool khr = api == Api::Khr;
        const auto structure = reinterpret_cast<uint64_t>(blas.handle());
        const auto object =
            khr ? reinterpret_cast<uint64_t>(micromap.handle().khr) : reinterpret_cast<uint64_t>(micromap.handle().ext);
        const auto function = [&]<class Function>(Function, const char *name) {
            return reinterpret_cast<Function>(vkGetInstanceProcAddr(gpu.instance(), name));
        };
        Named named;
        auto messenger =
            vkInit<VkDebugUtilsMessengerCreateInfoEXT>({.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_INFO_BIT_EXT,
                                                        .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT,
                                                        .pfnUserCallback = noteObjects,
                                                        .pUserData = &named});
        VkDebugUtilsMessengerEXT listener = VK_NULL_HANDLE;
        VT_CHECK(gpu.vk().CreateDebugUtilsMessengerEXT(gpu.instance(), &messenger, nullptr, &listener));
        std::array<VkDebugUtilsObjectNameInfoEXT, 2> objects{};
        for (VkDebugUtilsObjectNameInfoEXT &one : objects)
            one = vkInit<VkDebugUtilsObjectNameInfoEXT>();
        objects[0].objectType = khr ? VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR : VK_OBJECT_TYPE_MICROMAP_EXT;
        objects[0].objectHandle = object;
        objects[1].objectType = VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR;
        objects[1].objectHandle = structure;
        auto data = vkInit<VkDebugUtilsMessengerCallbackDataEXT>(
            {.pMessage = "of the application", .objectCount = 2, .pObjects = objects.data()});
        function(PFN_vkSubmitDebugUtilsMessageEXT{},
                 "vkSubmitDebugUtilsMessageEXT")(gpu.instance(), VK_DEBUG_UTILS_MESSAGE_SEVERITY_INFO_BIT_EXT,
                                                 VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT, &data);
        EXPECT_EQ(named,
                  (Named{{VK_OBJECT_TYPE_UNKNOWN, object}, {VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, structure}}));
        gpu.vk().DestroyDebugUtilsMessengerEXT(gpu.instance(), listener, nullptr);
        if (!khr)
            continue; // VK_EXT_debug_report has no type for the others
        named.clear();
        auto info = vkInit<VkDebugReportCallbackCreateInfoEXT>(
            {.flags = VK_DEBUG_REPORT_PERFORMANCE_WARNING_BIT_EXT, .pfnCallback = noteObject, .pUserData = &named});
        VkDebugReportCallbackEXT callback = VK_NULL_HANDLE;
        VT_CHECK(function(PFN_vkCreateDebugReportCallbackEXT{}, "vkCreateDebugReportCallbackEXT")(gpu.instance(), &info,
                                                                                                  nullptr, &callback));
        for (const uint64_t one : {object, structure})
            function(PFN_vkDebugReportMessageEXT{}, "vkDebugReportMessageEXT")(
                gpu.instance(), info.flags, VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT, one, 0, 0,
                "test", "of the application");
        // The loader calls back, and the driver once more.
        named.erase(std::unique(named.begin(), named.end()), named.end());
        EXPECT_EQ(named, (Named{{VK_DEBUG_REPORT_OBJECT_TYPE_UNKNOWN_EXT, object},
                                {VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT, structure}}));
        function(PFN_vkDestroyDebugReportCallbackEXT{}, "vkDestroyDebugReportCallbackEXT")(gpu.instance(), callback,
                                                                                           nullptr);
    }
}

// Copies of query results are recorded with memory of the layer's: not with an allocation each, of which there may be
// no more than maxMemoryAllocationCount.
TEST(Driver, ManyCopiesOfQueryResults)
{
    Gpu gpu(Options{.api = Api::Ext});
    MicromapInput input;
    input.add(4, kFourState, std::vector<uint8_t>(256, 1));
    Micromap micromap(gpu, input);
    micromap.build();
    constexpr uint32_t kCopies = 100;
    const Buffer out(gpu, kCopies * 8, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const QueryPool pool(gpu, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT);
    const VkMicromapEXT handle = micromap.handle().ext;
    gpu.submit([&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, 1);
        gpu.vk().CmdWriteMicromapsPropertiesEXT(commands, 1, &handle, pool.type(), pool, 0);
        const auto copy = [&](uint32_t i) {
            vkCmdCopyQueryPoolResults(commands, pool, 0, 1, out.handle(), i * 8, 8,
                                      VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
        };
        copy(0);
        const Environment full("VELLUM_TEST_SPY_MEMORY");
        for (uint32_t i = 1; i < kCopies; ++i)
            copy(i);
    });
    for (const uint64_t size : out.as<uint64_t>())
        EXPECT_EQ(size, 64u + 64u + 16u + 256u / 4u);
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// VK_NV_displacement_micromap is built on the driver's own VK_EXT_opacity_micromap, and its structures carry a
// VkMicromapEXT: beside emulated micromaps there is none.
TEST(Driver, NoDisplacementBesideEmulation)
{
    const Environment force("VELLUM_IMPLEMENTATION", "emulated");
    auto gpu = std::make_unique<Gpu>(Options{.validation = false, .quirks = "displacement", .api = Api::Ext});
    constexpr const char *kDisplacement = "VK_NV_displacement_micromap";
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu->physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> list(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu->physical(), nullptr, &count, list.data()));
    const auto listed = [&](const std::string &name) {
        return std::count_if(list.begin(), list.end(), [&](const auto &e) { return name == e.extensionName; });
    };
    EXPECT_EQ(listed(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME), 1);
    EXPECT_EQ(listed(kDisplacement), 0);
    struct OneMember {
        VkStructureType sType;
        void *pNext = nullptr;
        uint32_t value = 1;
    };
    OneMember feature{static_cast<VkStructureType>(1000397000)};
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &feature});
    vkGetPhysicalDeviceFeatures2(gpu->physical(), &features);
    EXPECT_EQ(feature.value, 0u);
    OneMember limit{static_cast<VkStructureType>(1000397001)};
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &limit});
    vkGetPhysicalDeviceProperties2(gpu->physical(), &properties);
    EXPECT_EQ(limit.value, 0u);
    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto info = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1,
                                            .pQueueCreateInfos = &queue,
                                            .enabledExtensionCount = 1,
                                            .ppEnabledExtensionNames = &kDisplacement});
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(vkCreateDevice(gpu->physical(), &info, nullptr, &device), VK_ERROR_EXTENSION_NOT_PRESENT);
    vkDestroyDevice(device, nullptr);
    std::vector<std::string> reported;
    for (const Message &m : gpu->takeUnexpectedMessages()) {
        EXPECT_NE(m.id, "SPY") << m.text;
        if (m.fromVellum()) // the loader says something, too
            reported.push_back(m.id);
    }
    EXPECT_EQ(reported, std::vector<std::string>{"VELLUM-hidden-extension"});
}

// The driver has both, but with an extension that it lacks micromaps are the layer's.
TEST(Driver, NoDisplacementBesideWhatTheDriverLacks)
{
    auto gpu = std::make_unique<Gpu>(Options{.validation = false, .quirks = "displacement", .api = Api::Khr});
    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto info = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1, .pQueueCreateInfos = &queue});
    const std::array names{VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, "VK_NV_displacement_micromap",
                           "VK_KHR_device_address_commands"};
    info.enabledExtensionCount = 3;
    info.ppEnabledExtensionNames = names.data();
    VkDevice device = VK_NULL_HANDLE;
    EXPECT_EQ(vkCreateDevice(gpu->physical(), &info, nullptr, &device), VK_ERROR_EXTENSION_NOT_PRESENT);
    vkDestroyDevice(device, nullptr);
    std::vector<std::string> reported;
    for (const Message &m : gpu->takeUnexpectedMessages()) {
        EXPECT_NE(m.id, "SPY") << m.text;
        if (m.fromVellum())
            reported.push_back(m.id);
    }
    EXPECT_EQ(reported, std::vector<std::string>{"VELLUM-hidden-extension"});
}

// Lavapipe has VK_AMDX_shader_enqueue; beside the layer nobody sees it, and no device can have it.
TEST(Driver, HiddenExtension)
{
    constexpr const char *kEnqueue = "VK_AMDX_shader_enqueue";
    struct EnqueueFeatures {
        VkStructureType sType = static_cast<VkStructureType>(1000134000);
        void *pNext = nullptr;
        VkBool32 shaderEnqueue = VK_TRUE;
        VkBool32 shaderMeshEnqueue = VK_TRUE;
    };
    const auto has = [](const Gpu &gpu) {
        uint32_t count = 0;
        VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, nullptr));
        std::vector<VkExtensionProperties> list(count);
        VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, list.data()));
        return std::any_of(list.begin(), list.end(),
                           [](const auto &e) { return std::strcmp(e.extensionName, kEnqueue) == 0; });
    };
    const auto featuresOf = [](const Gpu &gpu) {
        EnqueueFeatures enqueue;
        auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &enqueue});
        vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
        enqueue.pNext = nullptr;
        return enqueue;
    };
    if (const Gpu bare(Options{.vellum = false, .validation = false, .micromaps = false}); !has(bare))
        GTEST_SKIP() << "the driver has no " << kEnqueue;
    else
        EXPECT_TRUE(featuresOf(bare).shaderEnqueue);
    Gpu gpu(Options{.validation = false});
    EXPECT_FALSE(has(gpu));
    EXPECT_FALSE(featuresOf(gpu).shaderEnqueue);
    EXPECT_FALSE(featuresOf(gpu).shaderMeshEnqueue);

    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto info = vkInit<VkDeviceCreateInfo>({.queueCreateInfoCount = 1, .pQueueCreateInfos = &queue});
    const std::array names{VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME, kEnqueue};
    info.enabledExtensionCount = 2;
    info.ppEnabledExtensionNames = names.data();
    VkDevice device = VK_NULL_HANDLE;
    // The loader rejects what nobody lists; where a manifest lists it, the layer does (NoDisplacementBesideEmulation).
    EXPECT_EQ(vkCreateDevice(gpu.physical(), &info, nullptr, &device), VK_ERROR_EXTENSION_NOT_PRESENT);
    vkDestroyDevice(device, nullptr);
    gpu.takeUnexpectedMessages();
}

} // namespace
