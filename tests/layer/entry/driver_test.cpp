// SPDX-License-Identifier: Apache-2.0
// Behaviour that drivers other than lavapipe may have, and what must not reach the driver (layers/spy.cpp).
#include <algorithm>
#include <array>
#include <cstdlib>

#include "gpu/scene.h"
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

// Some devices have little memory that is both local to the device and visible to the host: without it, the layer's
// tables are in other memory.
TEST(Driver, NoLocalMemoryLeft)
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
    const bool hasMarkers = gpu.has(VK_EXT_DEBUG_MARKER_EXTENSION_NAME);
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
        if (hasMarkers) {
            auto marker = vkInit<VkDebugMarkerObjectNameInfoEXT>();
            marker.objectType = static_cast<VkDebugReportObjectTypeEXT>(kind); // both enumerations have the same values
            marker.object = handle;
            marker.pObjectName = "leaves";
            function(PFN_vkDebugMarkerSetObjectNameEXT{}, "vkDebugMarkerSetObjectNameEXT")(gpu.device(), &marker);
            auto markerTag = vkInit<VkDebugMarkerObjectTagInfoEXT>(
                {.objectType = marker.objectType, .object = handle, .tagSize = 1, .pTag = "x"});
            function(PFN_vkDebugMarkerSetObjectTagEXT{}, "vkDebugMarkerSetObjectTagEXT")(gpu.device(), &markerTag);
        }
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
    if (!hasMarkers)
        return;
    // The spy would have reported it.
    const auto unknown = reinterpret_cast<uint64_t>(&gpu);
    auto marker = vkInit<VkDebugMarkerObjectNameInfoEXT>(
        {.objectType = VK_DEBUG_REPORT_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR_EXT,
         .object = unknown,
         .pObjectName = "unknown"});
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

// 1,000 triangles that share the data of one. The usage counts would allow data that reaches into the micromap behind
// it, in the same buffer. Transfers must not overlap; the validation layer would report it.
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
    VkMicromapBuildInfoEXT info = other.buildInfo();
    info.dstMicromap = micromap;
    info.data.deviceAddress = both.address();
    gpu.submit([&](VkCommandBuffer commands) { gpu.vk().CmdBuildMicromapsEXT(commands, 1, &info); });
    // Data that is not copied as it lies does not stay either: each triangle has its own.
    const uint8_t *data = both.bytes() + kPlace + 64 + 1000 * 8;
    for (uint32_t i = 0; i < 1000; ++i) {
        uint32_t record[2];
        std::memcpy(record, both.bytes() + kPlace + 64 + i * 8, 8);
        EXPECT_EQ(record[0] >> 5, i * 4) << "triangle " << i;
        EXPECT_EQ(std::memcmp(data + i * 64, input.data.data(), 64), 0) << "triangle " << i;
    }
    gpu.vk().DestroyMicromapEXT(gpu.device(), micromap, nullptr);
    for (const Message &m : gpu.takeUnexpectedMessages())
        ADD_FAILURE() << m.id << ": " << m.text;
}

// The objects that a message names which the application submits itself: by VK_EXT_debug_utils and, the last one, by
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

// Objects of the layer's own keep their handles and names, but nothing below the layer looks them up by their type. The
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

// Copies of query results need memory of the layer. They share allocations, as there may be no more than
// maxMemoryAllocationCount.
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

// VK_NV_displacement_micromap builds on the driver's own VK_EXT_opacity_micromap, and its structures carry a
// VkMicromapEXT. The layer does not offer it if it emulates micromaps.
TEST(Driver, NoDisplacementWithEmulation)
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
    OneMember feature{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_FEATURES_NV};
    auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &feature});
    vkGetPhysicalDeviceFeatures2(gpu->physical(), &features);
    EXPECT_EQ(feature.value, 0u);
    OneMember limit{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DISPLACEMENT_MICROMAP_PROPERTIES_NV};
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
    EXPECT_EQ(reported, std::vector<std::string>{"VELLUM-conflicting-extension"});
}

// The driver lists both and supports the features of neither, so micromaps are emulated.
TEST(Driver, NoDisplacementWithPartialSupport)
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
    EXPECT_EQ(reported, std::vector<std::string>{"VELLUM-conflicting-extension"});
}

