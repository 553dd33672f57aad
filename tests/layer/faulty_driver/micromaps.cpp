// SPDX-License-Identifier: Apache-2.0
// Faults in builds of micromaps: their inputs, and when they are executed.
#include "faulty_driver/faults.h"

#include <map>
#include <memory>
#include <optional>
#include <set>

#include "faulty_driver/micromap_input.h"

namespace faults
{
namespace
{

constexpr Level kLevel = Level::Micromaps;

constexpr uint8_t kTransparent = 0, kOpaque = 1, kUnknownTransparent = 2, kUnknownOpaque = 3;
constexpr uint16_t kTwoState = VK_OPACITY_MICROMAP_FORMAT_2_STATE_EXT;
constexpr uint16_t kFourState = VK_OPACITY_MICROMAP_FORMAT_4_STATE_EXT;

// --- what is read instead ---

void firstUsagePointer(MicromapInput &input)
{
    if (input.usagePointers)
        input.usages.assign(input.usages.size(), input.usages.front());
}

void untilZero(MicromapInput &input)
{
    const auto zero =
        std::find_if(input.usages.begin(), input.usages.end(), [](const auto &u) { return u.count == 0; });
    input.usages.erase(zero, input.usages.end());
}

void lastOfEach(MicromapInput &input)
{
    std::map<std::pair<uint32_t, uint32_t>, VkMicromapUsageEXT> last;
    for (const VkMicromapUsageEXT &usage : input.usages)
        last[{usage.format, usage.subdivisionLevel}] = usage;
    input.usages.clear();
    for (const auto &[key, usage] : last)
        input.usages.push_back(usage);
}

void packedTriangles(MicromapInput &input)
{
    input.stride = sizeof(VkMicromapTriangleEXT);
}

void twoStateAsFour(VkMicromapTriangleEXT &triangle)
{
    triangle.format = kFourState;
}

void levelZeroAsOne(VkMicromapTriangleEXT &triangle)
{
    triangle.subdivisionLevel = std::max<uint16_t>(triangle.subdivisionLevel, 1);
}

void shortOffset(VkMicromapTriangleEXT &triangle)
{
    triangle.dataOffset &= 0xffff;
}

void alignedOffset(VkMicromapTriangleEXT &triangle)
{
    triangle.dataOffset &= ~3u;
}

// --- what becomes of the states ---

// The states of a triangle before it that are equal as far as the `compared` first ones; all but the last byte where
// that is 0.
void shareFirst(MicromapTriangle &triangle, const MicromapTriangles &before, size_t bytes)
{
    const size_t inByte = triangle.format == kTwoState ? 8 : 4;
    const size_t all = triangle.states.size();
    const size_t compared = bytes > 0 ? std::min(all, bytes * inByte) : all - std::min(all, inByte);
    if (compared == 0)
        return;
    for (const MicromapTriangle &other : before) {
        if (other.format == triangle.format && other.level == triangle.level &&
            std::equal(other.states.begin(), other.states.begin() + static_cast<ptrdiff_t>(compared),
                       triangle.states.begin())) {
            triangle.states = other.states;
            return;
        }
    }
}

void shareBy16(MicromapTriangle &triangle, const MicromapTriangles &before)
{
    shareFirst(triangle, before, 16);
}

void shareButLast(MicromapTriangle &triangle, const MicromapTriangles &before)
{
    shareFirst(triangle, before, 0);
}

void fourStateAsTwo(MicromapTriangle &triangle, const MicromapTriangles &)
{
    if (triangle.format != kFourState)
        return;
    const std::vector<uint8_t> four = triangle.states;
    for (size_t i = 0; i < four.size(); ++i)
        triangle.states[i] = four[i / 2] >> (i % 2) & 1;
}

void highestLevel(MicromapTriangle &triangle, const MicromapTriangles &)
{
    const std::vector<uint8_t> given = triangle.states;
    for (size_t i = 0; triangle.level == kHighestLevel && i < given.size(); ++i)
        triangle.states[i] = given[i / 4];
}

void shortIndex(MicromapTriangle &triangle, const MicromapTriangles &)
{
    for (size_t i = 0x10000; i < triangle.states.size(); ++i)
        triangle.states[i] = triangle.states[i & 0xffff];
}

void mirroredOddLevels(MicromapTriangle &triangle, const MicromapTriangles &)
{
    if (triangle.level % 2 == 1)
        std::reverse(triangle.states.begin(), triangle.states.end());
}

void replaceStates(MicromapTriangle &triangle, std::array<uint8_t, 4> states)
{
    for (uint8_t &state : triangle.states)
        state = triangle.format == kFourState ? states[state] : state;
}

void opaqueUnknown(MicromapTriangle &triangle, const MicromapTriangles &)
{
    replaceStates(triangle, {kTransparent, kUnknownOpaque, kUnknownTransparent, kUnknownOpaque});
}

void unknownSwapped(MicromapTriangle &triangle, const MicromapTriangles &)
{
    replaceStates(triangle, {kTransparent, kOpaque, kUnknownOpaque, kUnknownTransparent});
}

void lossyTransparent(MicromapTriangle &triangle, const MicromapTriangles &)
{
    if (!triangle.lossy)
        return;
    // The four micro-triangles of one of the level above become alike.
    for (size_t i = 0; i + 4 <= triangle.states.size(); i += 4) {
        const auto begin = triangle.states.begin() + static_cast<ptrdiff_t>(i), end = begin + 4;
        if (std::find(begin, end, kTransparent) != end)
            std::replace(begin, end, kOpaque, kTransparent);
    }
}

// A third of all states, chosen by what the triangle has.
void lossyByContent(MicromapTriangle &triangle, const MicromapTriangles &)
{
    uint32_t hash = triangle.level;
    for (const uint8_t state : triangle.states)
        hash = (hash ^ state) * 0x01000193u;
    for (uint32_t i = 0; triangle.lossy && i < triangle.states.size(); ++i) {
        const uint32_t choice = ((hash ^ i) * 0x9e3779b9u >> 16) % 6;
        if (choice < 2)
            triangle.states[i] = choice == 0 ? kUnknownTransparent : kUnknownOpaque;
    }
}

std::mutex devicesMutex;
std::vector<void *> devices; // devices that have built a micromap, by key

// True if another device built a micromap before this one did.
bool isSecond(void *key)
{
    std::lock_guard lock(devicesMutex);
    if (std::find(devices.begin(), devices.end(), key) == devices.end())
        devices.push_back(key);
    return devices.front() != key;
}

VKAPI_ATTR void VKAPI_CALL destroyDevice(VkDevice handle, const VkAllocationCallbacks *allocator)
{
    const auto next = DRIVER_NEXT(vkDestroyDevice);
    if (handle != VK_NULL_HANDLE) {
        std::lock_guard lock(devicesMutex);
        std::erase(devices, keyOf(handle));
    }
    next(handle, allocator);
}

void lossyByDevice(MicromapTriangle &triangle, const MicromapTriangles &before)
{
    if (triangle.lossy && isSecond(triangle.key))
        opaqueUnknown(triangle, before);
}

void lossyByAddress(MicromapTriangle &triangle, const MicromapTriangles &before)
{
    if (triangle.lossy && (triangle.address * 0x9e3779b97f4a7c15u >> 63) != 0)
        opaqueUnknown(triangle, before);
}

struct Fault {
    const char *name;
    void (*parameters)(MicromapInput &) = nullptr;
    void (*header)(VkMicromapTriangleEXT &) = nullptr; // also changes the usage counts alike
    void (*states)(MicromapTriangle &, const MicromapTriangles &before) = nullptr;
};
constexpr Fault kFaults[]{
    {"usage-pointers-as-first", firstUsagePointer},
    {"usage-count-0-ends", untilZero},
    {"usage-counts-once", lastOfEach},
    {"triangle-stride", packedTriangles},
    {"two-state-as-four", nullptr, twoStateAsFour},
    {"level-0-as-1", nullptr, levelZeroAsOne},
    {"data-offset-16-bits", nullptr, shortOffset},
    {"data-offset-multiple-of-4", nullptr, alignedOffset},
    {"sharing-by-16-bytes", nullptr, nullptr, shareBy16},
    {"sharing-ignores-last-byte", nullptr, nullptr, shareButLast},
    {"four-state-as-two", nullptr, nullptr, fourStateAsTwo},
    {"highest-level-truncated", nullptr, nullptr, highestLevel},
    {"micro-triangle-index-16-bits", nullptr, nullptr, shortIndex},
    {"curve-mirrored-on-odd-levels", nullptr, nullptr, mirroredOddLevels},
    {"opaque-becomes-unknown", nullptr, nullptr, opaqueUnknown},
    {"unknown-states-swapped", nullptr, nullptr, unknownSwapped},
    {"lossy-opaque-to-transparent", nullptr, nullptr, lossyTransparent},
    {"lossy-by-content", nullptr, nullptr, lossyByContent},
    {"lossy-differs-by-device", nullptr, nullptr, lossyByDevice},
    {"lossy-differs-by-address", nullptr, nullptr, lossyByAddress},
};

// The chosen one; only the first counts.
const Fault *chosen(void *key)
{
    const auto found = std::find_if(std::begin(kFaults), std::end(kFaults),
                                    [key](const Fault &fault) { return has(key, fault.name); });
    return found == std::end(kFaults) ? nullptr : found;
}

// Parameters that affect both sizes and builds.
void changeParameters(void *key, MicromapInput &input)
{
    const Fault *fault = chosen(key);
    if (fault == nullptr)
        return;
    if (fault->parameters != nullptr)
        fault->parameters(input);
    for (VkMicromapUsageEXT &usage : input.usages) {
        VkMicromapTriangleEXT triangle{0, static_cast<uint16_t>(usage.subdivisionLevel),
                                       static_cast<uint16_t>(usage.format)};
        if (fault->header != nullptr && usage.subdivisionLevel <= kHighestLevel)
            fault->header(triangle);
        usage.subdivisionLevel = triangle.subdivisionLevel;
        usage.format = triangle.format;
    }
}

void changeInput(VkCommandBuffer commands, MicromapInput &input)
{
    changeParameters(keyOf(commands), input);
    const Fault *fault = chosen(keyOf(commands));
    if (fault != nullptr && (fault->header != nullptr || fault->states != nullptr))
        rewriteWhenExecuted(commands, input, fault->header, fault->states);
}

// --- builds that are not executed, or later ---

std::mutex mutex;
std::set<uint64_t> built;
std::map<VkCommandBuffer, std::vector<std::function<void()>>> late;

bool dropped(void *key, uint64_t micromap, bool first)
{
    std::lock_guard lock(mutex);
    const bool again = !built.insert(micromap).second;
    return (again && has(key, "micromap-built-once")) || (!first && has(key, "only-first-micromap-build"));
}

// True if builds are intercepted; attachments.cpp and copies.cpp need the data that is recorded about them.
bool looksAtBuilds(void *key)
{
    return hasAny(key, kLevel) || hasAny(key, Level::Attachments) || hasAny(key, Level::Copies);
}

// Vulkan's structures for one build, which point into themselves.
template <class Info>
struct Build {
    explicit Build(const Info &given) : info(given), input(given) {}
    Info info;
    MicromapInput input;
    VkAccelerationStructureGeometryKHR geometry{};
    VkAccelerationStructureGeometryMicromapDataKHR data{};
    std::vector<VkMicromapUsageKHR> usages;

