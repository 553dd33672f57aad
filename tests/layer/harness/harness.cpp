// SPDX-License-Identifier: Apache-2.0
#include "harness/harness.h"

#include "harness/arena/arena.h"
#include "harness/execution_mode.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <stdexcept>

namespace vt
{
namespace
{

constexpr const char *kVellumLayer = "VK_LAYER_VELLUM_opacity_micromap";
constexpr const char *kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr const char *kDriverLayer = "VK_LAYER_VELLUM_test_mock_driver"; // below everything
constexpr const char *kLowerLayer = "VK_LAYER_VELLUM_test_lower"; // below that, with the quirks "ext" and "emulating"
constexpr const char *kForcingLayer = "VK_LAYER_VELLUM_test_forcing"; // above everything, see forcing/forcing.h

// Messages that tests leave alone, and why: most of them the program gets without Vellum's layer, too.
struct FalseAlarm {
    const char *id;
    const char *text; // part of the message
};
constexpr std::array<FalseAlarm, 4> kFalseAlarms{{
    // 1.3.239 takes device extensions newer than itself for unknown instead of leaving them alone.
    {"UNASSIGNED-khronos-validation-createdevice", "is not supported by this layer"},
    // So it is in the registry of that age; later ones have it optional, for geometry with special indices only.
    {"UNASSIGNED-GeneralParameterError-RequiredParameter",
     "VkAccelerationStructureTrianglesOpacityMicromapEXT: required parameter micromap"},
    // Right, of shaders and pipelines that are meant to use no micromaps; ForgottenMicromaps looks at them.
    {"VELLUM-queries-without-micromaps", ""},
    {"VELLUM-pipeline-without-micromaps", ""},
}};

#if defined(__SANITIZE_THREAD__) // with which the validation layer is not built
constexpr bool kHasValidation = false;
#else
constexpr bool kHasValidation = true;
#endif

// Whether the validation layer knows the extensions that Vellum provides, and all that came before.
bool validationIsNew()
{
    uint32_t count = 0;
    check(vkEnumerateInstanceLayerProperties(&count, nullptr), "vkEnumerateInstanceLayerProperties");
    std::vector<VkLayerProperties> layers(count);
    check(vkEnumerateInstanceLayerProperties(&count, layers.data()), "vkEnumerateInstanceLayerProperties");
    return std::any_of(layers.begin(), layers.end(), [](const VkLayerProperties &layer) {
        return std::strcmp(layer.layerName, kValidationLayer) == 0 &&
               layer.specVersion >= VK_MAKE_API_VERSION(0, 1, 4, 360);
    });
}

VKAPI_ATTR VkBool32 VKAPI_CALL onMessage(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                         VkDebugUtilsMessageTypeFlagsEXT,
                                         const VkDebugUtilsMessengerCallbackDataEXT *data, void *user)
{
    static_cast<Gpu *>(user)->addMessage(
        {severity, data->pMessageIdName != nullptr ? data->pMessageIdName : "",
         data->pMessage != nullptr ? data->pMessage : "",
         data->objectCount > 0 && data->pObjects[0].pObjectName != nullptr ? data->pObjects[0].pObjectName : ""});
    return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messengerInfo(Gpu *gpu)
{
    return vkInit<VkDebugUtilsMessengerCreateInfoEXT>(
        {.messageSeverity =
             VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT,
         .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_GENERAL_BIT_EXT,
         .pfnUserCallback = onMessage,
         .pUserData = gpu});
}

// Whether what is made now is a program of Vulkan 1.1, which has all that is newer by extensions: Vulkan11 (entry/).
const auto usesVulkan11 = [] { return std::getenv("VELLUM_TEST_VULKAN") != nullptr; };

// Those a test may need; all that the device has are enabled.
constexpr std::array<const char *, 10> kWantedExtensions{
    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
    VK_KHR_RAY_QUERY_EXTENSION_NAME,
    VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME,
    VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME,
    VK_KHR_SYNCHRONIZATION_2_EXTENSION_NAME,
    VK_KHR_PIPELINE_LIBRARY_EXTENSION_NAME,
    VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME,
    VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME,
    VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME,
};

// What came to later versions of Vulkan than 1.1 by these.
constexpr std::array kExtensionsOfVulkan11{VK_KHR_BUFFER_DEVICE_ADDRESS_EXTENSION_NAME,
                                           VK_EXT_DESCRIPTOR_INDEXING_EXTENSION_NAME, VK_KHR_SPIRV_1_4_EXTENSION_NAME,
                                           VK_KHR_SHADER_FLOAT_CONTROLS_EXTENSION_NAME,
                                           VK_EXT_SCALAR_BLOCK_LAYOUT_EXTENSION_NAME};

// A features structure of a few members, for headers that lack it.
struct SomeFeatures {
    VkStructureType sType;
    void *pNext = nullptr;
    std::array<VkBool32, 4> enabled{};
};
struct NewerExtension {
    const char *name;
    uint32_t features; // VkStructureType
    bool Options::*wanted = &Options::newer;
};
constexpr std::array<NewerExtension, 9> kNewerExtensions{{
    {"VK_KHR_maintenance5", 1000470000},
    {"VK_EXT_descriptor_buffer", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DESCRIPTOR_BUFFER_FEATURES_EXT},
    {"VK_EXT_device_generated_commands", 1000572000},
    {"VK_EXT_shader_module_identifier", VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_MODULE_IDENTIFIER_FEATURES_EXT},
    {"VK_KHR_pipeline_binary", 1000483000},
    {"VK_KHR_ray_tracing_position_fetch", 1000481000},
    {"VK_EXT_pipeline_library_group_handles", 1000498000},
    {"VK_EXT_shader_object", 1000482000, &Options::shaderObject},
    {"VK_KHR_maintenance6", 1000545000, &Options::nullIndexBuffer},
}};

} // namespace

void check(VkResult result, const char *what)
{
    if (result != VK_SUCCESS)
        throw std::runtime_error(std::string(what) + ": VkResult " + std::to_string(result));
}

void barrier(VkCommandBuffer commands)
{
    if (usesVulkan11()) {
        const auto old =
            vkInit<VkMemoryBarrier>({.srcAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT,
                                     .dstAccessMask = VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_MEMORY_WRITE_BIT});
        return vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0,
                                    1, &old, 0, nullptr, 0, nullptr);
    }
    auto all = vkInit<VkMemoryBarrier2>();
    all.srcStageMask = all.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT;
    all.srcAccessMask = all.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
    auto dependency = vkInit<VkDependencyInfo>({.memoryBarrierCount = 1, .pMemoryBarriers = &all});
    vkCmdPipelineBarrier2(commands, &dependency);
}

namespace
{

// The devices that tests share, until the last of them has ended.
class SharedGpus : public testing::Environment
{
public:
    std::shared_ptr<Gpu> get(const Options &options)
    {
        for (const auto &[made, gpu] : gpus_) {
            if (made == options)
                return gpu;
        }
        return gpus_.emplace_back(options, std::make_shared<Gpu>(options)).second;
    }
    void forget(const std::shared_ptr<Gpu> &gpu)
    {
        std::erase_if(gpus_, [&gpu](const auto &entry) { return entry.second == gpu; });
    }
    void TearDown() override { gpus_.clear(); }

private:
    std::vector<std::pair<Options, std::shared_ptr<Gpu>>> gpus_;
};

SharedGpus &sharedGpus()
{
    // GoogleTest owns it.
    static auto *gpus = static_cast<SharedGpus *>(testing::AddGlobalTestEnvironment(new SharedGpus));
    return *gpus;
}

} // namespace

GpuTest::GpuTest(const Options &options)
    : gpu_(options.shared ? sharedGpus().get(options) : std::make_shared<Gpu>(options))
{
    if (options.shared)
        gpu_->reset(options);
}

GpuTest::~GpuTest()
{
    if (!gpu_->options().shared)
        return;
    expectNoMessages(); // of objects that the test's members destroyed
    if (HasFailure())
        sharedGpus().forget(gpu_);
}

void GpuTest::TearDown()
{
    expectNoMessages();
    if (gpu_->arena() != nullptr)
        gpu_->arena()->expectIntact("at the end of a test");
}

void Gpu::reset(const Options &options)
{
    const Memory memory = options_.memory;
    options_ = options;
    options_.memory = memory;
    broken_.clear();
    takeMessages(); // the mock driver reports to the messengers of all instances, also what other tests provoke
}

Gpu::Gpu(const Options &options) : options_(options)
{
    createInstance();
    createDevice();
    // Without the layer it is the driver that is looked at, and some write whole handles.
    if (options_.memory == Memory::PackedToTheEnd && !options_.vellum)
        options_.memory = Memory::Packed;
    if (options_.memory != Memory::Apart)
        arena_ = std::make_unique<Arena>(*this);
}

Gpu::~Gpu()
{
    if (device_ != VK_NULL_HANDLE) {
        vkDeviceWaitIdle(device_);
        arena_.reset();
        vkDestroyCommandPool(device_, pool_, nullptr);
        vkDestroyDevice(device_, nullptr);
    }
    if (messenger_ != VK_NULL_HANDLE)
        commands_.DestroyDebugUtilsMessengerEXT(instance_, messenger_, nullptr);
    vkDestroyInstance(instance_, nullptr);
    // What is left alive is reported when its device goes, after the test had its look at the messages.
    for (const Message &m : takeUnexpectedMessages())
        ADD_FAILURE() << "at the end: " << m.id << ": " << m.text;
}

void Gpu::createInstance()
{
    auto application = vkInit<VkApplicationInfo>(
        {.pApplicationName = "vellum tests", .apiVersion = usesVulkan11() ? VK_API_VERSION_1_1 : VK_API_VERSION_1_3});
    std::vector<const char *> layers; // the first one is nearest to the application
    if (options_.vellum)
        layers.push_back(kVellumLayer);
    std::string quirks = options_.spy ? "spy," : "";
    quirks += options_.quirks + ',';
    if (const char *chosen = std::getenv("VELLUM_TEST_QUIRKS"))
        quirks += chosen;
    const auto has = [&quirks](const std::string &name) {
        return (',' + quirks + ',').find(',' + name + ',') != std::string::npos;
    };
    // Of that age, it hands its own handle of a geometry's VkMicromapEXT to the driver.
    const bool old = options_.oldValidation && !has("ext");
    if (kHasValidation && options_.validation && (old || validationIsNew()))
        layers.insert(validationOfTests() == Validation::Above ? layers.begin() : layers.end(), kValidationLayer);
    if (options_.vellum && std::getenv("VELLUM_FORCING") != nullptr)
        layers.insert(layers.begin(), kForcingLayer);
    if (quirks.find_first_not_of(',') != std::string::npos)
        layers.push_back(kDriverLayer);
    if (has("ext") || has("emulating"))
        layers.push_back(kLowerLayer);
    // No micromaps are requested of it, and it must work all the same.
    if (has("emulating"))
        setenv("VELLUM_LOWER_ASSUME_MICROMAPS", "1", 1);
    const std::array extensions{VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_DEBUG_REPORT_EXTENSION_NAME};
    auto info = vkInit<VkInstanceCreateInfo>({.pApplicationInfo = &application,
                                              .enabledLayerCount = static_cast<uint32_t>(layers.size()),
                                              .ppEnabledLayerNames = layers.data(),
                                              .enabledExtensionCount = static_cast<uint32_t>(extensions.size()),
                                              .ppEnabledExtensionNames = extensions.data()});
    if (options_.validate)
        setenv("VELLUM_VALIDATE", "1", 1);
    setenv("VELLUM_TEST_MOCK_DRIVER", quirks.c_str(), 1);
    const VkResult created = vkCreateInstance(&info, nullptr, &instance_);
    for (const char *name : {"VELLUM_TEST_MOCK_DRIVER", "VELLUM_VALIDATE", "VELLUM_LOWER_ASSUME_MICROMAPS"})
        unsetenv(name);
    check(created, "vkCreateInstance");
#define VT_LOAD(name) commands_.name = reinterpret_cast<PFN_vk##name>(vkGetInstanceProcAddr(instance_, "vk" #name));
    VT_INSTANCE_COMMANDS(VT_LOAD)
#undef VT_LOAD
    const VkDebugUtilsMessengerCreateInfoEXT messenger = messengerInfo(this);
    VT_CHECK(commands_.CreateDebugUtilsMessengerEXT(instance_, &messenger, nullptr, &messenger_));
}

Api apiOfTests()
{
    const char *name = std::getenv("VELLUM_TEST_API");
    return name && std::strcmp(name, "khr") == 0 ? Api::Khr : Api::Ext;
}

Validation validationOfTests()
{
    const char *name = std::getenv("VELLUM_TEST_VALIDATION");
    return name && std::strcmp(name, "above") == 0 ? Validation::Above : Validation::Below;
}

void Gpu::createDevice()
{
    uint32_t count = 1;
    const VkResult found = vkEnumeratePhysicalDevices(instance_, &count, &physical_);
    if ((found != VK_SUCCESS && found != VK_INCOMPLETE) || count == 0)
        throw std::runtime_error("no Vulkan device");

    count = 0;
    VT_CHECK(vkEnumerateDeviceExtensionProperties(physical_, nullptr, &count, nullptr));
    std::vector<VkExtensionProperties> present(count);
    VT_CHECK(vkEnumerateDeviceExtensionProperties(physical_, nullptr, &count, present.data()));
    const auto add = [&](const char *name) {
        for (const VkExtensionProperties &p : present) {
            if (std::strcmp(p.extensionName, name) == 0 && !has(name))
                extensions_.emplace_back(name);
        }
    };
    for (const char *name : kWantedExtensions)
        add(name);
    std::ranges::for_each(usesVulkan11() ? std::span(kExtensionsOfVulkan11) : std::span<const char *const>(), add);
    if (options_.micromaps && (options_.api == Api::Ext || options_.bothApis))
        extensions_.emplace_back(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME);
    if (options_.micromaps && (options_.api == Api::Khr || options_.bothApis)) {
        extensions_.emplace_back(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME);
        extensions_.emplace_back(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME);
    }
    if (!options_.absentGpu.empty())
        add(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME);
    if (options_.debugMarker)
        extensions_.emplace_back(VK_EXT_DEBUG_MARKER_EXTENSION_NAME);
    if (options_.maintenance)
        add(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME);
    if (options_.addressCommands) {
        for (const char *name : {VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, VK_EXT_MESH_SHADER_EXTENSION_NAME,
                                 VK_EXT_TRANSFORM_FEEDBACK_EXTENSION_NAME, VK_EXT_ROBUSTNESS_2_EXTENSION_NAME})
            add(name);
    }
    for (const NewerExtension &extension : kNewerExtensions) {
        if (options_.*extension.wanted)
            add(extension.name);
    }
    if (options_.newer)
        add("VK_KHR_map_memory2");

    auto features = vkInit<VkPhysicalDeviceFeatures2>();
    void **tail = &features.pNext;
    const auto chain = [&tail](auto &structure) {
        *tail = &structure;
        tail = &structure.pNext;
    };
    auto vulkan11 = vkInit<VkPhysicalDeviceVulkan11Features>();
    auto vulkan12 = vkInit<VkPhysicalDeviceVulkan12Features>();
    auto vulkan13 = vkInit<VkPhysicalDeviceVulkan13Features>();
    auto structures = vkInit<VkPhysicalDeviceAccelerationStructureFeaturesKHR>();
    auto queries = vkInit<VkPhysicalDeviceRayQueryFeaturesKHR>();
    auto pipelines = vkInit<VkPhysicalDeviceRayTracingPipelineFeaturesKHR>();
    auto conditional = vkInit<VkPhysicalDeviceConditionalRenderingFeaturesEXT>();
    auto libraries = vkInit<VkPhysicalDeviceGraphicsPipelineLibraryFeaturesEXT>();
    auto smallIndices = vkInit<VkPhysicalDeviceIndexTypeUint8FeaturesEXT>();
    auto micromaps = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesEXT>();
    auto micromapsKhr = vkInit<VkPhysicalDeviceOpacityMicromapFeaturesKHR>();
    auto addressCommands = vkInit<VkPhysicalDeviceDeviceAddressCommandsFeaturesKHR>();
    auto maintenance = vkInit<VkPhysicalDeviceRayTracingMaintenance1FeaturesKHR>();
    auto mesh = vkInit<VkPhysicalDeviceMeshShaderFeaturesEXT>();
    auto feedback = vkInit<VkPhysicalDeviceTransformFeedbackFeaturesEXT>();
    auto robustness = vkInit<VkPhysicalDeviceRobustness2FeaturesEXT>();
    auto executables = vkInit<VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR>();
    std::array<SomeFeatures, kNewerExtensions.size()> newer{};
    auto addresses = vkInit<VkPhysicalDeviceBufferDeviceAddressFeatures>();
    auto scalarLayout = vkInit<VkPhysicalDeviceScalarBlockLayoutFeatures>();
    auto synchronization = vkInit<VkPhysicalDeviceSynchronization2Features>();
    if (usesVulkan11()) {
        chain(addresses);
        chain(scalarLayout);
        chain(synchronization);
    } else {
        chain(vulkan11);
        chain(vulkan12);
        chain(vulkan13);
    }
    chain(structures);
    chain(queries);
    if (has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME))
        chain(pipelines);
    if (has(VK_EXT_CONDITIONAL_RENDERING_EXTENSION_NAME))
        chain(conditional);
    if (has(VK_EXT_GRAPHICS_PIPELINE_LIBRARY_EXTENSION_NAME))
        chain(libraries);
    if (has(VK_EXT_INDEX_TYPE_UINT8_EXTENSION_NAME))
        chain(smallIndices);
    if (has(VK_EXT_OPACITY_MICROMAP_EXTENSION_NAME))
        chain(micromaps);
    if (has(VK_KHR_OPACITY_MICROMAP_EXTENSION_NAME))
        chain(micromapsKhr);
    if (has(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME))
        chain(addressCommands);
    if (has(VK_EXT_MESH_SHADER_EXTENSION_NAME))
        chain(mesh);
    if (has(VK_EXT_TRANSFORM_FEEDBACK_EXTENSION_NAME))
        chain(feedback);
    if (has(VK_EXT_ROBUSTNESS_2_EXTENSION_NAME))
        chain(robustness);
    if (has(VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME))
        chain(executables);
    if (has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME))
        chain(maintenance);
    for (size_t i = 0; i < newer.size(); ++i) {
        newer[i].sType = static_cast<VkStructureType>(kNewerExtensions[i].features);
        if (has(kNewerExtensions[i].name))
            chain(newer[i]);
    }
    vkGetPhysicalDeviceFeatures2(physical_, &features);
    vulkan12.bufferDeviceAddressCaptureReplay &= VkBool32{options_.addressReplay};
    if (!options_.micromapFeature)
        micromaps.micromap = micromapsKhr.micromap = VK_FALSE;
    features.features.robustBufferAccess = VK_FALSE;
    robustness.robustBufferAccess2 = VK_FALSE;
    mesh.multiviewMeshShader = mesh.primitiveFragmentShadingRateMeshShader =
        VK_FALSE; // need features that are not enabled
    if (!options_.hostCommands)
        micromaps.micromapHostCommands = VK_FALSE;

    uint32_t families = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &families, nullptr);
    families_.resize(families);
    vkGetPhysicalDeviceQueueFamilyProperties(physical_, &families, families_.data());
    constexpr VkQueueFlags kBoth = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    while (family_ < families - 1 && (families_[family_].queueFlags & kBoth) != kBoth)
        ++family_;
    constexpr std::array<float, 4> priorities{1, 1, 1, 1};
    std::vector<VkDeviceQueueCreateInfo> queues(families);
    for (uint32_t i = 0; i < families; ++i) {
        queues[i] = vkInit<VkDeviceQueueCreateInfo>(
            {.queueFamilyIndex = i,
             .queueCount = i == family_ ? std::min<uint32_t>(families_[i].queueCount, priorities.size()) : 1u,
             .pQueuePriorities = priorities.data()});
    }
    // Of an absent GPU (absentGpu), queues of other kinds are of no use.
    if (!options_.absentGpu.empty())
        queues = {queues[family_]};
    std::vector<const char *> names;
    for (const std::string &name : extensions_)
        names.push_back(name.c_str());
    auto info = vkInit<VkDeviceCreateInfo>({.pNext = &features,
                                            .queueCreateInfoCount = static_cast<uint32_t>(queues.size()),
                                            .pQueueCreateInfos = queues.data(),
                                            .enabledExtensionCount = static_cast<uint32_t>(names.size()),
                                            .ppEnabledExtensionNames = names.data()});
    VT_CHECK(vkCreateDevice(physical_, &info, nullptr, &device_));
