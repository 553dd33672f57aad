#include "layer/commands/start_up_commands.h"

#include <vector>

#include "layer/ground/driver.h"

namespace vellum::layer
{

StartUpCommands::~StartUpCommands()
{
    if (pool_)
        driver_.next.DestroyCommandPool(driver_.handle, pool_, nullptr);
}

bool StartUpCommands::chooseQueue(const VkDeviceCreateInfo &info)
{
    const InstanceTable &instance = *driver_.instance;
    uint32_t count = 0;
    instance.GetPhysicalDeviceQueueFamilyProperties(driver_.physicalDevice, &count, nullptr);
    std::vector<VkQueueFamilyProperties> families(count);
    instance.GetPhysicalDeviceQueueFamilyProperties(driver_.physicalDevice, &count, families.data());
    for (uint32_t i = 0; i < info.queueCreateInfoCount; ++i) {
        const VkDeviceQueueCreateInfo &queues = info.pQueueCreateInfos[i];
        const bool isProtected = (queues.flags & VK_DEVICE_QUEUE_CREATE_PROTECTED_BIT) != 0;
        if (!isProtected && queues.queueFamilyIndex < count &&
            (families[queues.queueFamilyIndex].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0) {
            family_ = queues.queueFamilyIndex;
            flags_ = queues.flags;
            return true;
        }
    }
    return false;
}

bool StartUpCommands::begin(PFN_vkSetDeviceLoaderData setLoaderData)
{
    if (!setLoaderData)
        return false;
    const DeviceTable &next = driver_.next;
    const VkDeviceQueueInfo2 queueInfo{VK_STRUCTURE_TYPE_DEVICE_QUEUE_INFO_2, nullptr, flags_, family_, 0};
    next.GetDeviceQueue2(driver_.handle, &queueInfo, &queue_);
    const VkCommandPoolCreateInfo poolInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr, 0, family_};
    if (!queue_ || next.CreateCommandPool(driver_.handle, &poolInfo, nullptr, &pool_) != VK_SUCCESS)
        return false;
    const VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO, nullptr, pool_,
                                           VK_COMMAND_BUFFER_LEVEL_PRIMARY, 1};
    if (next.AllocateCommandBuffers(driver_.handle, &info, &commands_) != VK_SUCCESS)
        return false;
    // Dispatchable objects that a layer makes for itself need the loader's table, which layers below read.
    setLoaderData(driver_.handle, queue_);
    setLoaderData(driver_.handle, commands_);
    VkCommandBufferBeginInfo begin{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
    begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
    return next.BeginCommandBuffer(commands_, &begin) == VK_SUCCESS;
}

bool StartUpCommands::submitAndWait()
{
    VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    info.commandBufferCount = 1;
    info.pCommandBuffers = &commands_;
    return driver_.next.EndCommandBuffer(commands_) == VK_SUCCESS &&
           driver_.next.QueueSubmit(queue_, 1, &info, VK_NULL_HANDLE) == VK_SUCCESS &&
           driver_.next.QueueWaitIdle(queue_) == VK_SUCCESS;
}

} // namespace vellum::layer
