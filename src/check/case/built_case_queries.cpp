// SPDX-License-Identifier: Apache-2.0
// The query plans of a case.
#include <algorithm>
#include <array>
#include <cstring>
#include <fmt/format.h>
#include <map>
#include <utility>

#include "check/case/built_case.h"
#include "check/case/queries.h"

namespace vellum::check
{
namespace
{

using Is = QueryState::Is;
using QueryKind = QueryCommand::Kind;
using Property = QueryPlan::Property;

constexpr uint8_t kUnwritten = 0xa5;
constexpr size_t kUnit = 8; // of QueryCommand::offset and ::padding

VkQueryType typeOf(Property property, QueryTarget::Of of, const Device &gpu)
{
    const bool ext = of == QueryTarget::Of::Micromap && !gpu.khr();
    switch (property) {
    case Property::CompactedSize:
        return ext ? VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT
                   : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR;
    case Property::SerializationSize:
        return ext ? VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT
                   : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR;
    case Property::Size: return VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR;
    default: return VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR;
    }
}

VkQueryResultFlags resultFlags(const QueryCommand &command)
{
    VkQueryResultFlags flags = 0;
    flags |= command.wide ? VkQueryResultFlags{VK_QUERY_RESULT_64_BIT} : 0;
    flags |= command.availability ? VkQueryResultFlags{VK_QUERY_RESULT_WITH_AVAILABILITY_BIT} : 0;
    flags |= command.wait ? VkQueryResultFlags{VK_QUERY_RESULT_WAIT_BIT} : 0;
    flags |= command.partial ? VkQueryResultFlags{VK_QUERY_RESULT_PARTIAL_BIT} : 0;
    return flags;
}

// The layout of results in memory that a command writes to. Guard bytes, which it must not write, follow.
struct Layout {
    explicit Layout(const QueryCommand &command)
        : word(command.wide ? 8 : 4), tight(word * (command.availability ? 2 : 1)), offset(kUnit * command.offset),
          stride(tight + kUnit * command.padding), size(offset + stride * (command.count - 1) + tight)
    {
    }
    size_t word, tight, offset, stride, size;
    static constexpr size_t kGuard = 64;
};

uint64_t wordAt(const uint8_t *bytes, size_t word)
{
    uint64_t value = 0;
    std::memcpy(&value, bytes, word);
    return value;
}

} // namespace

struct BuiltCase::QueryRun {
    QueryRun(BuiltCase &of, const QueryPlan &carriedOut)
        : built(of), gpu(of.gpu_), plan(carriedOut), states(carriedOut.count),
          type(typeOf(carriedOut.property, ofWrites(carriedOut), gpu)), pool(gpu, type, carriedOut.count)
    {
    }
    QueryRun(const QueryRun &) = delete;
    QueryRun &operator=(const QueryRun &) = delete;
    ~QueryRun()
    {
        if (commands != VK_NULL_HANDLE)
            vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
    }

    // The memory that vkCmdCopyQueryPoolResults writes to, and the values that it must write.
    struct CopyResult {
        const QueryCommand *command;
        QueryStates expected; // of the queries that are copied
        Buffer buffer;
    };

    static QueryTarget::Of ofWrites(const QueryPlan &plan)
    {
        for (const QueryCommand &command : plan.commands)
            if (!command.targets.empty())
                return command.targets[0].of;
        return QueryTarget::Of::Object;
    }

    void record(const Record &function)
    {
        if (commands == VK_NULL_HANDLE)
            commands = gpu.begin();
        built.recordUnder(commands, function);
    }
    // Submits the recorded commands. Waits for them and checks the copied results, unless the command waits itself.
    void submit()
    {
        if (commands == VK_NULL_HANDLE)
            return;
        barrier(commands);
        gpu.end(commands);
        const auto info = vkInit<VkSubmitInfo>({.commandBufferCount = 1, .pCommandBuffers = &commands});
        CHECK_VK(vkQueueSubmit(gpu.queue(), 1, &info, VK_NULL_HANDLE));
    }
    void finish()
    {
        if (commands == VK_NULL_HANDLE)
            return;
        CHECK_VK(vkQueueWaitIdle(gpu.queue()));
        vkFreeCommandBuffers(gpu.device(), gpu.pool(), 1, &commands);
        commands = VK_NULL_HANDLE;
        resets = writes = false;
        for (const CopyResult &copy : std::exchange(copies, {}))
            checkResults(copy.command->byAddress ? "vkCmdCopyQueryPoolResultsToMemoryKHR" : "vkCmdCopyQueryPoolResults",
                         *copy.command, copy.expected, {copy.buffer.bytes(), static_cast<size_t>(copy.buffer.size())});
    }
    void fault(const std::string &what)
    {
        gpu.fault(what);
        wrong = true;
    }
    void execute()
    {
        submit();
        finish();
    }