#define VT_LOAD(name) commands_.name = reinterpret_cast<PFN_vk##name>(vkGetDeviceProcAddr(device_, "vk" #name));
    VT_DEVICE_COMMANDS(VT_LOAD)
#undef VT_LOAD

    const uint32_t ownQueues = std::min<uint32_t>(families_[family_].queueCount, priorities.size());
    for (uint32_t i = 0; i < ownQueues; ++i)
        vkGetDeviceQueue(device_, family_, i, &queues_.emplace_back());
    queue_ = queues_[0];
    auto pool = vkInit<VkCommandPoolCreateInfo>(
        {.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT, .queueFamilyIndex = family_});
    VT_CHECK(vkCreateCommandPool(device_, &pool, nullptr, &pool_));

    auto limits = vkInit<VkPhysicalDeviceAccelerationStructurePropertiesKHR>();
    pipelineProperties_ = vkInit<VkPhysicalDeviceRayTracingPipelinePropertiesKHR>();
    limits.pNext = &pipelineProperties_;
    auto driver = vkInit<VkPhysicalDeviceDriverProperties>();
    pipelineProperties_.pNext = &driver;
    auto properties = vkInit<VkPhysicalDeviceProperties2>({.pNext = &limits});
    vkGetPhysicalDeviceProperties2(physical_, &properties);
    pipelineProperties_.pNext = nullptr;
    scratchAlignment_ = std::max(limits.minAccelerationStructureScratchOffsetAlignment, 1u);
    lavapipe26_ = driver.driverID == VK_DRIVER_ID_MESA_LLVMPIPE &&
                  properties.properties.driverVersion >= VK_MAKE_API_VERSION(0, 26, 0, 0);
}