    void put()
    {
        if constexpr (std::is_same_v<Info, VkMicromapBuildInfoEXT>)
            putInto(info, input);
        else
            putInto(info, input, geometry, data, usages);
    }
};

bool isMicromap(const VkMicromapBuildInfoEXT &)
{
    return true;
}
bool isMicromap(const BuildInfo &info)
{
    return info.type == VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR;
}

// The builds of a command as the driver executes them.
template <class Info>
class Builds
{
public:
    Builds(VkCommandBuffer commands, std::span<const Info> infos, const RangeInfo *const *ranges)
    {
        bool first = true;
        for (size_t i = 0; i < infos.size(); ++i) {
            auto build = isMicromap(infos[i]) ? std::make_unique<Build<Info>>(infos[i]) : nullptr;
            if (build) {
                const uint64_t target = build->input.target;
                if (dropped(keyOf(commands), target, std::exchange(first, false)))
                    continue;
                noteBuilt(target, triangleCount(build->input), build->input.lossy);
                if (chosen(keyOf(commands)) != nullptr || has(keyOf(commands), "micromap-built-late")) {
                    changeInput(commands, build->input);
                    build->put();
                }
            }
            infos_.push_back(build ? build->info : infos[i]);
            ranges_.push_back(ranges != nullptr ? ranges[i] : nullptr);
            if (build)
                builds_.push_back(std::move(build));
        }
    }
    [[nodiscard]] bool onlyMicromaps() const { return builds_.size() == infos_.size(); }
    [[nodiscard]] uint32_t count() const { return static_cast<uint32_t>(infos_.size()); }
    [[nodiscard]] const Info *infos() const { return infos_.data(); }
    [[nodiscard]] const RangeInfo *const *ranges() const { return ranges_.data(); }

private:
    std::vector<std::unique_ptr<Build<Info>>> builds_;
    std::vector<Info> infos_;
    std::vector<const RangeInfo *> ranges_;
};

// Records the builds, now or at the end of the command buffer.
template <class Info, class Record>
void recordBuilds(VkCommandBuffer handle, std::span<const Info> infos, const RangeInfo *const *ranges, Record record)
{
    const auto builds = std::make_shared<Builds<Info>>(handle, infos, ranges);
    if (builds->count() == 0)
        return;
    if (!builds->onlyMicromaps() || !has(keyOf(handle), "micromap-built-late"))
        return record(*builds);
    std::lock_guard lock(mutex);
    late[handle].push_back([builds, record] { record(*builds); });
}

VKAPI_ATTR void VKAPI_CALL cmdBuildMicromaps(VkCommandBuffer handle, uint32_t count,
                                             const VkMicromapBuildInfoEXT *infos)
{
    const auto build = DRIVER_NEXT(vkCmdBuildMicromapsEXT);
    if (!looksAtBuilds(keyOf(handle)))
        return build(handle, count, infos);
    recordBuilds<VkMicromapBuildInfoEXT>(handle, {infos, count}, nullptr, [handle, build](const auto &builds) {
        build(handle, builds.count(), builds.infos());
    });
}

VKAPI_ATTR void VKAPI_CALL cmdBuildStructures(VkCommandBuffer handle, uint32_t count, const BuildInfo *infos,
                                              const RangeInfo *const *ranges)
{
    const auto build = DRIVER_NEXT(vkCmdBuildAccelerationStructuresKHR);
    if (!looksAtBuilds(keyOf(handle)))
        return build(handle, count, infos, ranges);
    recordBuilds<BuildInfo>(handle, {infos, count}, ranges, [handle, build](const auto &builds) {
        build(handle, builds.count(), builds.infos(), builds.ranges());
    });
}

VKAPI_ATTR VkResult VKAPI_CALL begin(VkCommandBuffer handle, const VkCommandBufferBeginInfo *info)
{
    {
        std::lock_guard lock(mutex);
        late.erase(handle);
    }
    return DRIVER_NEXT(vkBeginCommandBuffer)(handle, info);
}

VKAPI_ATTR VkResult VKAPI_CALL end(VkCommandBuffer handle)
{
    std::vector<std::function<void()>> functions;
    {
        std::lock_guard lock(mutex);
        functions = std::exchange(late[handle], {});
    }
    for (const auto &function : functions)
        function();
    return DRIVER_NEXT(vkEndCommandBuffer)(handle);
}

VKAPI_ATTR void VKAPI_CALL micromapSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                         const VkMicromapBuildInfoEXT *info, VkMicromapBuildSizesInfoEXT *sizes)
{
    const auto next = DRIVER_NEXT(vkGetMicromapBuildSizesEXT);
    if (chosen(keyOf(handle)) == nullptr)
        return next(handle, type, info, sizes);
    Build<VkMicromapBuildInfoEXT> build(*info);
    changeParameters(keyOf(handle), build.input);
    build.put();
    next(handle, type, &build.info, sizes);
}

VKAPI_ATTR void VKAPI_CALL structureSizes(VkDevice handle, VkAccelerationStructureBuildTypeKHR type,
                                          const BuildInfo *info, const uint32_t *most,
                                          VkAccelerationStructureBuildSizesInfoKHR *sizes)
{
    const auto next = DRIVER_NEXT(vkGetAccelerationStructureBuildSizesKHR);
    if (!isMicromap(*info) || chosen(keyOf(handle)) == nullptr)
        return next(handle, type, info, most, sizes);
    Build<BuildInfo> build(*info);
    changeParameters(keyOf(handle), build.input);
    build.put();
    next(handle, type, &build.info, most, sizes);
}

VKAPI_ATTR VkResult VKAPI_CALL hostBuild(VkDevice handle, VkDeferredOperationKHR operation, uint32_t count,
                                         const VkMicromapBuildInfoEXT *infos)
{
    const auto build = DRIVER_NEXT(vkBuildMicromapsEXT);
    if (has(keyOf(handle), "only-first-host-build"))
        return build(handle, operation, std::min(count, 1u), infos);
    if (operation != VK_NULL_HANDLE || !has(keyOf(handle), "host-build-returns-early"))
        return build(handle, operation, count, infos);
    for (const VkMicromapBuildInfoEXT &info : std::span(infos, count)) {
        const auto own = std::make_shared<Build<VkMicromapBuildInfoEXT>>(info);
        own->put();
        afterNextSubmission(keyOf(handle), [=] { build(handle, VK_NULL_HANDLE, 1, &own->info); });
    }
    return VK_SUCCESS;
}

} // namespace

void forgetBuild(uint64_t micromap)
{
    std::lock_guard lock(mutex);
    built.erase(micromap);
}

LevelRows micromapRows()
{
    static const Row device[]{
        {"vkCmdBuildMicromapsEXT", DRIVER_FUNCTION(cmdBuildMicromaps)},
        {"vkCmdBuildAccelerationStructuresKHR", DRIVER_FUNCTION(cmdBuildStructures)},
        {"vkGetMicromapBuildSizesEXT", DRIVER_FUNCTION(micromapSizes)},
        {"vkGetAccelerationStructureBuildSizesKHR", DRIVER_FUNCTION(structureSizes)},
        {"vkBuildMicromapsEXT", DRIVER_FUNCTION(hostBuild)},
        {"vkBeginCommandBuffer", DRIVER_FUNCTION(begin)},
        {"vkEndCommandBuffer", DRIVER_FUNCTION(end)},
        {"vkDestroyDevice", DRIVER_FUNCTION(destroyDevice)},
    };
    return {device, {}};
}

} // namespace faults
