// SPDX-License-Identifier: Apache-2.0
// Validation's state of the application's objects, above an implementation that does nothing: what it keeps after
// failures, what it releases, and what commands cost.
#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <new>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#include <dlfcn.h>
#define COUNTS_LOCKS
#endif

#include "allocations.h"
#include "layer/validation/commands.h"
#include "layer/validation/ranges/ranges.h"
#include "layer/validation/traces/traced_code.h"
#include "memory_device.h"

#if defined(COUNTS_LOCKS)
namespace
{

thread_local long locksTaken = 0;

} // namespace

extern "C" int pthread_mutex_lock(pthread_mutex_t *mutex)
{
    static const auto next = reinterpret_cast<int (*)(pthread_mutex_t *)>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
    ++locksTaken;
    return next(mutex);
}
extern "C" int pthread_rwlock_rdlock(pthread_rwlock_t *lock)
{
    static const auto next = reinterpret_cast<int (*)(pthread_rwlock_t *)>(dlsym(RTLD_NEXT, "pthread_rwlock_rdlock"));
    ++locksTaken;
    return next(lock);
}
#endif

namespace vellum::layer
{
namespace
{

template <typename Handle>
Handle handle(uint64_t number)
{
    return reinterpret_cast<Handle>(number);
}

VkResult answer = VK_SUCCESS; // of the implementation
int64_t made = 0;             // objects that exist in it

// The command that creates one object, or `count`.
template <typename Handle, typename Info>
VKAPI_ATTR VkResult VKAPI_CALL create(VkDevice, const Info *, const VkAllocationCallbacks *, Handle *object)
{
    static uint64_t number = 0x1000;
    *object = handle<Handle>(number += 16);
    ++made;
    return VK_SUCCESS;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateCommandBuffers(VkDevice, const VkCommandBufferAllocateInfo *info,
                                                      VkCommandBuffer *buffers)
{
    static uint64_t number = 0x1000000;
    for (uint32_t i = 0; i < info->commandBufferCount; ++i)
        buffers[i] = handle<VkCommandBuffer>(number += 16);
    made += info->commandBufferCount;
    return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL freeCommandBuffers(VkDevice, VkCommandPool, uint32_t count, const VkCommandBuffer *)
{
    made -= count;
}

VKAPI_ATTR VkResult VKAPI_CALL allocateDescriptorSets(VkDevice, const VkDescriptorSetAllocateInfo *info,
                                                      VkDescriptorSet *sets)
{
    for (uint32_t i = 0; i < info->descriptorSetCount; ++i)
        sets[i] = handle<VkDescriptorSet>(0x5000 + i);
    made += info->descriptorSetCount;
    return VK_SUCCESS;
}

// Validation of a device whose implementation does nothing.
class ValidationState : public testing::Test
{
protected:
    ValidationState()
    {
        answer = VK_SUCCESS;
        made = 0;
        device.driver.reporter = &reporter_;
        device.driver.settings = &settings_;
        device.checks.core = device.checks.sync = true;
        device.next.CreateCommandPool = create<VkCommandPool>;
        device.next.DestroyCommandPool = [](VkDevice, VkCommandPool, const VkAllocationCallbacks *) {};
        device.driver.next.DestroyCommandPool = device.next.DestroyCommandPool;
        device.driver.next.AllocateCommandBuffers = allocateCommandBuffers;
        device.driver.next.FreeCommandBuffers = freeCommandBuffers;
        device.driver.next.ResetCommandPool = [](VkDevice, VkCommandPool, VkCommandPoolResetFlags) { return answer; };
        device.next.QueueSubmit = [](VkQueue, uint32_t, const VkSubmitInfo *, VkFence) { return answer; };
        device.next.QueueSubmit2 = [](VkQueue, uint32_t, const VkSubmitInfo2 *, VkFence) { return answer; };
        device.next.QueueBindSparse = [](VkQueue, uint32_t, const VkBindSparseInfo *, VkFence) { return answer; };
        VkDebugUtilsMessengerCreateInfoEXT messenger{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
        messenger.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
        messenger.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
        messenger.pUserData = this;
        messenger.pfnUserCallback = [](VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                       const VkDebugUtilsMessengerCallbackDataEXT *data, void *user) -> VkBool32 {
            ++static_cast<ValidationState *>(user)->reported[data->pMessageIdName];
            return VK_FALSE;
        };
        reporter_.addMessenger(handle<VkDebugUtilsMessengerEXT>(1), messenger);
    }

    VkCommandPool makePool()
    {
        const VkCommandPoolCreateInfo info{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
        VkCommandPool pool{};
        EXPECT_EQ(validation::createCommandPool(device, {}, &info, nullptr, &pool), VK_SUCCESS);
        return pool;
    }
    std::vector<VkCommandBuffer> allocate(VkCommandPool pool, uint32_t count)
    {
        VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
        info.commandPool = pool;
        info.commandBufferCount = count;
        std::vector<VkCommandBuffer> buffers(count);
        EXPECT_EQ(validation::allocateCommandBuffers(device, {}, &info, buffers.data()), VK_SUCCESS);
        return buffers;
    }
    VkBuffer addBuffer(VkDeviceAddress address, VkDeviceSize size)
    {
        auto buffer = std::make_shared<ValidatedBuffer>();
        buffer->handle = handle<VkBuffer>(address);
        buffer->size = size;
        buffer->usage = ~VkFlags64{0};
        device.objects.buffers.set(buffer->buffer(), buffer);
        device.buffers.addresses.add(address, buffer->buffer(), size, buffer->usage);
        return buffer->buffer();
    }

public:
    std::map<std::string, int> reported; // messages by id

private:
    Settings settings_;
    Reporter reporter_;

protected:
    DeviceValidation device;
};

// ------------------------------------------------------------------------------------------ submissions

TEST_F(ValidationState, FailedSubmissionsExecuteNothing)
{
    const VkCommandBuffer commands = allocate(makePool(), 1).front();
    int executed = 0;
    device.logs.add(commands, [&](const Submission &) { ++executed; });
    VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    submit.commandBufferCount = 1;
    submit.pCommandBuffers = &commands;
    VkCommandBufferSubmitInfo one{VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO};
    one.commandBuffer = commands;
    VkSubmitInfo2 submit2{VK_STRUCTURE_TYPE_SUBMIT_INFO_2};
    submit2.commandBufferInfoCount = 1;
    submit2.pCommandBufferInfos = &one;
    for (const VkResult result : {VK_ERROR_OUT_OF_HOST_MEMORY, VK_ERROR_OUT_OF_DEVICE_MEMORY, VK_ERROR_DEVICE_LOST}) {
        answer = result;
        EXPECT_EQ(validation::queueSubmit(device, {}, 1, &submit, {}), result);
        EXPECT_EQ(validation::queueSubmit2(device, {}, 1, &submit2, {}), result);
        EXPECT_EQ(executed, 0);
    }
    answer = VK_SUCCESS;
    EXPECT_EQ(validation::queueSubmit(device, {}, 1, &submit, {}), VK_SUCCESS);
    EXPECT_EQ(validation::queueSubmit2(device, {}, 1, &submit2, {}), VK_SUCCESS);
    EXPECT_EQ(executed, 2);
}

// Another thread may find out that work is complete, and reset or free its command buffers, before vkQueueSubmit
// returns.
TEST_F(ValidationState, SubmissionsOutliveTheirCommandBuffers)
{
    static DeviceValidation *used;
    static VkCommandPool pool;
    used = &device;
    int executed = 0;
    const auto submitNew = [&] {
        pool = makePool();
        const std::vector<VkCommandBuffer> commands = allocate(pool, 2);
        for (const VkCommandBuffer each : commands)
            device.logs.add(each, [&](const Submission &) { ++executed; });
        validation::cmdExecuteCommands(device, commands[0], 1, &commands[1]);
        VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        submit.commandBufferCount = 1;
        submit.pCommandBuffers = commands.data();
        EXPECT_EQ(validation::queueSubmit(device, {}, 1, &submit, {}), VK_SUCCESS);
    };
    device.driver.next.CmdExecuteCommands = [](VkCommandBuffer, uint32_t, const VkCommandBuffer *) {};
    device.next.QueueSubmit = [](VkQueue, uint32_t, const VkSubmitInfo *, VkFence) {
        return validation::resetCommandPool(*used, {}, pool, 0);
    };
    submitNew();
    EXPECT_EQ(executed, 2);
    device.next.QueueSubmit = [](VkQueue, uint32_t, const VkSubmitInfo *, VkFence) {
        validation::destroyCommandPool(*used, {}, pool, nullptr);
        return VK_SUCCESS;
    };
    submitNew();
    EXPECT_EQ(executed, 4);
}

TEST_F(ValidationState, PendingUsesAreReportedUnlessTheHostMayKnowMore)
{
    device.next.CreateQueryPool = create<VkQueryPool>;
    device.next.DestroyQueryPool = [](VkDevice, VkQueryPool, const VkAllocationCallbacks *) {};
    device.next.CmdResetQueryPool = [](VkCommandBuffer, VkQueryPool, uint32_t, uint32_t) {};
    const VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    device.next.QueueWaitIdle = [](VkQueue) { return VK_ERROR_DEVICE_LOST; };
    device.next.GetQueryPoolResults = [](VkDevice, VkQueryPool, uint32_t, uint32_t, size_t, void *, VkDeviceSize,
                                         VkQueryResultFlags) { return VK_NOT_READY; };
    enum class Known { Elsewhere, Lost, Availability, Pending };
    for (const Known known : {Known::Elsewhere, Known::Lost, Known::Availability, Known::Pending}) {
        device.facts.waitsElsewhere = known == Known::Elsewhere;
        const VkCommandBuffer commands = allocate(makePool(), 1).front();
        VkQueryPool pool{};
        ASSERT_EQ(validation::createQueryPool(device, {}, &info, nullptr, &pool), VK_SUCCESS);
        validation::cmdResetQueryPool(device, commands, pool, 0, 1);
        VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
        submit.commandBufferCount = 1;
        submit.pCommandBuffers = &commands;
        EXPECT_EQ(validation::queueSubmit(device, {}, 1, &submit, {}), VK_SUCCESS);
        if (known == Known::Lost) {
            EXPECT_EQ(validation::queueWaitIdle(device, {}), VK_ERROR_DEVICE_LOST);
        }
        const VkQueryResultFlags flags = known == Known::Availability ? VK_QUERY_RESULT_WITH_AVAILABILITY_BIT : 0;
        EXPECT_EQ(validation::getQueryPoolResults(device, {}, pool, 0, 1, 0, nullptr, 0, flags), VK_NOT_READY);
        validation::destroyQueryPool(device, {}, pool, nullptr);
        EXPECT_EQ(reported["VELLUM-VUID-vkDestroyQueryPool-queryPool-00793"], known == Known::Pending ? 1 : 0);
    }
}

// After an allocation failure, a device treats an unknown handle as possibly valid; other devices still know all of
// their objects.
TEST_F(ValidationState, WithoutMemoryOnlyThatDeviceForgets)
{
    DeviceValidation other;
    remember(other.objects, [] { throw std::bad_alloc(); });
    const ObjectHandle unknown(handle<VkAccelerationStructureKHR>(0x10));
    EXPECT_TRUE(other.factsOf(unknown).exists);
    EXPECT_FALSE(device.factsOf(unknown).exists);
}

TEST_F(ValidationState, FailedResetsAndBindingsChangeNothing)
{
    const VkCommandPool pool = makePool();
    const VkCommandBuffer commands = allocate(pool, 1).front();
    device.logs.add(commands, [](const Submission &) {});
    answer = VK_ERROR_OUT_OF_DEVICE_MEMORY;
    EXPECT_EQ(validation::resetCommandPool(device, {}, pool, 0), answer);
    EXPECT_EQ(device.logs.get(commands)->steps->effects.size(), 1u);

    const VkBuffer buffer = addBuffer(0x10000, 0x10000);
    VkSparseMemoryBind bind{};
    bind.size = 0x10000;
    bind.memory = handle<VkDeviceMemory>(1);
    const VkSparseBufferMemoryBindInfo bufferBind{buffer, 1, &bind};
    VkBindSparseInfo sparse{VK_STRUCTURE_TYPE_BIND_SPARSE_INFO};
    sparse.bufferBindCount = 1;
    sparse.pBufferBinds = &bufferBind;
    EXPECT_EQ(validation::queueBindSparse(device, {}, 1, &sparse, {}), answer);
    EXPECT_FALSE(device.objects.buffers.get(buffer)->bound.contain(0, 0x10000));
    answer = VK_SUCCESS;
    EXPECT_EQ(validation::queueBindSparse(device, {}, 1, &sparse, {}), VK_SUCCESS);
    EXPECT_TRUE(device.objects.buffers.get(buffer)->bound.contain(0, 0x10000));
    EXPECT_EQ(validation::resetCommandPool(device, {}, pool, 0), VK_SUCCESS);
    EXPECT_TRUE(device.logs.get(commands)->steps->effects.empty());
}

// A wait for an event has nothing to do with what set another event of the same handle, or this one before the host
// did.
// A submission that blocks in the driver until another thread signals it.
class BlockingSubmission : public ValidationState
{
protected:
    BlockingSubmission()
    {
        blocking = this;
        device.next.QueueSubmit = [](VkQueue queue, uint32_t, const VkSubmitInfo *, VkFence) {
            if (queue != handle<VkQueue>(1))
                return VK_SUCCESS;
            blocking->begun_.set_value();
            blocking->wasSignaled =
                blocking->signal_.get_future().wait_for(std::chrono::seconds(10)) == std::future_status::ready;
            return VK_SUCCESS;
        };
        device.next.WaitSemaphores = [](VkDevice, const VkSemaphoreWaitInfo *, uint64_t) { return VK_SUCCESS; };
        device.next.SignalSemaphore = [](VkDevice, const VkSemaphoreSignalInfo *) {
            blocking->signal_.set_value();
            return VK_SUCCESS;
        };
    }
    // Submits to the queue in whose submissions the driver blocks.
    std::thread submit(const VkSubmitInfo &info)
    {
        std::thread thread([this, &info] { validation::queueSubmit(device, handle<VkQueue>(1), 1, &info, {}); });
        begun_.get_future().wait();
        return thread;
    }
    void signal()
    {
        const VkSemaphoreSignalInfo info{VK_STRUCTURE_TYPE_SEMAPHORE_SIGNAL_INFO, nullptr, handle<VkSemaphore>(2), 1};
        validation::signalSemaphore(device, {}, &info);
    }

    std::atomic<bool> wasSignaled = false;

private:
    static inline BlockingSubmission *blocking = nullptr;
    std::promise<void> begun_, signal_;
};

TEST_F(BlockingSubmission, LetsOthersWaitAndSignal)
{
    const VkSubmitInfo info{VK_STRUCTURE_TYPE_SUBMIT_INFO};
    std::thread thread = submit(info);
    const auto semaphore = handle<VkSemaphore>(3);
    const uint64_t value = 1;
    VkSemaphoreWaitInfo wait{VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO};
    wait.semaphoreCount = 1;
    wait.pSemaphores = &semaphore;
    wait.pValues = &value;
    EXPECT_EQ(validation::waitSemaphores(device, {}, &wait, 0), VK_SUCCESS);
    signal();
    thread.join();
    EXPECT_TRUE(wasSignaled);
}

// Submissions that overtake each other have no known order.
TEST_F(BlockingSubmission, NotOrderedWithOvertakingSubmissions)
{
    const std::vector<VkCommandBuffer> buffers = allocate(makePool(), 3);
    std::map<VkCommandBuffer, bool> ordered;
    std::vector<VkSubmitInfo> infos(3, VkSubmitInfo{VK_STRUCTURE_TYPE_SUBMIT_INFO});
    for (size_t i = 0; i < 3; ++i) {
        infos[i].commandBufferCount = 1;
        infos[i].pCommandBuffers = &buffers[i];
        device.logs.add(buffers[i], [&ordered, buffer = buffers[i]](const Submission &submission) {
            ordered[buffer] = submission.ordered;
        });
    }
    std::thread thread = submit(infos[0]);
    validation::queueSubmit(device, handle<VkQueue>(2), 1, &infos[1], {});
    signal();
    thread.join();
    validation::queueSubmit(device, handle<VkQueue>(2), 1, &infos[2], {});
    EXPECT_TRUE(wasSignaled);
    EXPECT_EQ(ordered, (std::map<VkCommandBuffer, bool>{{buffers[0], false}, {buffers[1], false}, {buffers[2], true}}));
}

TEST_F(ValidationState, EventsAreForgotten)
{
    device.next.SetEvent = [](VkDevice, VkEvent) { return answer; };
    device.next.ResetEvent = [](VkDevice, VkEvent) { return answer; };
    device.next.DestroyEvent = [](VkDevice, VkEvent, const VkAllocationCallbacks *) {};
    const auto event = handle<VkEvent>(0x10);
    const sync::Scope write{VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
                            VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR};
    uint64_t memory = 0;
    const auto hazards = [&](const auto &change) {
        sync::Tracker &tracker = device.sync.tracker;
        sync::Access access;
        access.range = {++memory, 0, 64};
        access.scope = write;
        access.writes = true;
        tracker.beginBatch(1, 0, {});
        tracker.setEvent(1, 0x10);
        tracker.access(1, {&access, 1});
        change();
        const sync::Barrier barrier{write, write, {}};
        tracker.waitEvent(1, 0x10, {&barrier, 1});
        return tracker.access(1, {&access, 1}).size();
    };
    EXPECT_EQ(hazards([] {}), 1u);
    EXPECT_EQ(hazards([&] { validation::destroyEvent(device, {}, event, nullptr); }), 0u);
    EXPECT_EQ(hazards([&] { validation::setEvent(device, {}, event); }), 0u);
    EXPECT_EQ(hazards([&] { validation::resetEvent(device, {}, event); }), 0u);
}

// ------------------------------------------------------------------------------------------ what commands cost

// The command buffers of one pool are not searched for among all others, which would take minutes.
TEST_F(ValidationState, ManyCommandBuffersComeAndGo)
{
    const VkCommandPool pool = makePool(), other = makePool();
    const auto buffers = allocate(pool, 200'000);
    for (const VkCommandBuffer buffer : buffers)
        validation::freeCommandBuffers(device, {}, pool, 1, &buffer);
    EXPECT_FALSE(device.logs.get(buffers.back()));
    static_cast<void>(allocate(other, 100'000));
    std::vector<VkCommandBuffer> own;
    for (int i = 0; i < 2000; ++i) {
        const VkCommandPool one = makePool();
        own = allocate(one, 2);
        EXPECT_EQ(validation::resetCommandPool(device, {}, one, 0), VK_SUCCESS);
        validation::destroyCommandPool(device, {}, one, nullptr);
    }
    EXPECT_FALSE(device.logs.get(own.front()));
    validation::destroyCommandPool(device, {}, other, nullptr);
}

#if defined(COUNTS_LOCKS)
// Without the checks of the GPU, frequent commands take no lock.
TEST_F(ValidationState, DrawsTakeNoLock)
{
    const VkCommandBuffer commands = allocate(makePool(), 1).front();
    device.checks = {.core = true};
    device.next.CmdDraw = [](VkCommandBuffer, uint32_t, uint32_t, uint32_t, uint32_t) {};
    device.next.CmdDispatch = [](VkCommandBuffer, uint32_t, uint32_t, uint32_t) {};
    device.next.CmdBindDescriptorSets = [](VkCommandBuffer, VkPipelineBindPoint, VkPipelineLayout, uint32_t, uint32_t,
                                           const VkDescriptorSet *, uint32_t, const uint32_t *) {};
    device.next.UpdateDescriptorSets = [](VkDevice, uint32_t, const VkWriteDescriptorSet *, uint32_t,
                                          const VkCopyDescriptorSet *) {};
    const auto set = handle<VkDescriptorSet>(0x100);
    const long before = locksTaken;
    validation::cmdDraw(device, commands, 3, 1, 0, 0);
    validation::cmdDispatch(device, commands, 1, 1, 1);
    validation::cmdBindDescriptorSets(device, commands, VK_PIPELINE_BIND_POINT_GRAPHICS, {}, 0, 1, &set, 0, nullptr);
    validation::updateDescriptorSets(device, {}, 0, nullptr, 0, nullptr);
    EXPECT_EQ(locksTaken - before, 0);
}
#endif

// ------------------------------------------------------------------------------------------ released marks

// Marks of destroyed shaders are used again; those that rays may still have set are not before that is reported.
TEST_F(ValidationState, MarksAreGivenBack)
{
    const test::MemoryDevice memory;
    TraceMarks marks;
    for (int i = 0; i < 200'000; ++i)
        ASSERT_TRUE(marks.add(memory.context(), kRuleMode)) << i;
    std::vector<std::shared_ptr<const TraceMark>> all;
    while (auto mark = marks.add(memory.context(), kRuleMode))
        all.push_back(std::move(mark));
    EXPECT_EQ(all.size(), 65536u);
    const uint32_t used = all[7]->index();
    marks.use(used, {});
    all.erase(all.begin() + 7);
    // The only mark is that of the destroyed shader.
    const auto again = marks.add(memory.context(), kRuleMode);
    ASSERT_TRUE(again);
    EXPECT_EQ(again->index(), used);
    EXPECT_FALSE(marks.add(memory.context(), kRuleMode));
}

// A report looks at the sites that were used since the device was idle.
TEST_F(ValidationState, ReportsLookAtUsedSites)
{
    const test::MemoryDevice memory;
    TraceMarks marks;
    std::vector<std::shared_ptr<const TraceMark>> all;
    for (int i = 0; i < 1000; ++i)
        all.push_back(marks.add(memory.context(), kRuleMode));
    EXPECT_EQ(marks.report(device, false), 0u);
    for (const size_t i : {3u, 5u, 5u, 900u})
        marks.use(all[i]->index(), {});
    EXPECT_EQ(marks.report(device, false), 3u);
    all[5].reset();
    EXPECT_EQ(marks.report(device, false), 3u);
    EXPECT_EQ(marks.report(device, false), 2u) << "nothing becomes certain about a destroyed shader";
    EXPECT_EQ(marks.report(device, true), 2u);
    EXPECT_EQ(marks.report(device, false), 0u);
}

// Structures that come and go at ever other addresses, as shaders find them.
class References : public ValidationState
{
protected:
    References() { EXPECT_EQ(records.create(memory.context()), VK_SUCCESS); }
    // Finds the record in the same way as shaders/validation/instance_check.comp.
    [[nodiscard]] uint32_t recordOf(VkDeviceAddress reference) const
    {
        const auto *table = reinterpret_cast<const uint32_t *>(records.references());
        const auto low = static_cast<uint32_t>(reference), high = static_cast<uint32_t>(reference >> 32);
        uint32_t bucket = shared::referenceBucket(low, high);
        for (uint32_t probe = 0; probe < shared::kReferenceProbes; ++probe) {
            const uint32_t *words = table + size_t{bucket} * shared::kReferenceBucketWords;
            if (words[0] == low && words[1] == high)
                return words[2];
            if (words[0] == 0 && words[1] == 0)
                break;
            bucket = (bucket + 1) & ((1u << shared::kReferenceBucketsLog2) - 1);
        }
        return 0;
    }

    test::MemoryDevice memory;
    StructureRecords records;
};

TEST_F(References, DestroyedStructuresReleaseTheirs)
{
    std::mt19937_64 random(3);
    std::map<VkDeviceAddress, std::shared_ptr<StructureRecords::Owner>> alive;
    for (int i = 0; i < 100'000; ++i) {
        const VkDeviceAddress address = (random() >> 24) << 8;
        auto owner = records.take();
        ASSERT_TRUE(owner);
        records.setReference(address, *owner);
        ASSERT_EQ(recordOf(address), owner->index()) << i;
        alive[address] = std::move(owner);
        if (alive.size() > 1000) {
            const auto removed = alive.lower_bound((random() >> 24) << 8);
            const auto one = removed == alive.end() ? alive.begin() : removed;
            const VkDeviceAddress old = one->first;
            alive.erase(one);
            ASSERT_EQ(recordOf(old), 0u);
        }
    }
    for (const auto &[address, owner] : alive)
        EXPECT_EQ(recordOf(address), owner->index());
}

// While two structures have an address it is unknown which of them is meant.
TEST_F(References, SharedByTwoStructuresAreUnknown)
{
    auto one = records.take(), two = records.take();
    records.setReference(0x1000, *one);
    records.setReference(0x1000, *one);
    EXPECT_EQ(recordOf(0x1000), one->index());
    records.setReference(0x1000, *two);
    EXPECT_EQ(recordOf(0x1000), 0u);
    one.reset();
    EXPECT_EQ(recordOf(0x1000), 0u);
    two.reset();
    one = records.take();
    records.setReference(0x1000, *one);
    EXPECT_EQ(recordOf(0x1000), one->index());
    records.removeReference(*one); // destroyed, while something keeps the record
    two = records.take();
    records.setReference(0x1000, *two);
    EXPECT_EQ(recordOf(0x1000), two->index());
}

TEST_F(ValidationState, StructuresByAddressForgetDestroyedOnes)
{
    StructuresByAddress structures;
    const auto kept = std::make_shared<ValidatedStructure>();
    structures.add(1, kept);
    for (VkDeviceAddress i = 2; i < 10'000; ++i)
        structures.add(i, std::make_shared<ValidatedStructure>());
    EXPECT_LT(structures.entries(), 200u);
    int found = 0;
    structures.visit(1, [&](const auto &structure) { found += structure == kept; });
    EXPECT_EQ(found, 1);
}

// ------------------------------------------------------------------------------------------ wrong input

// Between two look-ups another thread destroys a buffer that the range happens to be in.
// A command buffer keeps what it refers to; the implementation gives the handle to another buffer.
TEST_F(ValidationState, FreedMemoryHidesNoBufferThatHasTheHandleOfADestroyedOne)
{
    device.next.BindBufferMemory = [](VkDevice, VkBuffer, VkDeviceMemory, VkDeviceSize) { return VK_SUCCESS; };
    device.next.AllocateMemory = create<VkDeviceMemory>;
    device.next.FreeMemory = [](VkDevice, VkDeviceMemory, const VkAllocationCallbacks *) {};
    device.next.DestroyBuffer = [](VkDevice, VkBuffer, const VkAllocationCallbacks *) {};
    const VkMemoryAllocateInfo info{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO};
    VkDeviceMemory memory{};
    ASSERT_EQ(validation::allocateMemory(device, {}, &info, nullptr, &memory), VK_SUCCESS);
    constexpr VkDeviceAddress kAddress = 0x10000;
    const VkBuffer buffer = addBuffer(kAddress, 256);
    const auto kept = device.objects.buffers.get(buffer);
    device.objects.memories.get(memory).buffers->add(kept);
    validation::destroyBuffer(device, {}, buffer, nullptr);
    ASSERT_EQ(addBuffer(kAddress, 256), buffer);
    validation::freeMemory(device, {}, memory, nullptr);
    EXPECT_EQ(device.buffers.addresses.find(kAddress).buffer, buffer);
}

TEST_F(ValidationState, RangeInABufferThatIsDestroyed)
{
    const auto buffer = handle<VkBuffer>(0x10000);
    device.buffers.addresses.add(0x10000, buffer, 4096, VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const Place place("vkCmdCopyMemoryKHR");
    RangeCheck(device, VK_NULL_HANDLE, place.command())
        .check(place, VkDeviceAddressRangeKHR{0x10000, 64}, 0, flagged::kCopySource,
               {.usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT, .usageId = "VUID-of-the-usage"});
    EXPECT_EQ(reported["VELLUM-VUID-of-the-usage"], 0);
}

TEST_F(ValidationState, BuildsWithNullArrays)
{
    const VkCommandBuffer commands = allocate(makePool(), 1).front();
    device.next.CmdBuildAccelerationStructuresIndirectKHR =
        [](VkCommandBuffer, uint32_t, const VkAccelerationStructureBuildGeometryInfoKHR *, const VkDeviceAddress *,
           const uint32_t *, const uint32_t *const *) {};
    device.next.GetAccelerationStructureBuildSizesKHR =
        [](VkDevice, VkAccelerationStructureBuildTypeKHR, const VkAccelerationStructureBuildGeometryInfoKHR *,
           const uint32_t *, VkAccelerationStructureBuildSizesInfoKHR *) {};
    device.next.CmdBuildMicromapsEXT = [](VkCommandBuffer, uint32_t, const VkMicromapBuildInfoEXT *) {};
    VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
    geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
    VkAccelerationStructureBuildGeometryInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    info.geometryCount = 1;
    info.pGeometries = &geometry;
    const VkDeviceAddress address = 0x1000;
    const uint32_t stride = 16;
    const uint32_t *none = nullptr;
    validation::cmdBuildAccelerationStructuresIndirect(device, commands, 1, &info, nullptr, nullptr, nullptr);
    validation::cmdBuildAccelerationStructuresIndirect(device, commands, 1, &info, &address, &stride, &none);
    EXPECT_EQ(input::BuildRanges{}.primitives(0), 0u);

    VkMicromapBuildInfoEXT micromap{VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT};
    const VkMicromapUsageEXT *usage = nullptr;
    micromap.usageCountsCount = 1;
    micromap.ppUsageCounts = &usage;
    validation::cmdBuildMicromaps(device, commands, 1, &micromap);
}

// Builds above an implementation whose sizes are known.
class BuildRules : public ValidationState
{
protected:
    static constexpr VkDeviceAddress kScratch = 0x100000;
    static constexpr VkDeviceSize kScratchBytes = 0x10000;

    BuildRules()
    {
        device.rules.validating = true;
        device.rules.lacksBuffer = [this](VkDeviceAddress address) {
            return !device.buffers.addresses.find(address).buffer;
        };
        device.driver.enabled.ext = device.driver.enabled.extFeature = true;
        device.next.CmdBuildAccelerationStructuresKHR = [](VkCommandBuffer, uint32_t,
                                                           const VkAccelerationStructureBuildGeometryInfoKHR *,
                                                           const VkAccelerationStructureBuildRangeInfoKHR *const *) {};
        device.next.GetAccelerationStructureBuildSizesKHR =
            [](VkDevice, VkAccelerationStructureBuildTypeKHR, const VkAccelerationStructureBuildGeometryInfoKHR *,
               const uint32_t *, VkAccelerationStructureBuildSizesInfoKHR *sizes) {
                sizes->accelerationStructureSize = 256;
                sizes->buildScratchSize = 256;
                sizes->updateScratchSize = 0;
            };
        bind(addBuffer(kScratch, kScratchBytes), 1);
        commands_ = allocate(makePool(), 1).front();
        geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
    }
    void bind(VkBuffer buffer, uint64_t memory)
    {
        const auto known = device.objects.buffers.get(buffer);
        known->address = known->handle.handle;
        known->memory = handle<VkDeviceMemory>(memory);
    }
    // A build of a structure in memory of its own, with geometry without primitives.
    VkAccelerationStructureBuildGeometryInfoKHR buildOf(uint64_t number)
    {
        auto structure = std::make_shared<ValidatedStructure>();
        structure->handle = handle<VkAccelerationStructureKHR>(number);
        structure->type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        structure->size = 4096;
        const VkBuffer buffer = addBuffer(number << 16, 4096);
        bind(buffer, number);
        structure->buffer = device.objects.buffers.get(buffer);
        device.objects.structures.set(handle<VkAccelerationStructureKHR>(number), structure);
        VkAccelerationStructureBuildGeometryInfoKHR info{
            VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
        info.type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
        info.dstAccelerationStructure = handle<VkAccelerationStructureKHR>(number);
        info.geometryCount = 1;
        info.pGeometries = &geometry;
        info.scratchData.deviceAddress = kScratch;
        return info;
    }
    // The messages about builds by one command.
    std::map<std::string, int> build(const std::vector<VkAccelerationStructureBuildGeometryInfoKHR> &infos,
                                     bool hasRanges = true)
    {
        const VkAccelerationStructureBuildRangeInfoKHR range{};
        const std::vector<const VkAccelerationStructureBuildRangeInfoKHR *> ranges(infos.size(),
                                                                                   hasRanges ? &range : nullptr);
        reported.clear();
        validation::cmdBuildAccelerationStructures(device, commands_, static_cast<uint32_t>(infos.size()), infos.data(),
                                                   ranges.data());
        return reported;
    }

    VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};

private:
    VkCommandBuffer commands_;
};

// Scratch memory that is not needed may have any address.
TEST_F(BuildRules, ScratchMemory)
{
    using Messages = std::map<std::string, int>;
    const Messages none, ofBuild{{"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-12261", 1}};
    auto info = buildOf(0x20);
    EXPECT_EQ(build({info}), none);
    for (const VkDeviceAddress invalid : {VkDeviceAddress{0}, VkDeviceAddress{0x7654'0000'0000}}) {
        info.scratchData.deviceAddress = invalid;
        info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
        EXPECT_EQ(build({info}), ofBuild) << invalid;
        info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        info.srcAccelerationStructure = info.dstAccelerationStructure;
        EXPECT_EQ(build({info}), none) << invalid;
    }
    constexpr VkDeviceAddress kInput = 0x900000;
    device.buffers.addresses.add(kInput, handle<VkBuffer>(kInput), 4096, VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    info.scratchData.deviceAddress = kInput;
    info.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR;
    EXPECT_EQ(build({info}), ofBuild) << "its buffer is not for storage";
}

// One message for each, and not for each pair.
TEST_F(BuildRules, ManyShareTheirScratchMemory)
{
    constexpr uint32_t kBuilds = 1000;
    std::vector<VkAccelerationStructureBuildGeometryInfoKHR> infos;
    for (uint32_t i = 0; i < kBuilds; ++i)
        infos.push_back(buildOf(0x20 + i));
    EXPECT_EQ(build(infos), (std::map<std::string, int>{
                                {"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-scratchData-03704", kBuilds - 1}}));
}

// VK_AMDX_dense_geometry_format: the micromap is in the chain of the geometry, behind the triangles, and there are no
// ranges.
TEST_F(BuildRules, DenseGeometry)
{
    VkAccelerationStructureTrianglesOpacityMicromapEXT attached{
        VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_TRIANGLES_OPACITY_MICROMAP_EXT};
    const VkBaseInStructure triangles{static_cast<VkStructureType>(1000478001),
                                      reinterpret_cast<const VkBaseInStructure *>(&attached)};
    geometry.geometryType = static_cast<VkGeometryTypeKHR>(1000478000);
    geometry.pNext = &triangles;
    EXPECT_EQ(build({buildOf(0x20)}, false), (std::map<std::string, int>{}));
    geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
    geometry.pNext = &attached;
    EXPECT_EQ(
        build({buildOf(0x21)}, false),
        (std::map<std::string, int>{{"VELLUM-VUID-VkAccelerationStructureGeometryKHR-pNext-pNext", 1},
                                    {"VELLUM-VUID-vkCmdBuildAccelerationStructuresKHR-ppBuildRangeInfos-11543", 1}}));
}

// An application may state the usage of each triangle; what compares kinds would take hours.
TEST(UsageCounts, AreMerged)
{
    const std::vector<VkMicromapUsageEXT> usages{{1, 2, 2}, {3, 2, 1}, {4, 2, 2}, {UINT32_MAX, 2, 2}, {5, 1, 1}};
    const std::vector<VkMicromapUsageEXT> merged =
        input::UsageCounts(static_cast<uint32_t>(usages.size()), usages.data(), nullptr).merged();
    std::vector<uint32_t> counts;
    for (const VkMicromapUsageEXT &usage : merged)
        counts.push_back(usage.count);
    EXPECT_EQ(counts.size(), 4u);
    EXPECT_EQ(trianglesOf(merged, 2, 2), uint64_t{UINT32_MAX} + 5);
    EXPECT_EQ(trianglesOf(merged, 2, 1), 3u);
    EXPECT_EQ(trianglesOf(merged, 1, 1), 5u);
}

// Copies between ranges of a buffer.
class CopyRanges : public ValidationState
{
protected:
    static constexpr VkDeviceAddress kMemory = uint64_t{1} << 40;

    CopyRanges()
    {
        device.checks.sync = false;
        device.next.CmdCopyMemoryKHR = [](VkCommandBuffer, const VkCopyDeviceMemoryInfoKHR *) {};
        addBuffer(kMemory, uint64_t{1} << 32);
    }
    // Adds a region of 16 bytes.
    void add(VkDeviceSize from, VkDeviceSize to)
    {
        constexpr VkAddressCommandFlagsKHR kUsages = VK_ADDRESS_COMMAND_STORAGE_BUFFER_USAGE_BIT_KHR |
                                                     VK_ADDRESS_COMMAND_TRANSFORM_FEEDBACK_BUFFER_USAGE_BIT_KHR;
        VkDeviceMemoryCopyKHR region{VK_STRUCTURE_TYPE_DEVICE_MEMORY_COPY_KHR};
        region.srcRange = {kMemory + from, 16};
        region.dstRange = {kMemory + to, 16};
        region.srcFlags = region.dstFlags = kUsages;
        regions.push_back(region);
    }
    std::map<std::string, int> copy()
    {
        VkCopyDeviceMemoryInfoKHR info{VK_STRUCTURE_TYPE_COPY_DEVICE_MEMORY_INFO_KHR};
        info.regionCount = static_cast<uint32_t>(regions.size());
        info.pRegions = regions.data();
        reported.clear();
        validation::cmdCopyMemory(device, VK_NULL_HANDLE, &info);
        regions.clear();
        return reported;
    }
    static std::map<std::string, int> overlaps(int count)
    {
        return {{"VELLUM-VUID-VkCopyDeviceMemoryInfoKHR-srcRange-13015", count}};
    }

    std::vector<VkDeviceMemoryCopyKHR> regions;
};

// Each source is reported once.
TEST_F(CopyRanges, ThatOverlap)
{
    const std::map<std::string, int> none;
    add(0, 16);
    add(32, 16); // two targets
    EXPECT_EQ(copy(), none);
    for (VkDeviceSize i = 0; i < 100; ++i)
        add(i * 16, 160000 + i);
    add(160050, 0);
    EXPECT_EQ(copy(), overlaps(2));
    for (VkDeviceSize i = 0; i < 100; ++i)
        add(i * 15, 160000);
    EXPECT_EQ(copy(), overlaps(99));
    add(0, 4096);
    add(64, 8); // inside of the first source, and behind it
    add(4000, 72);
    EXPECT_EQ(copy(), overlaps(2));
}

// A step for each pair would take minutes.
TEST_F(CopyRanges, ManyWithOneTarget)
{
    for (VkDeviceSize i = 0; i < 300000; ++i)
        add(16 + i * 16, 0);
    EXPECT_EQ(copy(), (std::map<std::string, int>{}));
}

// Regions of an image whose rows are in memory.
class ImageRows : public ValidationState
{
protected:
    static constexpr VkDeviceAddress kMemory = uint64_t{1} << 40;
    static constexpr VkDeviceSize kBytes = uint64_t{1} << 38;

    ImageRows()
    {
        device.next.CmdCopyImageToMemoryKHR = [](VkCommandBuffer, const VkCopyDeviceMemoryImageInfoKHR *) {};
        device.objects.images.set(
            image_, std::make_shared<const ValidatedImage>(ValidatedImage{VK_FORMAT_R8_UNORM, 0, UINT32_MAX}));
        addBuffer(kMemory, kBytes);
    }
    static VkDeviceMemoryImageCopyKHR region(VkDeviceSize offset, uint32_t rowLength, VkExtent3D extent)
    {
        VkDeviceMemoryImageCopyKHR region{VK_STRUCTURE_TYPE_DEVICE_MEMORY_IMAGE_COPY_KHR};
        region.addressRange = {kMemory + offset, kBytes - offset};
        region.addressRowLength = rowLength;
        region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
        region.imageExtent = extent;
        return region;
    }
    bool overlaps(const std::vector<VkDeviceMemoryImageCopyKHR> &regions)
    {
        VkCopyDeviceMemoryImageInfoKHR info{VK_STRUCTURE_TYPE_COPY_DEVICE_MEMORY_IMAGE_INFO_KHR};
        info.image = image_;
        info.regionCount = static_cast<uint32_t>(regions.size());
        info.pRegions = regions.data();
        reported.clear();
        validation::cmdCopyImageToMemory(device, VK_NULL_HANDLE, &info);
        return reported["VELLUM-VUID-VkCopyDeviceMemoryImageInfoKHR-pRegions-12473"] > 0;
    }

private:
    VkImage image_ = handle<VkImage>(0x77);
};

TEST_F(ImageRows, RowsThatOverlap)
{
    EXPECT_TRUE(overlaps({region(0, 8, {4, 3, 1}), region(3, 8, {4, 3, 1})}));
    EXPECT_FALSE(overlaps({region(0, 8, {4, 3, 1}), region(4, 8, {4, 3, 1})}));
    EXPECT_TRUE(overlaps({region(0, 8, {4, 3, 1}), region(4, 8, {5, 3, 1})})) << "the next row's first byte";
    EXPECT_TRUE(overlaps({region(0, 5, {5, 1, 1}), region(4, 4, {4, 1, 1})})) << "one byte";
    EXPECT_TRUE(overlaps({region(0, 8, {4, 3, 1}), region(12, 1, {1, 7, 1})}));
    EXPECT_FALSE(overlaps({region(0, 8, {4, 3, 1}), region(20, 0, {4, 1, 1})}));
    EXPECT_TRUE(overlaps({region(0, 8, {4, 3, 2}), region(44, 0, {4, 1, 1}), region(43, 0, {1, 1, 1})}));
}

// A step for each row would take minutes.
TEST_F(ImageRows, ManyRows)
{
    constexpr uint32_t kMany = 1u << 31;
    EXPECT_FALSE(overlaps({region(0, 2, {1, kMany, 1}), region(1, 2, {1, kMany, 1})}));
    EXPECT_FALSE(overlaps({region(0, 2, {1, 1, kMany}), region(1, 2, {1, 1, kMany})}));
    std::vector<VkDeviceMemoryImageCopyKHR> many;
    for (VkDeviceSize i = 0; i < 2000; ++i)
        many.push_back(region(i, 2000, {1, 1u << 20, 1}));
    EXPECT_FALSE(overlaps(many));
}

// Sizes of 64 bits do not suffice for these.
TEST_F(ImageRows, RowsThatExceedMemory)
{
    constexpr uint32_t kAll = UINT32_MAX;
    auto huge = region(0, kAll, {kAll, kAll, kAll});
    huge.addressImageHeight = kAll;
    EXPECT_FALSE(overlaps({huge, huge}));
    EXPECT_EQ(reported["VELLUM-VUID-VkDeviceMemoryImageCopyKHR-size-13037"], 2);
    huge.addressRange.size = UINT64_MAX;
    EXPECT_FALSE(overlaps({huge, huge}));
}

// ------------------------------------------------------------------------------------------ allocations that fail

// Whichever allocation fails: nothing fails once the implementation has made the object.
class Creations : public ValidationState
{
protected:
    Creations()
    {
        device.checks.gpu = true;
        device.next.CreateBuffer = create<VkBuffer>;
        device.next.AllocateMemory = create<VkDeviceMemory>;
        device.next.CreateImage = create<VkImage>;
        device.next.CreateShaderModule = create<VkShaderModule>;
        device.next.CreateSemaphore = create<VkSemaphore>;
        device.next.CreateQueryPool = create<VkQueryPool>;
        device.next.CreateDescriptorSetLayout = create<VkDescriptorSetLayout>;
        device.next.CreateDescriptorUpdateTemplate = create<VkDescriptorUpdateTemplate>;
        device.next.CreateAccelerationStructureKHR = create<VkAccelerationStructureKHR>;
        device.next.CreateMicromapEXT = create<VkMicromapEXT>;
        device.next.AllocateDescriptorSets = allocateDescriptorSets;
        device.checks.core = false;
    }
    template <typename Create>
    void failEach(const char *what, Create create)
    {
        SCOPED_TRACE(what);
        for (long n = 0; n < 100; ++n) {
            const int64_t before = made;
            bool works = false;
            try {
                test::allocationsLeft = n;
                works = create() == VK_SUCCESS;
            } catch (const std::bad_alloc &) { // before it was made
            }
            const bool failed = test::allocationsLeft < 0;
            test::allocationsLeft = -1;
            ASSERT_EQ(made - before, works ? 1 : 0) << "allocation " << n;
            if (!failed)
                return;
        }
        FAIL() << "it allocates too often";
    }
    template <typename Handle, typename Info>
    void failEach(const char *what,
                  VkResult (*command)(DeviceValidation &, VkDevice, const Info *, const VkAllocationCallbacks *,
                                      Handle *),
                  const Info &info)
    {
        failEach(what, [&] {
            Handle object{};
            return command(device, {}, &info, nullptr, &object);
        });
    }
};

TEST_F(Creations, DoNotFailAfterTheImplementations)
{
    VkBufferCreateInfo buffer{VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO};
    buffer.size = 64;
    failEach("buffer", validation::createBuffer, buffer);
    failEach("memory", validation::allocateMemory, VkMemoryAllocateInfo{VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO});
    failEach("image", validation::createImage, VkImageCreateInfo{VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO});
    failEach("semaphore", validation::createSemaphore, [] {
        static VkSemaphoreTypeCreateInfo type{VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO};
        type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
        return VkSemaphoreCreateInfo{VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, &type, 0};
    }());
    failEach("command pool", validation::createCommandPool,
             VkCommandPoolCreateInfo{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO, nullptr,
                                     VK_COMMAND_POOL_CREATE_PROTECTED_BIT, 0});
    VkQueryPoolCreateInfo queries{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    queries.queryType = VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT;
    queries.queryCount = 4;
    failEach("query pool", validation::createQueryPool, queries);
    const VkDescriptorSetLayoutBinding binding{0, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 1, 0, nullptr};
    const VkDescriptorSetLayoutCreateInfo layoutInfo{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, nullptr, 0, 1,
                                                     &binding};
    failEach("layout", validation::createDescriptorSetLayout, layoutInfo);
    const VkDescriptorUpdateTemplateEntry entry{0, 0, 1, VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR, 0, 8};
    VkDescriptorUpdateTemplateCreateInfo form{VK_STRUCTURE_TYPE_DESCRIPTOR_UPDATE_TEMPLATE_CREATE_INFO};
    form.descriptorUpdateEntryCount = 1;
    form.pDescriptorUpdateEntries = &entry;
    failEach("template", validation::createDescriptorUpdateTemplate, form);
    failEach("structure", validation::createAccelerationStructure,
             VkAccelerationStructureCreateInfoKHR{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR});
    failEach("micromap", validation::createMicromap,
             VkMicromapCreateInfoEXT{VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT});
    const uint32_t words[] = {0x07230203, 0x10000, 0, 1, 0, 2u << 16 | 17, 4472}; // OpCapability RayQueryKHR
    VkShaderModuleCreateInfo module{VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO};
    module.codeSize = sizeof words;
    module.pCode = words;
    failEach("shader module", validation::createShaderModule, module);
    const VkCommandPool pool = makePool();
    failEach("command buffer", [&] {
        VkCommandBufferAllocateInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
        info.commandPool = pool;
        info.commandBufferCount = 1;
        VkCommandBuffer commands{};
        return validation::allocateCommandBuffers(device, {}, &info, &commands);
    });
    const VkDescriptorSetLayout layout = handle<VkDescriptorSetLayout>(1);
    failEach("descriptor set", [&] {
        VkDescriptorSetAllocateInfo info{VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO};
        info.descriptorSetCount = 1;
        info.pSetLayouts = &layout;
        VkDescriptorSet set{};
        return validation::allocateDescriptorSets(device, {}, &info, &set);
    });
}

} // namespace
} // namespace vellum::layer