VkQueue Gpu::queueOf(uint32_t family) const
{
    VkQueue queue = VK_NULL_HANDLE;
    vkGetDeviceQueue(device_, family, 0, &queue);
    return queue;
}

bool Gpu::has(const char *deviceExtension) const
{
    return std::find(extensions_.begin(), extensions_.end(), deviceExtension) != extensions_.end();
}

VkCommandBuffer Gpu::begin(VkCommandBufferUsageFlags usage, VkCommandBufferLevel level)
{
    auto allocation =
        vkInit<VkCommandBufferAllocateInfo>({.commandPool = pool_, .level = level, .commandBufferCount = 1});
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VT_CHECK(vkAllocateCommandBuffers(device_, &allocation, &commands));
    auto info = vkInit<VkCommandBufferBeginInfo>({.flags = usage});
    auto inheritance = vkInit<VkCommandBufferInheritanceInfo>();
    info.pInheritanceInfo = &inheritance; // ignored for primary ones
    VT_CHECK(vkBeginCommandBuffer(commands, &info));
    return commands;
}

void Gpu::end(VkCommandBuffer commands)
{
    VT_CHECK(vkEndCommandBuffer(commands));
}

void Gpu::execute(VkCommandBuffer commands)
{
    auto submission = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
    VT_CHECK(vkQueueSubmit(queue_, 1, &submission, VK_NULL_HANDLE));
    VT_CHECK(vkQueueWaitIdle(queue_));
}

