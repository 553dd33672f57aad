// SPDX-License-Identifier: Apache-2.0
#include "harness/harness.h"

#include "gpu/arena.h"
#include "gpu/device_selection.h"
#include "gpu/instance.h"

namespace vt
{
namespace
{

constexpr const char *kVellumLayer = "VK_LAYER_VELLUM_opacity_micromap";
constexpr const char *kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr const char *kDriverLayer = "VK_LAYER_VELLUM_test_mock_driver"; // below everything
constexpr const char *kLowerLayer = "VK_LAYER_VELLUM_test_lower"; // below that, with "ext", "khr" and "emulating"
constexpr const char *kFaultyLayer = "VK_LAYER_VELLUM_test_faulty_driver"; // above Vellum's layer
constexpr const char *kForcingLayer = "VK_LAYER_VELLUM_test_forcing";      // above everything, see forcing/forcing.h

// Messages that tests leave alone, and why: most of them the program gets without Vellum's layer, too.
struct FalseAlarm {
    const char *id;
    const char *text; // part of the message
};
constexpr FalseAlarm kFalseAlarms[] = {
    // 1.3.239 takes device extensions newer than itself for unknown instead of leaving them alone.
    {"UNASSIGNED-khronos-validation-createdevice", "is not supported by this layer"},
    // The registry of that version requires it; later ones make it optional for geometry with special indices.
    {"UNASSIGNED-GeneralParameterError-RequiredParameter",
     "VkAccelerationStructureTrianglesOpacityMicromapEXT: required parameter micromap"},
    // 1.4.363 takes the end of a handle's range in its buffer for the handle's size, and asks for whole handles where
    // the rule is about "the range of memory [...] that is accessed by this command".
    {"VUID-VkCopyAccelerationStructureInfoKHR-dst-07791", "memory overlap"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-dstAccelerationStructure-03703",
     "overlaps with dstAccelerationStructure"},
    {"VUID-vkCmdBuildAccelerationStructuresKHR-scratchData-03705", "overlaps with srcAccelerationStructure"},
    // 1.4.363 wants multiples of the format's size also of formats that are not packed.
    {"VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03657", "is not a multiple of"},
    // 1.4.363 does not count the stages of libraries in libraries. What a group names shows in what rays hit.
    {"VUID-VkRayTracingShaderGroupCreateInfoKHR-type-03474", "requires it to be a valid index"},
    {"VUID-VkRayTracingShaderGroupCreateInfoKHR-type-03476", "requires it to be a valid index"},
    {"VUID-VkRayTracingShaderGroupCreateInfoKHR-closestHitShader-03478", "or a valid index"},
    {"VUID-VkRayTracingShaderGroupCreateInfoKHR-anyHitShader-03479", "or a valid index"},
    // Right, of shaders and pipelines that are meant to use no micromaps; ForgottenMicromaps looks at them.
    {"VELLUM-queries-without-micromaps", ""},
    {"VELLUM-pipeline-without-micromaps", ""},
};

#if defined(__SANITIZE_THREAD__) || defined(_WIN32) // no validation layer is available here
constexpr bool kHasValidation = false;
#else
constexpr bool kHasValidation = true;
#endif

// True if the validation layer knows the extensions that Vellum provides and all older ones.
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

// True for devices of a Vulkan 1.1 program, which enables everything newer by extensions: Vulkan11 (entry/).
const auto usesVulkan11 = [] { return std::getenv("VELLUM_TEST_VULKAN") != nullptr; };

// The extensions that a test requests in addition to those of every device.
std::vector<std::string> extensionsOf(const Options &options)
{
    std::vector<std::string> names;
    const auto add = [&names](bool wanted, std::initializer_list<const char *> more) {
        if (wanted)
            names.insert(names.end(), more.begin(), more.end());
    };
    add(!options.absentGpu.empty(), {VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME});
    add(options.debugMarker, {VK_EXT_DEBUG_MARKER_EXTENSION_NAME});
    add(options.maintenance, {VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME});
    add(options.addressCommands, {VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME, VK_EXT_MESH_SHADER_EXTENSION_NAME,
                                  VK_EXT_TRANSFORM_FEEDBACK_EXTENSION_NAME, VK_EXT_ROBUSTNESS_2_EXTENSION_NAME});
    add(options.newer,
        {"VK_KHR_maintenance5", "VK_EXT_descriptor_buffer", "VK_EXT_descriptor_heap", "VK_EXT_device_generated_commands",
         "VK_EXT_shader_module_identifier", "VK_KHR_pipeline_binary", "VK_KHR_ray_tracing_position_fetch",
         "VK_EXT_pipeline_library_group_handles", "VK_KHR_map_memory2"});
    add(options.shaderObject, {"VK_EXT_shader_object"});
    add(options.nullIndexBuffer, {"VK_KHR_maintenance6"});
    return names;
}

// True if the comma-separated list contains the name.
bool includes(const std::string &list, const std::string &name)
{
    return (',' + list + ',').find(',' + name + ',') != std::string::npos;
}

// Before there is a device.
bool testsRunOnLavapipe26()
{
    static const bool is = [] {
        const Instance instance(InstanceOptions{});
        return std::ranges::any_of(listDevices(instance),
                                   [](const DeviceInfo &device) { return vellum::gpu::isLavapipe26(device.handle); });
    }();
    return is;
}

// The quirks of the mock driver, with commas.
std::string quirksOf(const Options &options)
{
    std::string quirks = options.quirks + ',';
    if (const char *chosen = std::getenv("VELLUM_TEST_QUIRKS"))
        quirks += chosen;
    // That quirk is what lavapipe 26 does by itself, and knows the structures of lavapipe 25.
    if (const size_t at = quirks.find("structures"); at != std::string::npos && testsRunOnLavapipe26())
        quirks.erase(at, std::strlen("structures"));
    // A driver with VK_KHR_opacity_micromap knows all that the spy reports.
    if (options.spy && !includes(quirks, "khr"))
        quirks += ",spy";
    return quirks;
}

// The first one is nearest to the application.
std::vector<std::string> layersOf(const Options &options, const std::string &quirks)
{
    std::vector<std::string> layers;
    if (options.vellum)
        layers.emplace_back(kVellumLayer);
    const auto has = [&quirks](const char *name) { return includes(quirks, name); };
    // Old versions pass their own handle of a geometry's VkMicromapEXT on to the driver.
    const bool old = options.oldValidation && !has("ext");
    if (kHasValidation && options.validation && (old || validationIsNew()))
        layers.insert(validationOfTests() == Validation::Above ? layers.begin() : layers.end(), kValidationLayer);
    if (!options.fault.empty())
        layers.insert(layers.begin(), kFaultyLayer);
    if (options.vellum && std::getenv("VELLUM_FORCING") != nullptr)
        layers.insert(layers.begin(), kForcingLayer);
    if (quirks.find_first_not_of(',') != std::string::npos)
        layers.emplace_back(kDriverLayer);
    if (has("ext") || has("khr") || has("emulating"))
        layers.emplace_back(kLowerLayer);
    // The driver must work although no micromaps are requested of it.
    if (has("emulating"))
        setenv("VELLUM_LOWER_ASSUME_MICROMAPS", "1", 1);
    return layers;
}

InstanceOptions instanceOptions(const Options &options, std::function<void(Message)> onMessage)
{
    return {.layers = layersOf(options, quirksOf(options)),
            .apiVersion = usesVulkan11() ? VK_API_VERSION_1_1 : VK_API_VERSION_1_3,
            .onMessage = std::move(onMessage)};
}

DeviceOptions deviceOptions(const Options &options)
{
    const std::string quirks = quirksOf(options);
    const bool ofDriver = includes(quirks, "ext") || includes(quirks, "khr");
    const bool emulated = options.vellum && options.micromaps && options.micromapFeature && !ofDriver;
    // Without the layer, the test is about the driver, and some drivers write all of a handle's range.
    const bool exact = options.memory == Memory::PackedToTheEnd && !options.vellum;
    return {.api = options.api,
            .micromaps = options.micromaps,
            .bothApis = options.bothApis,
            .micromapFeature = options.micromapFeature,
            .hostCommands = options.hostCommands,
            // A driver without the extension does not know the mode.
            .declaresMode = options.vellum && options.micromaps && options.declaresMode,
            .addressReplay = options.addressReplay,
            .allQueueFamilies = options.absentGpu.empty(),
            .addressedStructures = !emulated || validationOfTests() == Validation::Above,
            .extensions = extensionsOf(options),
            .memory = exact ? Memory::Packed : options.memory,
            .onFault = [](const std::string &what) { ADD_FAILURE() << what; }};
}

} // namespace

// The environment variables that the layers read when the instance is created.
class LayerEnvironment
{
public:
    explicit LayerEnvironment(const Options &options)
    {
        if (options.validate)
            setenv("VELLUM_VALIDATE", "all", 0);
        setenv("VELLUM_MESSAGE_LIMIT", "0", 0);
        setenv("VELLUM_TEST_MOCK_DRIVER", quirksOf(options).c_str(), 1);
        setenv("VELLUM_TEST_FAULT", options.fault.c_str(), 1);
    }
    LayerEnvironment(const LayerEnvironment &) = delete;
    LayerEnvironment &operator=(const LayerEnvironment &) = delete;
    ~LayerEnvironment()
    {
        for (const char *name : {"VELLUM_TEST_MOCK_DRIVER", "VELLUM_TEST_FAULT", "VELLUM_LOWER_ASSUME_MICROMAPS"})
            unsetenv(name);
        if (!validates_)
            unsetenv("VELLUM_VALIDATE");
    }

private:
    const bool validates_ = std::getenv("VELLUM_VALIDATE") != nullptr; // set for the whole run
};

Api apiOfTests()
{
    const char *name = std::getenv("VELLUM_TEST_API");
    return name && std::strcmp(name, "khr") == 0 ? Api::Khr : Api::Ext;
}

Memory memoryOfTests()
{
    const char *name = std::getenv("VELLUM_TEST_ARENA");
    if (name == nullptr)
        return Memory::Apart;
    return std::strcmp(name, "exact") == 0 ? Memory::Packed : Memory::PackedToTheEnd;
}

Validation validationOfTests()
{
    const char *name = std::getenv("VELLUM_TEST_VALIDATION");
    return name && std::strcmp(name, "above") == 0 ? Validation::Above : Validation::Below;
}

Messages::~Messages()
{
    for (const Message &m : takeUnexpectedMessages())
        ADD_FAILURE() << "at the end: " << m.id << ": " << m.text;
}

void Messages::add(Message message)
{
    // The tests' intersection shaders cause this one constantly; the copy of the layer below reports it, too.
    if (message.id.ends_with("VELLUM-intersection-ray-flags")) {
        intersectionWarnings_ += message.id.starts_with("VELLUM") ? 1 : 0;
        return;
    }
    const std::lock_guard lock(mutex_);
    messages_.push_back(std::move(message));
}

void Messages::forget()
{
    broken_.clear();
    takeMessages(); // the mock driver reports to the messengers of all instances, also what other tests provoke
}

std::vector<Message> Messages::takeMessages()
{
    const std::lock_guard lock(mutex_);
    return std::exchange(messages_, {});
}

std::vector<Message> Messages::takeUnexpectedMessages()
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
        return std::ranges::any_of(kFalseAlarms, [&m](const FalseAlarm &alarm) {
            return m.id == alarm.id && m.text.find(alarm.text) != std::string::npos;
        });
    });
    return messages;
}

Gpu::Gpu(const Options &options) : Gpu(options, LayerEnvironment(options)) {}

Gpu::Gpu(const Options &options, const LayerEnvironment &)
    : Device(instanceOptions(options, [this](Message m) { add(std::move(m)); }), deviceOptions(options)),
      options_(options)
{
}

void Gpu::reset(const Options &options)
{
    options_ = options;
    use(options.api);
    forget();
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
    void TearDown() override
    {
        for (const auto &[options, gpu] : gpus_)
            gpu->takeMessages(); // caused by tests with devices of their own
        gpus_.clear();
    }

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

} // namespace vt