    [[nodiscard]] QueryStates statesFor(const QueryCommand &command) const
    {
        const auto first = states.begin() + command.first;
        return {first, first + command.count};
    }

    [[nodiscard]] uint64_t alone(const QueryTarget &target);
    void checkResults(const char *name, const QueryCommand &command, const QueryStates &expected,
                      std::span<const uint8_t> bytes);
    void run(const QueryCommand &command);
    void write(const QueryCommand &command);
    void read(const QueryCommand &command);
    void copy(const QueryCommand &command);
    void writeOnHost(const QueryCommand &command);

    BuiltCase &built;
    Device &gpu;
    const QueryPlan &plan;
    QueryStates states;
    VkQueryType type;
    QueryPool pool;
    VkCommandBuffer commands = VK_NULL_HANDLE; // recorded and not executed
    bool resets = false, writes = false;       // resets or writes queries
    bool wrong = false;                        // a fault was found, after which a wait may never end
    std::vector<CopyResult> copies;
    std::map<std::pair<QueryTarget::Of, uint32_t>, uint64_t> values; // of queries that are alone in a pool
};

uint64_t BuiltCase::QueryRun::alone(const QueryTarget &target)
{
    const auto [value, isNew] = values.try_emplace({target.of, target.number});
    if (isNew)
        value->second = built.alone(plan.property, target);
    return value->second;
}

void BuiltCase::QueryRun::checkResults(const char *name, const QueryCommand &command, const QueryStates &expected,
                                       std::span<const uint8_t> bytes)
{
    const bool isCopy = command.kind == QueryCommand::Kind::Copy;
    const Layout layout(command);
    std::vector<bool> mayChange(bytes.size());
    for (uint32_t i = 0; i < command.count; ++i) {
        const size_t at = layout.offset + i * layout.stride;
        const bool available = expected[i].is == Is::Available;
        // vkGetQueryPoolResults: "If VK_QUERY_RESULT_WAIT_BIT and VK_QUERY_RESULT_PARTIAL_BIT are both not set then no
        // result values are written to pData for queries that are in the unavailable state". A copy may write any.
        const size_t begin = isCopy || available || command.partial ? 0 : layout.word;
        std::fill_n(mayChange.begin() + static_cast<ptrdiff_t>(at + begin), layout.tight - begin, true);
        const std::string which = fmt::format("query {} of {}", command.first + i, plan.count);
        const uint64_t value = wordAt(&bytes[at], layout.word);
        const uint64_t right = available ? alone(expected[i].target) : 0;
        // "If an unsigned integer query's value overflows the result type, the value may either wrap or saturate."
        if (available && (command.wide || right <= UINT32_MAX) && value != right)
            fault(fmt::format("{} writes another value than a query of the structure alone has ({}: {}, not {})", name,
                              which, value, right));
        if (!command.availability)
            continue;
        const uint64_t availability = wordAt(&bytes[at + layout.word], layout.word);
        if (available != (availability != 0))
            fault(fmt::format("{} writes availability {} of a query that is {}available ({})", name,
                              availability != 0 ? "1" : "0", available ? "" : "not ", which));
    }
    for (size_t i = 0; i < bytes.size(); ++i) {
        if (!mayChange[i] && bytes[i] != kUnwritten)
            return fault(fmt::format("{} writes outside its results (byte {} of {})", name, i, bytes.size()));
    }
}

void BuiltCase::QueryRun::write(const QueryCommand &command)
{
    std::vector<VkAccelerationStructureKHR> structures;
    std::vector<MicromapHandle> micromaps;
    for (const QueryTarget &target : command.targets) {
        if (target.of == QueryTarget::Of::Micromap)
            micromaps.push_back(built.micromaps_[target.number]->handle());
        structures.push_back(built.structureOf(target));
    }
    record([&](VkCommandBuffer to) {
        if (!gpu.khr() && !micromaps.empty())
            recordMicromapProperties(gpu, to, micromaps, type, pool, command.first);
        else
            gpu.vk().CmdWriteAccelerationStructuresPropertiesKHR(to, command.count, structures.data(), type, pool,
                                                                 command.first);
    });
    writes = true;
}

void BuiltCase::QueryRun::read(const QueryCommand &command)
{
    // A query that was available before it is reset may be read as it was: "a stale value could be returned".
    const bool atOnce = command.wait && !resets;
    submit();
    if (!atOnce)
        finish();
    const Layout layout(command);
    // In units of 8 bytes, to which results are aligned
    std::vector<uint64_t> memory((layout.size - layout.offset + Layout::kGuard + kUnit - 1) / kUnit);
    const auto bytes = reinterpret_cast<uint8_t *>(memory.data());
    std::memset(bytes, kUnwritten, memory.size() * kUnit);
    const VkResult result =
        vkGetQueryPoolResults(gpu.device(), pool, command.first, command.count, layout.size - layout.offset, bytes,
                              layout.stride, resultFlags(command));
    // Without VK_QUERY_RESULT_WAIT_BIT and VK_QUERY_RESULT_PARTIAL_BIT, "no result values are written to pData for
    // queries that are in the unavailable state at the time of the call, and vkGetQueryPoolResults returns
    // VK_NOT_READY".
    const bool all = allAvailable(states, command);
    if (result != (all ? VK_SUCCESS : VK_NOT_READY) && (all || !command.partial || result != VK_SUCCESS))
        fault(fmt::format("vkGetQueryPoolResults returns VkResult {}, expected {}", static_cast<int>(result),
                          all ? "VK_SUCCESS" : "VK_NOT_READY"));
    QueryCommand without = command;
    without.offset = 0;
    checkResults("vkGetQueryPoolResults", without, statesFor(command), {bytes, memory.size() * kUnit});
    finish();
}

void BuiltCase::QueryRun::copy(const QueryCommand &command)
{
    // Without VK_QUERY_RESULT_WAIT_BIT, the command does not wait for the commands that write the queries.
    if (!command.wait && writes)
        execute();
    const Layout layout(command);
    // VUID-VkStridedDeviceAddressRangeKHR-stride-10957: the range holds the stride of the last result as well.
    const size_t range = layout.stride * command.count;
    Buffer buffer(gpu, layout.offset + range + Layout::kGuard,
                  VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    std::memset(buffer.bytes(), kUnwritten, static_cast<size_t>(buffer.size()));
    record([&](VkCommandBuffer to) {
        if (!command.byAddress)
            return vkCmdCopyQueryPoolResults(to, pool, command.first, command.count, buffer.handle(), layout.offset,
                                             layout.stride, resultFlags(command));
        const VkStridedDeviceAddressRangeKHR results{
            .address = buffer.address() + layout.offset, .size = range, .stride = layout.stride};
        gpu.vk().CmdCopyQueryPoolResultsToMemoryKHR(to, pool, command.first, command.count, &results, kUnknownUsage,
                                                    resultFlags(command));
    });
    copies.push_back({&command, statesFor(command), std::move(buffer)});
}

void BuiltCase::QueryRun::writeOnHost(const QueryCommand &command)
{
    std::vector<VkMicromapEXT> micromaps;
    for (const QueryTarget &target : command.targets)
        micromaps.push_back(built.micromaps_[target.number]->handle().ext);
    const std::vector<VkDeviceSize> sizes =
        HostCommands(gpu, false).sizes(micromaps, type, kUnit * (1 + size_t{command.padding}));
    for (size_t i = 0; i < sizes.size(); ++i) {
        const uint64_t right = alone(command.targets[i]);
        if (sizes[i] != right)
            fault(fmt::format("vkWriteMicromapsPropertiesEXT writes another value than the device "
                              "(micromap {}: {}, not {})",
                              command.targets[i].number, sizes[i], right));
    }
}

void BuiltCase::QueryRun::run(const QueryCommand &command)
{
    switch (command.kind) {
    case QueryKind::Reset:
        record([&](VkCommandBuffer to) { vkCmdResetQueryPool(to, pool, command.first, command.count); });
        resets = true;
        break;
    case QueryKind::ResetOnHost:
        execute(); // VUID-vkResetQueryPool-firstQuery-02741
        vkResetQueryPool(gpu.device(), pool, command.first, command.count);
        break;
    case QueryKind::Write: write(command); break;
    case QueryKind::Read: read(command); break;
    case QueryKind::Copy: copy(command); break;
    default: writeOnHost(command); break;
    }
    check::advance(states, command);
}

void BuiltCase::runQueries()
{
    for (const QueryPlan &plan : case_.queries) {
        executeOnHost("queries", {}, [&] {
            QueryRun run(*this, plan);
            for (size_t i = 0; i < plan.commands.size() && !run.wrong; ++i)
                run.run(plan.commands[i]);
            run.execute();
        });
    }
}

VkAccelerationStructureKHR BuiltCase::structureOf(const QueryTarget &target) const
{
    switch (target.of) {
    case QueryTarget::Of::Object: return bottoms_[target.number].structure->handle();
    case QueryTarget::Of::Micromap: return micromaps_[target.number]->handle().khr;
    default: return top_->handle();
    }
}

uint64_t BuiltCase::alone(QueryPlan::Property property, const QueryTarget &target)
{
    const VkQueryType type = typeOf(property, target.of, gpu_);
    return query(type, 1, [&](VkCommandBuffer commands, VkQueryPool pool) {
        if (target.of == QueryTarget::Of::Micromap)
            return recordMicromapProperties(gpu_, commands, std::array{micromaps_[target.number]->handle()}, type, pool,
                                            0);
        const VkAccelerationStructureKHR structure = structureOf(target);
        gpu_.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, 1, &structure, type, pool, 0);
    });
}

} // namespace vellum::check