void Gpu::submit(const std::function<void(VkCommandBuffer)> &record)
{
    VkCommandBuffer commands = begin();
    record(commands);
    end(commands);
    execute(commands);
    vkFreeCommandBuffers(device_, pool_, 1, &commands);
}

std::vector<uint32_t> Gpu::code(std::span<const uint32_t> words) const
{
    // A driver without the extension knows nothing of the mode.
    return khr() && options_.vellum && options_.micromaps && options_.declaresMode
               ? withModeWhereNeeded(words)
               : std::vector<uint32_t>(words.begin(), words.end());
}

VkShaderModule Gpu::shader(std::span<const uint32_t> original) const
{
    const std::vector<uint32_t> words = code(original);
    auto info = vkInit<VkShaderModuleCreateInfo>({.codeSize = words.size() * sizeof(uint32_t), .pCode = words.data()});
    VkShaderModule module = VK_NULL_HANDLE;
    VT_CHECK(vkCreateShaderModule(device_, &info, nullptr, &module));
    return module;
}

void Gpu::addMessage(Message message)
{
    // What the tests' intersection shaders do all the time; the copy of the layer below reports it, too.
    if (message.id.ends_with("VELLUM-intersection-ray-flags")) {
        intersectionWarnings_ += message.id.starts_with("VELLUM") ? 1 : 0;
        return;
    }
    const std::lock_guard lock(messagesMutex_);
    messages_.push_back(std::move(message));
}

std::vector<Message> Gpu::takeMessages()
{
    const std::lock_guard lock(messagesMutex_);
    return std::exchange(messages_, {});
}

std::vector<Message> Gpu::takeUnexpectedMessages()
{
    std::vector<Message> messages = takeMessages();
    if (validationOfTests() == Validation::Above &&
        std::any_of(messages.begin(), messages.end(), [](const Message &m) { return m.fromVellum(); }))
        std::erase_if(messages, [](const Message &m) { return !m.fromVellum() && m.id != "SPY"; });
    std::erase_if(messages, [this](const Message &m) {
        return validationOfTests() == Validation::Above &&
               std::find(broken_.begin(), broken_.end(), m.id) != broken_.end();
    });
    std::erase_if(messages, [](const Message &m) {
        return std::any_of(kFalseAlarms.begin(), kFalseAlarms.end(), [&m](const FalseAlarm &alarm) {
            return m.id == alarm.id && m.text.find(alarm.text) != std::string::npos;
        });
    });
    return messages;
}

} // namespace vt
