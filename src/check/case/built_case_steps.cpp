// SPDX-License-Identifier: Apache-2.0
// The steps of a case.
#include <algorithm>
#include <cstring>
#include <fmt/format.h>
#include <utility>

#include "check/case/built_case.h"
#include "check/case/case.h"
#include "check/oracle/scene_build.h"

namespace vellum::check
{
namespace
{

constexpr VkBufferUsageFlags kSerializedUsage =
    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
// Offsets in the header of serialized data, after the version of 32 bytes.
constexpr size_t kHeaderSerializedSize = 32;
constexpr size_t kHeaderDeserializedSize = 40;
constexpr size_t kHeaderHandleCount = 48; // of a top level

using Kind = Step::Kind;

uint64_t numberAt(const uint8_t *bytes, size_t offset)
{
    uint64_t number = 0;
    std::memcpy(&number, bytes + offset, sizeof number);
    return number;
}

bool compatible(const Device &gpu, const uint8_t *version)
{
    const auto info = vkInit<VkAccelerationStructureVersionInfoKHR>({.pVersionData = version});
    auto result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_INCOMPATIBLE_KHR;
    gpu.vk().GetDeviceAccelerationStructureCompatibilityKHR(gpu.device(), &info, &result);
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

} // namespace

std::unique_ptr<Blas> BuiltCase::prepareObject(uint32_t object, BuildMode mode)
{
    Bottom &bottom = bottoms_[object];
    // With as many vertices as before, which an update must not change.
    bottom.geometries = oracle::geometriesOf(scene_.objects[object], micromaps_, spareTriangles());
    std::unique_ptr<Blas> source;
    if (mode.update && mode.outOfPlace) {
        source = std::exchange(bottom.structure, newStructure<Blas>());
        bottom.structure->updateFrom(source.get(), mode.exact);
    }
    bottom.structure->prepare(bottom.geometries, bottom.flags,
                              mode.update ? VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR
                                          : VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
    return source;
}

void BuiltCase::rebuildObjects(const Step &step)
{
    const uint32_t parity = step.target % 2;
    std::vector<const Structure *> structures;
    std::unique_ptr<Blas> source; // of the update
    Writes writes;
    for (uint32_t o = parity; o < bottoms_.size(); o += 2) {
        if (o == step.target)
            source = prepareObject(o, {step.update, step.outOfPlace, step.exact});
        else
            (void)prepareObject(o, {});
        const Blas &structure = *bottoms_[o].structure;
        structures.push_back(&structure);
        writes.insert(writes.end(), {structure.range(), structure.scratchRange()});
    }
    const std::unique_ptr<Tlas> unrelated = unrelatedTop(writes, structures);
    const StructureBuilds builds(gpu_, structures);
    execute("built again together", writes, [&](VkCommandBuffer commands) { builds.record(commands); });
    for (uint32_t o = parity; o < bottoms_.size(); o += 2)
        bottoms_[o].structure->forgetInput();
}

void BuiltCase::buildObject(uint32_t object, BuildMode mode)
{
    const Bottom &bottom = bottoms_[object];
    const std::unique_ptr<Blas> source = prepareObject(object, mode);
    execute(mode.update ? "updated" : "built", {bottom.structure->range(), bottom.structure->scratchRange()},
            [&](VkCommandBuffer commands) { bottom.structure->record(commands); });
    bottom.structure->forgetInput();
}

void BuiltCase::buildMicromapUsers(uint32_t micromap, const Step &step)
{
    for (uint32_t o = 0; o < scene_.objects.size(); ++o) {
        if (scene_.objects[o].uses(micromap))
            buildObject(o, {step.update, step.outOfPlace, step.exact});
    }
}

void BuiltCase::apply(const Step &step)
{
    applyTo(scene_, step);
    std::unique_ptr<Micromap> original;
    switch (step.kind) {
    case Kind::CloneMicromap:
    case Kind::CompactMicromap:
        original = std::move(micromaps_[step.target]);
        micromaps_[step.target] = copyOfMicromap(*original, step);
        if (!step.states.empty())
            setStates(*original, step);
        // The copy does not depend on the contents of the original's memory.
        original->forget();
        return buildMicromapUsers(step.target, step);
    case Kind::ReloadMicromap:
        micromaps_[step.target] = reloadMicromap(std::move(micromaps_[step.target]), step);
        return buildMicromapUsers(step.target, step);
    case Kind::SetStates: {
        const oracle::SceneMicromap &from = scene_.micromaps[step.target];
        // A compacted one may be too small to be built in.
        std::unique_ptr<Micromap> micromap = std::move(micromaps_[step.target]);
        if (!step.inPlace || !micromap->setInput(oracle::inputOf(from)))
            micromap = newMicromap(from);
        buildMicromap(*micromap, step);
        micromaps_[step.target] = std::move(micromap);
        return buildMicromapUsers(step.target, step);
    }
    default: return applyToObject(step);
    }
}

void BuiltCase::applyToObject(const Step &step)
{
    Bottom &bottom = bottoms_[step.target];
    switch (step.kind) {
    case Kind::CloneObject:
    case Kind::CompactObject: bottom.structure = copied<Blas>(*bottom.structure, step); return;
    case Kind::ReloadObject: return reloadObject(step);
    case Kind::UpdateObject: return buildObject(step.target, {true, step.outOfPlace, step.exact});
    case Kind::RebuildObject:
    case Kind::ReplaceObject: return buildObject(step.target, {});
    case Kind::RebuildObjects: return rebuildObjects(step);
    case Kind::MoveObject: return moveObject(bottom, step.other);
    case Kind::RenameObject: {
        auto second = newStructure<Blas>();
        second->useMemoryOf(*bottom.structure);
        second->create(bottom.structure->size());
        bottom.structure = std::move(second);
        return;
    }
    case Kind::SetIndices: return buildObject(step.target, {step.update, step.outOfPlace, step.exact});
    default: return;
    }
}

// With BuildPlan::mixed, also builds the first object that does not use the micromap of that number.
void BuiltCase::buildMicromapBeside(Micromap &micromap, uint32_t number)
{
    OtherBuilds others;
    Writes writes{micromap.range(), micromap.scratchRange()};
    const auto object = std::ranges::find_if(scene_.objects, [&](const auto &o) { return !o.uses(number); });
    if (case_.build.mixed && gpu_.khr() && object != scene_.objects.end()) {
        const auto o = static_cast<uint32_t>(object - scene_.objects.begin());
        (void)prepareObject(o, {});
        const Blas &structure = *bottoms_[o].structure;
        writes.insert(writes.end(), {structure.range(), structure.scratchRange()});
        others = {{structure.buildInfo()}, {structure.ranges()}};
    }
    execute("micromap built", writes, [&](VkCommandBuffer commands) {
        recordMicromapBuilds(gpu_, commands, std::array{MicromapBuild{micromap.buildInfo(), micromap.handle()}},
                             others);
    });
}

void BuiltCase::buildMicromap(Micromap &micromap, const Step &step)
{
    if (step.host)
        executeOnHost("micromap built on the host", {micromap.range(), micromap.scratchRange()},
                      [&] { micromap.buildOnHost(step.deferred); });
    else
        buildMicromapBeside(micromap, step.target);
    micromap.forgetInput();
}

// Builds another content in a micromap that the scene does not use any more, if it is large enough.
void BuiltCase::setStates(Micromap &micromap, const Step &step)
{
    oracle::SceneMicromap other = scene_.micromaps[step.target];
    other.triangles = step.states;
    if (micromap.setInput(oracle::inputOf(other)))
        buildMicromap(micromap, step);
}

// The old one is destroyed at once: no ray is traced until the structures that use it are built with the new one.
std::unique_ptr<Micromap> BuiltCase::copyOfMicromap(const Micromap &source, const Step &step)
{
    const MicromapHandle handle = source.handle();
    const bool clone = step.kind == Kind::CloneMicromap;
    const VkCopyMicromapModeEXT mode = clone ? VK_COPY_MICROMAP_MODE_CLONE_EXT : VK_COPY_MICROMAP_MODE_COMPACT_EXT;
    auto target = std::make_unique<Micromap>(
        gpu_, source, clone ? source.size() : sizeOf(source, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT, step));
    const char *const what = clone ? "micromap cloned" : "micromap compacted";
    if (step.host)
        executeOnHost(what, {target->range()},
                      [&] { HostCommands(gpu_, step.deferred).copy(handle.ext, target->handle().ext, mode); });
    else
        execute(what, {target->range()},
                [&](VkCommandBuffer commands) { recordMicromapCopy(gpu_, commands, handle, target->handle(), mode); });
    return target;
}

// Serialized data begins with what vkGetDevice...CompatibilityKHR compares.
void BuiltCase::checkSerialized(const Guarded &data, std::string_view of,
                                bool (*compatible)(const Device &, const uint8_t *))
{
    if (!data.intact())
        gpu_.fault(fmt::format("a {} is serialized beyond the size that the query reports{}", of, data.damage()));
    std::vector<uint8_t> version(data.bytes(), data.bytes() + 2 * VK_UUID_SIZE);
    if (!compatible(gpu_, version.data()))
        gpu_.fault(fmt::format("the device does not accept the version of a {} that it serialized", of));
    // The identification of the compatibility becomes that of no device.
    for (size_t i = VK_UUID_SIZE; i < version.size(); ++i)
        version[i] = static_cast<uint8_t>(~version[i]);
    if (compatible(gpu_, version.data()))
        gpu_.fault(fmt::format("the device accepts every version of a serialized {}", of));
}

Guarded BuiltCase::serialized(const Micromap &micromap, const Step &step)
{
    const VkDeviceSize size = sizeOf(micromap, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT, step);
    Guarded data(gpu_, size, 256, kSerializedUsage);
    const MicromapHandle from = micromap.handle();
    if (step.host)
        executeOnHost("micromap serialized", {data.range()},
                      [&] { HostCommands(gpu_, step.deferred).toMemory(from.ext, data.bytes()); });
    else
        execute("micromap serialized", {data.range()},
                [&](VkCommandBuffer commands) { recordMicromapToMemory(gpu_, commands, from, data.address()); });
    checkSerialized(data, "micromap", micromapIsCompatible);
    return data;
}

void BuiltCase::deserialize(const Guarded &data, Micromap &target, const Step &step)
{
    const MicromapHandle to = target.handle();
    if (step.host)
        executeOnHost("micromap deserialized", {target.range()},
                      [&] { HostCommands(gpu_, step.deferred).toMicromap(data.bytes(), to.ext); });
    else
        execute("micromap deserialized", {target.range()},
                [&](VkCommandBuffer commands) { recordMemoryToMicromap(gpu_, commands, data.address(), to); });
}

std::unique_ptr<Micromap> BuiltCase::reloadMicromap(std::unique_ptr<Micromap> source, const Step &step)
{
    const Guarded data = serialized(*source, step);
    std::unique_ptr<Micromap> target = std::move(source);
    // Unlike that of a structure, the header states no sizes: a micromap is as large as the one that was serialized.
    if (!step.inPlace)
        target = std::make_unique<Micromap>(gpu_, *target, target->size());
    else if (!step.states.empty())
        setStates(*target, step);
    deserialize(data, *target, step);
    return target;
}

template <class T>
std::unique_ptr<T> BuiltCase::copied(const Structure &source, VkCopyAccelerationStructureModeKHR mode,
                                     VkDeviceSize size)
{
    auto target = newStructure<T>();
    target->create(size);
    execute(mode == VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR ? "compacted" : "cloned", {target->range()},
            [&](VkCommandBuffer commands) { recordCopy(gpu_, commands, source.handle(), target->handle(), mode); });
    return target;
}

template <class T>
std::unique_ptr<T> BuiltCase::copied(const Structure &source, const Step &step)
{
    constexpr auto kClone = VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR;
    if (step.kind == Kind::CompactObject || step.kind == Kind::CompactTop)
        return copied<T>(source, VK_COPY_ACCELERATION_STRUCTURE_MODE_COMPACT_KHR,
                         sizeOf(source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR));
    if (!step.exact)
        return copied<T>(source, kClone, source.size());
    // The size of a clone "must be at least as large as the queried VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR size"
    // (VkCopyAccelerationStructureModeKHR). Updates may need more, so it is cloned again.
    const std::unique_ptr<T> exact =
        copied<T>(source, kClone, sizeOf(source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SIZE_KHR));
    return copied<T>(*exact, kClone, source.size());
}

Guarded BuiltCase::serialized(const Structure &source)
{
    Guarded data(gpu_, sizeOf(source, VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR), 256,
                 kSerializedUsage);
    execute("serialized", {data.range()},
            [&](VkCommandBuffer commands) { recordSerialize(gpu_, commands, source, data.address()); });
    checkSerialized(data, "structure", compatible);
    // "the total size matching the value queried", "This value matches the value queried"
    // (vkCmdCopyAccelerationStructureToMemoryKHR)
    if (numberAt(data.bytes(), kHeaderSerializedSize) != data.size())
        gpu_.fault(fmt::format("the header of a serialized structure has another size than the query reported "
                               "({}, not {})",
                               numberAt(data.bytes(), kHeaderSerializedSize), data.size()));
    if (&source == top_.get() && gpu_.has(VK_KHR_RAY_TRACING_MAINTENANCE_1_EXTENSION_NAME)) {
        const uint64_t pointers = alone(QueryPlan::Property::BottomLevelPointers, {.of = QueryTarget::Of::Top});
        if (numberAt(data.bytes(), kHeaderHandleCount) != pointers)
            gpu_.fault(fmt::format("the header of a serialized top level counts other handles than the query "
                                   "reported ({}, not {})",
                                   numberAt(data.bytes(), kHeaderHandleCount), pointers));
    }
    return data;
}

// Replaces the addresses in the header: those of the bottom-level structures of a top level, or of the micromaps of a
// bottom-level structure.
void BuiltCase::replaceAddresses(const Guarded &data, bool top, const Addresses &addresses,
                                 std::set<VkDeviceAddress> needed)
{
    size_t at = kHeaderHandleCount;
    const auto next = [&] {
        const uint64_t number = at + 8 <= data.size() ? numberAt(data.bytes(), at) : 0;
        at += 8;
        return number;
    };
    const auto replace = [&](uint64_t count) {
        for (; count > 0 && at + 8 <= data.size(); --count) {
            const uint64_t address = next();
            const auto found = addresses.find(address);
            needed.erase(address);
            if (found != addresses.end())
                std::memcpy(data.bytes() + at - 8, &found->second, 8);
            else if (address != 0)
                gpu_.fault(
                    fmt::format("the header of a serialized {} has an address that does not belong to its {} ({:#x})",
                                top ? "top level" : "structure", top ? "objects" : "micromaps", address));
        }
    };
    if (top) {
        replace(next());
        if (!needed.empty())
            gpu_.fault(fmt::format("the header of a serialized top level lacks the address of one of its objects "
                                   "({:#x})",
                                   *needed.begin()));
        return;
    }
    constexpr uint64_t kBlockFormat = 0xffffffff;
    const uint64_t blocks = next();
    if (blocks >> 32 != kBlockFormat)
        return gpu_.fault("the header of a serialized structure with micromaps has no blocks");
    for (uint32_t i = 0; i < static_cast<uint32_t>(blocks) && at < data.size(); ++i) {
        const auto type = static_cast<uint32_t>(next());
        const uint64_t count = next();
        if (type == VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_OPACITY_MICROMAP_KHR)
            replace(count);
        else
            at += 8 * count;
    }
}

void BuiltCase::deserialize(const Guarded &data, Structure &target)
{
    target.create(numberAt(data.bytes(), kHeaderDeserializedSize));
    execute("deserialized", {target.range()}, [&](VkCommandBuffer commands) {
        auto info = vkInit<VkCopyMemoryToAccelerationStructureInfoKHR>();
        info.src.deviceAddress = data.address();
        info.dst = target.handle();
        info.mode = VK_COPY_ACCELERATION_STRUCTURE_MODE_DESERIALIZE_KHR;
        gpu_.vk().CmdCopyMemoryToAccelerationStructureKHR(commands, &info);
    });
}

void BuiltCase::reloadObject(const Step &step)
{
    Bottom &bottom = bottoms_[step.target];
    const oracle::Object &object = scene_.objects[step.target];
    const Guarded data = serialized(*bottom.structure);
    std::map<uint32_t, std::unique_ptr<Micromap>> originals;
    std::map<uint32_t, Guarded> contents; // of micromaps; all are serialized before copies without content are made
    for (uint32_t m = 0; step.relocated && gpu_.khr() && m < micromaps_.size(); ++m)
        if (object.uses(m))
            contents.emplace(m, serialized(*micromaps_[m], step));
    Addresses addresses;
    for (const auto &[m, content] : contents) {
        auto copy = std::make_unique<Micromap>(gpu_, *micromaps_[m], micromaps_[m]->size());
        if (!step.structureFirst)
            deserialize(content, *copy, step);
        addresses[micromaps_[m]->range().address] = copy->range().address;
        originals[m] = std::exchange(micromaps_[m], std::move(copy));
        originals[m]->forget();
    }
    if (!addresses.empty())
        replaceAddresses(data, false, addresses);
    auto target = newStructure<Blas>();
    deserialize(data, *target);
    // "Before using the deserialized acceleration structure, the micromaps must be deserialized"
    // (vkCmdCopyAccelerationStructureToMemoryKHR)
    for (const auto &[m, content] : contents)
        if (step.structureFirst)
            deserialize(content, *micromaps_[m], step);
    bottom.structure = std::move(target);
    bottom.geometries = oracle::geometriesOf(object, micromaps_, spareTriangles());
    for (uint32_t o = 0; o < bottoms_.size(); ++o)
        if (o != step.target &&
            std::ranges::any_of(originals, [&](const auto &m) { return scene_.objects[o].uses(m.first); }))
            buildObject(o, {});
}

void BuiltCase::reloadTop(const Step &step)
{
    const Guarded data = serialized(*top_);
    std::vector<std::unique_ptr<Blas>> originals;
    Addresses addresses;
    std::set<VkDeviceAddress> needed;
    // "the number of and ordering of the handles may not match the instance descriptions which were used to build the
    // acceleration structure" (vkCmdCopyAccelerationStructureToMemoryKHR)
    for (const oracle::Instance &instance : scene_.instances)
        if (oracle::canBeMet(scene_, instance))
            needed.insert(bottoms_[instance.object].structure->address());
    for (size_t i = 0; step.relocated && i < bottoms_.size(); ++i) {
        std::unique_ptr<Blas> &structure = bottoms_[i].structure;
        auto clone = copied<Blas>(*structure, VK_COPY_ACCELERATION_STRUCTURE_MODE_CLONE_KHR, structure->size());
        addresses[structure->address()] = clone->address();
        originals.push_back(std::exchange(structure, std::move(clone)));
    }
    if (!addresses.empty())
        replaceAddresses(data, true, addresses, needed);
    auto target = newStructure<Tlas>();
    deserialize(data, *target);
    top_ = std::move(target);
}

// One object is cloned, and another one built in its memory by the same submission, if that is large enough: its handle
// is created while the first content is in use, and the first one's is destroyed when the second is.
void BuiltCase::moveObject(Bottom &moved, uint32_t other)
{
    Bottom &built = bottoms_[other];
    auto clone = newStructure<Blas>();
    clone->create(moved.structure->size());
    auto over = newStructure<Blas>();
    over->useMemoryOf(*moved.structure);
    over->prepare(built.geometries, built.flags);
    execute(
        "cloned and built over", {clone->range(), over->range(), over->scratchRange()},
        [&](VkCommandBuffer commands) {
            recordCopy(gpu_, commands, moved.structure->handle(), clone->handle());
            barrier(commands);
            over->record(commands);
        },
        false);
    over->forgetInput();
    if (&moved != &built)
        moved.structure = std::move(clone);
    built.structure = std::move(over);
}

void BuiltCase::applyToTop(const Step &step)
{
    const Kind kind = step.kind;
    applyTo(scene_, step);
    if (kind == Kind::UpdateTop || kind == Kind::RebuildTop)
        return buildTopAgain(step);
    if (kind == Kind::ReloadTop)
        return reloadTop(step);
    top_ = copied<Tlas>(*top_, step);
}

// The last of the queries that are recorded.
uint64_t BuiltCase::query(VkQueryType type, uint32_t count,
                          const std::function<void(VkCommandBuffer, VkQueryPool)> &record)
{
    const QueryPool pool(gpu_, type, count);
    execute("query", {}, [&](VkCommandBuffer commands) {
        vkCmdResetQueryPool(commands, pool, 0, count);
        record(commands, pool);
    });
    return pool.value(count - 1);
}

// Queries the structure alone, and after all others that can be queried: both results must be equal.
VkDeviceSize BuiltCase::sizeOf(const Structure &structure, VkQueryType type)
{
    std::vector<VkAccelerationStructureKHR> all;
    for (const Bottom &bottom : bottoms_) {
        if (bottom.structure && (type != VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR ||
                                 (bottom.flags & VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_COMPACTION_BIT_KHR) != 0))
            all.push_back(bottom.structure->handle());
    }
    all.push_back(structure.handle());
    const auto querySize = [&](std::span<const VkAccelerationStructureKHR> of) {
        return query(type, static_cast<uint32_t>(of.size()), [&](VkCommandBuffer commands, VkQueryPool pool) {
            gpu_.vk().CmdWriteAccelerationStructuresPropertiesKHR(commands, static_cast<uint32_t>(of.size()), of.data(),
                                                                  type, pool, 0);
        });
    };
    const VkDeviceSize one = querySize(std::span(&all.back(), 1));
    if (const VkDeviceSize last = querySize(all); last != one)
        gpu_.fault(fmt::format("a query of several sizes of acceleration structures differs from a query of one "
                               "({} as the last of {}, {} alone)",
                               last, all.size(), one));
    return one;
}

VkDeviceSize BuiltCase::sizeOf(const Micromap &micromap, VkQueryType of, const Step &step)
{
    const VkQueryType type = micromapQueryType(gpu_, of);
    std::vector<MicromapHandle> all;
    for (size_t i = 0; i < micromaps_.size(); ++i) {
        if (micromaps_[i] && (of != VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT ||
                              (scene_.micromaps[i].flags & VK_BUILD_MICROMAP_ALLOW_COMPACTION_BIT_EXT) != 0))
            all.push_back(micromaps_[i]->handle());
    }
    all.push_back(micromap.handle());
    const auto querySize = [&](std::span<const MicromapHandle> some) -> VkDeviceSize {
        if (step.host) {
            std::vector<VkMicromapEXT> handles;
            for (const MicromapHandle &handle : some)
                handles.push_back(handle.ext);
            constexpr size_t kStride = 3 * sizeof(VkDeviceSize);
            return HostCommands(gpu_, false).sizes(handles, type, kStride).back();
        }
        return query(type, static_cast<uint32_t>(some.size()), [&](VkCommandBuffer commands, VkQueryPool pool) {
            recordMicromapProperties(gpu_, commands, some, type, pool, 0);
        });
    };
    const VkDeviceSize one = querySize(std::span(&all.back(), 1));
    if (const VkDeviceSize last = querySize(all); last != one)
        gpu_.fault(fmt::format("a query of several sizes of micromaps differs from a query of one ({} as the last of "
                               "{}, {} alone)",
                               last, all.size(), one));
    return one;
}

} // namespace vellum::check
