// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <vector>

#include "check.h"
#include "core/records.h"
#include "fake_device.h"
#include "gpu/pieces.h"
#include "layer/base/commands.h"
#include "layer/micromaps/device_micromaps.h"
#include "micromap_fuzz.h"
#include "micromap_model.h"
#include "reader.h"

namespace vellum::fuzz
{
namespace
{

constexpr uint64_t kMostBytes = 1u << 18; // of a micromap that is built
constexpr uint16_t kMostOtherLevel = 8;   // of triangles that are not of a level that was counted
constexpr uint64_t kHeaderBytes = 64;     // of a micromap, and of a serialized one
constexpr size_t kPackedBytes = 1u << 16;

// The commands on one device, for one input.
class Commands
{
public:
    Commands(FakeDevice &device, Reader &input) : device_(device), input_(input) {}
    ~Commands()
    {
        for (const VkMicromapEXT micromap : micromaps_)
            layer::destroyMicromap(device_.micromaps(), device_.handle(), micromap, nullptr);
        device_.clear();
    }
    Commands(const Commands &) = delete;
    Commands &operator=(const Commands &) = delete;

    void run();

private:
    void readUsages();
    void readTriangles();
    // Creates a micromap of this size: at the end of a buffer of its own, so that AddressSanitizer sees where it ends,
    // or in a buffer with others, by a handle that reaches to the end of that buffer.
    VkMicromapEXT make(uint64_t size);
    // The size of a target that shall be too small. Where handles reach to the end of a buffer, no target is.
    [[nodiscard]] uint64_t small(uint64_t size, uint64_t enough) const { return packed_ ? enough : size; }
    // Checks that only the target's memory changes in the shared buffer.
    VkResult writingTo(VkMicromapEXT target, const std::function<VkResult()> &command);
    [[nodiscard]] std::span<uint8_t> bytesOf(VkMicromapEXT micromap) const;
    VkMicromapEXT build(uint64_t size);
    uint64_t property(VkMicromapEXT micromap, VkQueryType type);
    void copy(VkMicromapEXT source, uint64_t compacted);
    void serialize(VkMicromapEXT source, uint64_t used);
    void deserializeDamaged(std::vector<uint8_t> serialized, uint64_t used);
    void deserializeAnything();
    void checkMicromap(VkMicromapEXT micromap) const;
    // A command that fails says why.
    static void checkReported(VkResult result)
    {
        FUZZ_CHECK(result == VK_SUCCESS || FakeDevice::takeMessages() > 0);
        FakeDevice::takeMessages();
    }

