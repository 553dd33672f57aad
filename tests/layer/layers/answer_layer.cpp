// A layer for the tests, directly above a driver whose GPU is not there (tests/drivers/kernel): commands do nothing, so
// the layer's question whether unused ray flag bits come back (pipelines/ray_flag_probe.h) gets no answer. This layer
// sees it asked, and gives the answer of AMD's GPUs, which is yes.
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#include <dlfcn.h>

#include <array>
#include <cstring>
#include <map>
#include <mutex>
#include <string_view>

namespace
{

std::mutex mutex;
// Looked up at creation: later, the loader's end of the chain may answer with the chain's beginning.
struct InstanceTable {
    VkInstance handle = VK_NULL_HANDLE;
    PFN_vkGetInstanceProcAddr get = nullptr;
};
std::map<void *, InstanceTable> instances;
std::map<void *, std::pair<VkDevice, PFN_vkGetDeviceProcAddr>> devices;

template <class Handle>
void *keyOf(Handle handle)
{
    return *reinterpret_cast<void **>(handle);
}

InstanceTable tableOf(void *key)
{
    std::lock_guard lock(mutex);
    return instances.at(key);
}

template <class Function, class Handle>
Function nextOfDevice(Handle handle, const char *name)
{
    std::lock_guard lock(mutex);
    const auto &[device, get] = devices.at(keyOf(handle));
    return reinterpret_cast<Function>(get(device, name));
}

struct Question { // RayFlagProbePush
    std::uint64_t scene, result;
    std::uint32_t rayFlags;
};
constexpr std::uint32_t kAskedBits = 0x3800;
std::map<VkCommandBuffer, Question> questions;

VKAPI_ATTR void VKAPI_CALL pushConstants(VkCommandBuffer commands, VkPipelineLayout layout, VkShaderStageFlags stages,
                                         std::uint32_t offset, std::uint32_t size, const void *values)
{
    {
        Question question{};
        constexpr std::size_t kBytes = offsetof(Question, rayFlags) + sizeof question.rayFlags;
        std::lock_guard lock(mutex);
        questions.erase(commands);
        if (offset == 0 && size >= kBytes) {
            std::memcpy(&question, values, kBytes);
            if (question.rayFlags == kAskedBits)
                questions[commands] = question;
        }
    }
    nextOfDevice<PFN_vkCmdPushConstants>(commands, "vkCmdPushConstants")(commands, layout, stages, offset, size,
                                                                         values);
}

// By a function of the program's (drivers/kernel/absent_gpu.cpp), since this is the GPU's address.
void answer(VkCommandBuffer commands, const std::array<std::uint32_t, 2> &words)
{
    using Write = bool (*)(std::uint64_t address, const void *bytes, std::size_t size);
    static const auto write = reinterpret_cast<Write>(dlsym(RTLD_DEFAULT, "vellumWriteToAbsentGpu"));
    std::lock_guard lock(mutex);
    const auto found = questions.extract(commands);
    if (found && write != nullptr)
        write(found.mapped().result, words.data(), sizeof words);
}

VKAPI_ATTR void VKAPI_CALL dispatch(VkCommandBuffer commands, std::uint32_t x, std::uint32_t y, std::uint32_t z)
{
    constexpr std::uint32_t kCommittedTriangle = 1;
    if (x * y * z == 1)
        answer(commands, {kAskedBits, kCommittedTriangle});
    nextOfDevice<PFN_vkCmdDispatch>(commands, "vkCmdDispatch")(commands, x, y, z);
}

using Region = VkStridedDeviceAddressRegionKHR;
VKAPI_ATTR void VKAPI_CALL traceRays(VkCommandBuffer commands, const Region *raygen, const Region *miss,
                                     const Region *hit, const Region *callable, std::uint32_t x, std::uint32_t y,
                                     std::uint32_t z)
{
    answer(commands, {kAskedBits, kAskedBits});
    nextOfDevice<PFN_vkCmdTraceRaysKHR>(commands, "vkCmdTraceRaysKHR")(commands, raygen, miss, hit, callable, x, y, z);
}

struct Row {
    std::string_view name;
    PFN_vkVoidFunction function;
};
#define ROW(name, function)                                                                                            \
    Row                                                                                                                \
    {                                                                                                                  \
        name, reinterpret_cast<PFN_vkVoidFunction>(function)                                                           \
    }

PFN_vkVoidFunction deviceFunction(std::string_view name)
{
    static const Row rows[] = {
        ROW("vkCmdPushConstants", pushConstants),
        ROW("vkCmdDispatch", dispatch),
        ROW("vkCmdTraceRaysKHR", traceRays),
    };
    for (const Row &row : rows) {
        if (row.name == name)
            return row.function;
    }
    return nullptr;
}

template <class Link>
Link *linkOf(const void *chain, VkStructureType type)
{
    auto *structure = static_cast<Link *>(const_cast<void *>(chain));
    while (structure != nullptr && !(structure->sType == type && structure->function == VK_LAYER_LINK_INFO))
        structure = static_cast<Link *>(const_cast<void *>(structure->pNext));
    return structure;
}

VKAPI_ATTR VkResult VKAPI_CALL createInstance(const VkInstanceCreateInfo *info, const VkAllocationCallbacks *allocator,
                                              VkInstance *instance)
{
    auto *link = linkOf<VkLayerInstanceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO);
    const PFN_vkGetInstanceProcAddr next = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto createNext = reinterpret_cast<PFN_vkCreateInstance>(next(VK_NULL_HANDLE, "vkCreateInstance"));
    const VkResult result = createNext(info, allocator, instance);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        instances[keyOf(*instance)] = {*instance, next};
    }
    return result;
}