// An extension that cannot be enabled together with the layer's micromaps, and its features.
struct Conflicting {
    const char *extension;
    int features; // the sType of the structure; 0: none
    bool withTranslated;
};
constexpr Conflicting kConflicting[]{
    {"VK_NV_ray_tracing", 0, false},
    {"VK_NV_ray_tracing_motion_blur", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_MOTION_BLUR_FEATURES_NV, false},
    {"VK_NV_cluster_acceleration_structure", 1000569000, false},
    {"VK_NV_partitioned_acceleration_structure", 1000570000, false},
    {"VK_AMDX_dense_geometry_format", 1000478000, true},
    {"VK_NV_command_buffer_inheritance", 1000559000, true},
    {"VK_NV_push_constant_bank", 1000580001, true},
};
// Large enough for each of them.
struct ConflictingFeatures {
    VkStructureType sType;
    void *pNext = nullptr;
    VkBool32 first = VK_FALSE, second = VK_FALSE;
};

bool lists(const Gpu &gpu, const char *name)
{
    uint32_t count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> list(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(gpu.physical(), nullptr, &count, list.data()));
    return std::ranges::any_of(list, [name](const auto &e) { return std::strcmp(e.extensionName, name) == 0; });
}

// The result of vkCreateDevice with these extensions and features.
VkResult createDevice(const Gpu &gpu, const std::vector<const char *> &extensions, const void *features)
{
    const float priority = 1;
    auto queue = vkInit<VkDeviceQueueCreateInfo>({.queueCount = 1, .pQueuePriorities = &priority});
    auto info = vkInit<VkDeviceCreateInfo>({.pNext = features,
                                            .queueCreateInfoCount = 1,
                                            .pQueueCreateInfos = &queue,
                                            .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                            .ppEnabledExtensionNames = extensions.data()});
    VkDevice device = VK_NULL_HANDLE;
    const VkResult result = vkCreateDevice(gpu.physical(), &info, nullptr, &device);
    if (result == VK_SUCCESS)
        vkDestroyDevice(device, nullptr);
    return result;
}

// The errors and warnings that the layer has sent.
std::vector<Message> warningsOf(Gpu &gpu)
{
    std::vector<Message> messages = gpu.takeUnexpectedMessages();
    std::erase_if(messages, [](const Message &m) { return !m.fromVellum() && m.id != "SPY"; }); // the loader's
    return messages;
}

// A device without micromaps may enable such an extension; for one with micromaps that is an error with a message. A
// program that enables all features that one query returns gets its device, with micromaps.
TEST(Driver, ExtensionsThatConflictWithMicromaps)
{
    for (const bool translated : {false, true}) {
        SCOPED_TRACE(translated ? "translated" : "emulated");
        Gpu gpu(Options{.validation = false,
                        .spy = false,
                        .quirks = translated ? "vendors,ext" : "vendors",
                        .micromaps = false,
                        .api = Api::Khr});
        const std::vector<const char *> required{"VK_KHR_acceleration_structure", "VK_KHR_deferred_host_operations",
                                                 "VK_KHR_device_address_commands", "VK_KHR_opacity_micromap"};
        for (const Conflicting &one : kConflicting) {
            SCOPED_TRACE(one.extension);
            EXPECT_TRUE(lists(gpu, one.extension));
            ConflictingFeatures alone{static_cast<VkStructureType>(one.features)}, together = alone;
            auto features = vkInit<VkPhysicalDeviceFeatures2>({.pNext = &alone});
            vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
            EXPECT_EQ(alone.first, VkBool32{one.features != 0});
            auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>({.pNext = &together});
            features.pNext = &micromaps;
            vkGetPhysicalDeviceFeatures2(gpu.physical(), &features);
            const bool conflicts = !translated || one.withTranslated;
            EXPECT_EQ(together.first, VkBool32{!conflicts && one.features != 0});
            EXPECT_TRUE(micromaps.micromap);

            EXPECT_EQ(createDevice(gpu, {one.extension}, &alone), VK_SUCCESS);
            std::vector<const char *> both = required;
            both.push_back(one.extension);
            // The features that the query returned, as vkd3d-proton enables them.
            EXPECT_EQ(createDevice(gpu, both, &micromaps) == VK_SUCCESS, !conflicts || one.features != 0);
            warningsOf(gpu);
            micromaps.pNext = &alone;
            EXPECT_EQ(createDevice(gpu, both, &micromaps), conflicts ? VK_ERROR_EXTENSION_NOT_PRESENT : VK_SUCCESS);
            const std::vector<Message> messages = warningsOf(gpu);
            const auto errors = std::ranges::count(messages, "VELLUM-conflicting-extension", &Message::id);
            EXPECT_EQ(errors, conflicts ? 1 : 0);
            for (const Message &m : messages) {
                if (m.id != "VELLUM-conflicting-extension")
                    continue;
                EXPECT_NE(m.text.find(one.extension), std::string::npos) << m.text;
                EXPECT_NE(m.text.find("VK_KHR_opacity_micromap"), std::string::npos) << m.text;
            }
        }
        // Without KHR, a translated device differs only by injected work.
        ConflictingFeatures banks{static_cast<VkStructureType>(1000580001), nullptr, VK_TRUE};
        EXPECT_EQ(createDevice(gpu, {required[0], required[1], required[2], "VK_NV_push_constant_bank"}, &banks),
                  VK_ERROR_EXTENSION_NOT_PRESENT);
        ConflictingFeatures dense{static_cast<VkStructureType>(1000478000), nullptr, VK_TRUE};
        EXPECT_EQ(createDevice(gpu, {required[0], required[1], required[2], "VK_AMDX_dense_geometry_format"}, &dense),
                  translated ? VK_SUCCESS : VK_ERROR_EXTENSION_NOT_PRESENT);
        gpu.takeMessages();
    }
}