    FakeDevice &device_;
    Reader &input_;
    std::vector<VkMicromapEXT> micromaps_;
    std::map<VkMicromapEXT, size_t> sizes_; // bytes
    std::optional<vellum::gpu::Pieces> packed_;
    VkBuffer packedBuffer_ = VK_NULL_HANDLE;
    std::vector<VkMicromapUsageEXT> usages_;
    std::vector<const VkMicromapUsageEXT *> usagePointers_;
    VkMicromapBuildInfoEXT info_{VK_STRUCTURE_TYPE_MICROMAP_BUILD_INFO_EXT};
    BuildModel model_;
    std::vector<uint8_t> array_;
    std::vector<uint8_t> data_;
};

// Counts that are small enough to build, as a rule.
void Commands::readUsages()
{
    usages_.resize(input_.below(6));
    for (VkMicromapUsageEXT &usage : usages_) {
        usage.count = input_.oneIn(16) ? input_.take<uint32_t>() : input_.below(12);
        usage.subdivisionLevel = input_.oneIn(16) ? input_.take<uint32_t>() : input_.below(8);
        usage.format = input_.oneIn(16) ? input_.take<uint32_t>() : 1 + input_.below(2);
    }
    for (const VkMicromapUsageEXT &usage : usages_)
        usagePointers_.push_back(&usage);
    info_.flags = input_.byte();
    info_.type = input_.oneIn(32) ? static_cast<VkMicromapTypeEXT>(1000396001) : VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    info_.mode = input_.oneIn(32) ? static_cast<VkBuildMicromapModeEXT>(1) : VK_BUILD_MICROMAP_MODE_BUILD_EXT;
    info_.usageCountsCount = static_cast<uint32_t>(usages_.size());
    const bool direct = input_.flag(), wrong = input_.oneIn(32);
    info_.pUsageCounts = direct ? usages_.data() : nullptr;
    info_.ppUsageCounts = direct == wrong ? usagePointers_.data() : nullptr;
}

// Reads as many triangles as the counts state, mostly of their levels and formats, whose data exists: these commands
// have no size of the data.
void Commands::readTriangles()
{
    uint64_t count = 0;
    uint64_t most = 0;
    uint64_t inlineBytes = 0;
    for (const VkMicromapUsageEXT &usage : usages_) {
        if (usage.count == 0)
            continue;
        // A format that there is not counts as the one that takes most.
        const SourceTriangle one{0, static_cast<uint16_t>(usage.subdivisionLevel),
                                 static_cast<uint16_t>(usage.format == 1 ? 1 : 2)};
        count += usage.count;
        model_.capacityUnits += static_cast<uint32_t>(usage.count * dataUnits(one));
        inlineBytes += dataUnits(one) == 0 ? usage.count * dataBytes(one) : 0;
        model_.maxLevel = std::max(model_.maxLevel, usage.subdivisionLevel);
        most = std::max(most, dataBytes(one));
    }
    if (model_.capacityUnits > 0)
        model_.capacityUnits += static_cast<uint32_t>((inlineBytes + 15) / 16);
    most = std::max(most, dataBytes({0, kMostOtherLevel, 2}));
    const uint32_t places = 1 + input_.below(1u << 12);
    data_.resize(most + places);
    input_.part(input_.byte()).fill(data_);
    model_.data = data_;

    // Triangles that overlap would have data anywhere, except where all are the same.
    info_.triangleArrayStride = input_.oneIn(8) ? input_.below(40) : 8;
    if (info_.triangleArrayStride < 8)
        info_.triangleArrayStride = 0;
    const uint64_t stride = info_.triangleArrayStride;
    model_.triangles.resize(count);
    array_.resize(count == 0 ? 0 : (count - 1) * stride + 8);
    size_t usage = 0;
    uint32_t left = 0;
    for (size_t i = 0; i < count; ++i) {
        while (left == 0)
            left = usages_[usage++].count;
        --left;
        const VkMicromapUsageEXT &counted = usages_[usage - 1];
        SourceTriangle &t = model_.triangles[i];
        t.level =
            static_cast<uint16_t>(input_.oneIn(16) ? input_.below(kMostOtherLevel + 1) : counted.subdivisionLevel);
        t.format = static_cast<uint16_t>(input_.oneIn(16) ? input_.byte() : counted.format);
        t.dataOffset = input_.below(places);
        if (input_.flag())
            t.dataOffset = t.dataOffset / 16 * 16;
        if (stride == 0)
            t = model_.triangles[0];
        std::memcpy(array_.data() + i * stride, &t, 8);
    }
}

VkMicromapEXT Commands::make(uint64_t size)
{
    VkMicromapCreateInfoEXT create{VK_STRUCTURE_TYPE_MICROMAP_CREATE_INFO_EXT};
    create.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT;
    const auto place = packed_ ? packed_->take(size, 256) : std::nullopt;
    if (place) {
        create.buffer = packedBuffer_;
        create.offset = *place;
        create.size = kPackedBytes - *place;
    } else {
        create.offset = 256u + input_.below(2) * 256u; // a buffer is never empty, a micromap may be
        create.size = size;
        create.buffer = device_.makeBuffer(create.offset + size);
    }
    VkMicromapEXT micromap = VK_NULL_HANDLE;
    FUZZ_CHECK(layer::createMicromap(device_.micromaps(), device_.handle(), &create, nullptr, &micromap) == VK_SUCCESS);
    micromaps_.push_back(micromap);
    sizes_[micromap] = size;
    return micromap;
}

std::span<uint8_t> Commands::bytesOf(VkMicromapEXT micromap) const
{
    const layer::Micromap &m = *layer::micromapOf(micromap);
    return std::span(FakeDevice::bytes(m.buffer)).subspan(m.offset, sizes_.at(micromap));
}

VkResult Commands::writingTo(VkMicromapEXT target, const std::function<VkResult()> &command)
{
    if (!packed_)
        return command();
    std::vector<uint8_t> before(packed_->bytes().begin(), packed_->bytes().end());
    const VkResult result = command();
    const layer::Micromap *const m = layer::micromapOf(target);
    if (m != nullptr && m->buffer == packedBuffer_)
        std::ranges::copy(bytesOf(target), before.begin() + static_cast<ptrdiff_t>(m->offset));
    FUZZ_CHECK(std::ranges::equal(before, packed_->bytes()));
    FUZZ_CHECK(!packed_->damage());
    return result;
}

VkMicromapEXT Commands::build(uint64_t size)
{
    const VkMicromapEXT micromap = make(size);
    std::ranges::fill(bytesOf(micromap), uint8_t{0xc5});
    info_.dstMicromap = micromap;
    info_.triangleArray.hostAddress = array_.data();
    info_.data.hostAddress = data_.data();
    const VkResult result = writingTo(micromap, [&] {
        return layer::buildMicromaps(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, 1, &info_);
    });
    checkReported(result);
    return result == VK_SUCCESS ? micromap : VK_NULL_HANDLE;
}

uint64_t Commands::property(VkMicromapEXT micromap, VkQueryType type)
{
    uint64_t value = 0;
    FUZZ_CHECK(layer::writeMicromapsProperties(device_.micromaps(), device_.handle(), 1, &micromap, type, sizeof value,
                                               &value, sizeof value) == VK_SUCCESS);
    return value;
}

// Checks that the memory is unchanged or that everything in it lies in the micromap.
void Commands::checkMicromap(VkMicromapEXT micromap) const
{
    const std::span<const uint8_t> bytes = bytesOf(micromap);
    uint32_t magic = 0;
    if (bytes.size() < kHeaderBytes)
        return;
    std::memcpy(&magic, bytes.data(), sizeof magic);
    if (magic == shared::kMicromapMagic)
        checkStaysInside(bytes);
}

// Into a micromap of the compacted size it has the same states; into one that is smaller, none.
void Commands::copy(VkMicromapEXT source, uint64_t compacted)
{
    const VkMicromapEXT exact = make(compacted);
    VkCopyMicromapInfoEXT info{VK_STRUCTURE_TYPE_COPY_MICROMAP_INFO_EXT};
    info.src = source;
    info.dst = exact;
    info.mode = VK_COPY_MICROMAP_MODE_COMPACT_EXT;
    const auto run = [&] {
        checkReported(writingTo(info.dst, [&] {
            return layer::copyMicromap(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, &info);
        }));
    };
    run();
    checkBuilt(model_, bytesOf(exact));
    if (packed_)
        return;
    info.dst = make(input_.below(static_cast<uint32_t>(compacted)));
    run();
    checkMicromap(info.dst);
    // The memory then holds no micromap: it has the size of an empty one.
    FUZZ_CHECK(property(info.dst, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT) == kHeaderBytes);
}

void Commands::serialize(VkMicromapEXT source, uint64_t used)
{
    const uint64_t size = property(source, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT);
    FUZZ_CHECK(size == used + kHeaderBytes);
    std::vector<uint8_t> serialized(size);
    VkCopyMicromapToMemoryInfoEXT out{VK_STRUCTURE_TYPE_COPY_MICROMAP_TO_MEMORY_INFO_EXT};
    out.src = source;
    out.dst.hostAddress = serialized.data();
    out.mode = VK_COPY_MICROMAP_MODE_SERIALIZE_EXT;
    checkReported(writingTo(VK_NULL_HANDLE, [&] {
        return layer::copyMicromapToMemory(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, &out);
    }));

    const VkMicromapEXT target = make(used);
    VkCopyMemoryToMicromapInfoEXT in{VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT};
    in.src.hostAddress = serialized.data();
    in.dst = target;
    in.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    checkReported(writingTo(in.dst, [&] {
        return layer::copyMemoryToMicromap(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, &in);
    }));
    checkBuilt(model_, bytesOf(target));

    const VkMicromapVersionInfoEXT version{VK_STRUCTURE_TYPE_MICROMAP_VERSION_INFO_EXT, nullptr, serialized.data()};
    VkAccelerationStructureCompatibilityKHR compatibility{};
    layer::getDeviceMicromapCompatibility(device_.micromaps(), device_.handle(), &version, &compatibility);
    FUZZ_CHECK(compatibility == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR);
    deserializeDamaged(std::move(serialized), used);
}

// The size that the header says is what the application vouches for, so it is the one thing that stays.
void Commands::deserializeDamaged(std::vector<uint8_t> serialized, uint64_t used)
{
    for (uint32_t n = 1 + input_.below(6); n > 0; --n) {
        const uint32_t at = input_.below(static_cast<uint32_t>(serialized.size()));
        if (at < 32 || at >= 40)
            serialized[at] = input_.byte();
    }
    VkCopyMemoryToMicromapInfoEXT in{VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT};
    in.src.hostAddress = serialized.data();
    in.dst = make(input_.flag() ? used : small(input_.below(static_cast<uint32_t>(used) + 64), used));
    std::ranges::fill(bytesOf(in.dst), input_.byte());
    in.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    checkReported(writingTo(in.dst, [&] {
        return layer::copyMemoryToMicromap(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, &in);
    }));
    checkMicromap(in.dst);
}

// Bytes that never were a micromap, 128 of which a header and the micromap's header take.
void Commands::deserializeAnything()
{
    std::vector<uint8_t> serialized(2 * kHeaderBytes + input_.below(512));
    input_.fill(serialized);
    const uint64_t size = serialized.size();
    std::memcpy(serialized.data() + 32, &size, sizeof size);
    const VkMicromapVersionInfoEXT version{VK_STRUCTURE_TYPE_MICROMAP_VERSION_INFO_EXT, nullptr, serialized.data()};
    VkAccelerationStructureCompatibilityKHR compatibility{};
    layer::getDeviceMicromapCompatibility(device_.micromaps(), device_.handle(), &version, &compatibility);
    VkCopyMemoryToMicromapInfoEXT in{VK_STRUCTURE_TYPE_COPY_MEMORY_TO_MICROMAP_INFO_EXT};
    in.src.hostAddress = serialized.data();
    in.dst = make(small(serialized[0], size - kHeaderBytes));
    in.mode = VK_COPY_MICROMAP_MODE_DESERIALIZE_EXT;
    checkReported(writingTo(in.dst, [&] {
        return layer::copyMemoryToMicromap(device_.micromaps(), device_.handle(), VK_NULL_HANDLE, &in);
    }));
    checkMicromap(in.dst);
}

void Commands::run()
{
    FakeDevice::takeMessages();
    if (input_.flag()) {
        packedBuffer_ = device_.makeBuffer(kPackedBytes);
        packed_.emplace(FakeDevice::bytes(packedBuffer_), 0);
    }
    if (input_.oneIn(16))
        return deserializeAnything();
    model_.maxLevel = 0;
    readUsages();
    VkMicromapBuildSizesInfoEXT sizes{VK_STRUCTURE_TYPE_MICROMAP_BUILD_SIZES_INFO_EXT};
    layer::getMicromapBuildSizes(device_.micromaps(), device_.handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_HOST_KHR,
                                 &info_, &sizes);
    // A tolerated fault has a message and a size.
    FUZZ_CHECK(FakeDevice::takeMessages() > 0 || sizes.micromapSize > 0);
    if (sizes.micromapSize == 0 || sizes.micromapSize > kMostBytes)
        return;
    const uint64_t missing = input_.oneIn(16) ? small(1 + input_.below(600), 0) : 0;
    readTriangles();
    const uint64_t count = model_.triangles.size();
    const uint64_t exact = kHeaderBytes + (count + count % 2) * 8 + uint64_t{model_.capacityUnits} * 16;
    FUZZ_CHECK(sizes.micromapSize >= exact && sizes.micromapSize < exact + 256);
    const VkMicromapEXT micromap = build(exact - std::min(exact, missing));
    FUZZ_CHECK((micromap != VK_NULL_HANDLE) == (missing == 0));
    if (!micromap)
        return;
    const uint64_t used = property(micromap, VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT) - kHeaderBytes;
    const uint64_t compacted = property(micromap, VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT);
    FUZZ_CHECK(used <= exact && compacted <= used);
    checkBuilt(model_, bytesOf(micromap).first(used));
    copy(micromap, compacted);
    serialize(micromap, used);
}

} // namespace

void hostCommands(Reader &input)
{
    static FakeDevice device;
    Commands(device, input).run();
}

} // namespace vellum::fuzz