VKAPI_ATTR VkResult VKAPI_CALL createDevice(VkPhysicalDevice physical, const VkDeviceCreateInfo *info,
                                            const VkAllocationCallbacks *allocator, VkDevice *device)
{
    auto *link = linkOf<VkLayerDeviceCreateInfo>(info->pNext, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO);
    const PFN_vkGetDeviceProcAddr next = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
    const PFN_vkGetInstanceProcAddr nextInstance = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
    link->u.pLayerInfo = link->u.pLayerInfo->pNext;
    const auto createNext =
        reinterpret_cast<PFN_vkCreateDevice>(nextInstance(tableOf(keyOf(physical)).handle, "vkCreateDevice"));
    const VkResult result = createNext(physical, info, allocator, device);
    if (result == VK_SUCCESS) {
        std::lock_guard lock(mutex);
        devices[keyOf(*device)] = {*device, next};
    }
    return result;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getDeviceProcAddr(VkDevice device, const char *name)
{
    if (std::string_view(name) == "vkGetDeviceProcAddr")
        return reinterpret_cast<PFN_vkVoidFunction>(getDeviceProcAddr);
    const auto below = nextOfDevice<PFN_vkVoidFunction>(device, name);
    const PFN_vkVoidFunction ours = below != nullptr ? deviceFunction(name) : nullptr;
    return ours != nullptr ? ours : below;
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL getInstanceProcAddr(VkInstance instance, const char *name)
{
    static const Row rows[] = {
        ROW("vkGetInstanceProcAddr", getInstanceProcAddr),
        ROW("vkGetDeviceProcAddr", getDeviceProcAddr),
        ROW("vkCreateInstance", createInstance),
        ROW("vkCreateDevice", createDevice),
    };
    for (const Row &row : rows) {
        if (row.name == name)
            return row.function;
    }
    if (instance == VK_NULL_HANDLE)
        return nullptr;
    const PFN_vkVoidFunction ours = deviceFunction(name);
    return ours != nullptr ? ours : tableOf(keyOf(instance)).get(instance, name);
}

} // namespace

extern "C" __attribute__((visibility("default"))) VKAPI_ATTR VkResult VKAPI_CALL
vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface *version)
{
    version->loaderLayerInterfaceVersion = 2;
    version->pfnGetInstanceProcAddr = getInstanceProcAddr;
    version->pfnGetDeviceProcAddr = getDeviceProcAddr;
    version->pfnGetPhysicalDeviceProcAddr = nullptr;
    return VK_SUCCESS;
}