// An unknown extension for ray tracing may build structures, or trace rays, by commands that the layer does not
// intercept.
TEST(Driver, UnknownExtensionForRayTracing)
{
    Gpu gpu(Options{.validation = false, .spy = false, .quirks = "vendors", .micromaps = false, .api = Api::Khr});
    constexpr const char *kUnknown = "VK_TEST_ray_tracing_to_come";
    EXPECT_EQ(createDevice(gpu, {kUnknown}, nullptr), VK_SUCCESS);
    EXPECT_EQ(std::ranges::count(warningsOf(gpu), "VELLUM-unknown-extension", &Message::id), 0);
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>({.micromap = VK_TRUE});
    EXPECT_EQ(createDevice(gpu,
                           {"VK_KHR_acceleration_structure", "VK_KHR_deferred_host_operations",
                            "VK_KHR_device_address_commands", "VK_KHR_opacity_micromap", "VK_KHR_ray_query", kUnknown},
                           &micromaps),
              VK_SUCCESS);
    const std::vector<Message> messages = warningsOf(gpu);
    const auto warning = std::ranges::find(messages, "VELLUM-unknown-extension", &Message::id);
    ASSERT_NE(warning, messages.end());
    EXPECT_NE(warning->text.find(kUnknown), std::string::npos) << warning->text;
    EXPECT_EQ(std::ranges::count(messages, "VELLUM-unknown-extension", &Message::id), 1);
}

// The layer rejects a device with a group of physical devices before it calls the driver. On lavapipe, the group has
// one.
TEST(Driver, GroupOfPhysicalDevices)
{
    for (const Api api : {Api::Ext, Api::Khr}) {
        Gpu gpu(Options{.validation = false, .spy = false, .micromaps = false, .api = api});
        const std::array physical{gpu.physical(), gpu.physical()};
        const char *extension =
            api == Api::Ext ? VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME : VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME;
        for (const uint32_t count : {1u, 2u}) {
            auto group = vkInit<VkDeviceGroupDeviceCreateInfo>(
                {.physicalDeviceCount = count, .pPhysicalDevices = physical.data()});
            EXPECT_EQ(createDevice(gpu,
                                   {"VK_KHR_acceleration_structure", "VK_KHR_deferred_host_operations",
                                    "VK_KHR_device_address_commands", extension},
                                   &group),
                      count == 1 ? VK_SUCCESS : VK_ERROR_FEATURE_NOT_PRESENT);
            EXPECT_EQ(std::ranges::count(warningsOf(gpu), "VELLUM-device-features", &Message::id), count == 1 ? 0 : 1);
        }
    }
}

} // namespace
