// SPDX-License-Identifier: Apache-2.0
#include "gpu/scene.h"

#include <algorithm>
#include <map>
#include <utility>

namespace vellum::gpu
{
namespace
{

constexpr VkBufferUsageFlags kBuildInput =
    VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;

std::vector<VkMicromapUsageEXT> toUsage(const std::map<std::pair<uint32_t, uint32_t>, uint32_t> &counts, uint32_t form)
{
    std::vector<VkMicromapUsageEXT> usage;
    for (const auto &[key, count] : counts)
        usage.push_back({count, key.second, key.first});
    if ((form & kUsageDescending) != 0)
        std::reverse(usage.begin(), usage.end());
    const size_t different = usage.size();
    for (size_t i = 0; (form & kUsageSplit) != 0 && i < different; ++i) {
        const uint32_t first = usage[i].count / 2;
        usage.push_back({usage[i].count - first, usage[i].subdivisionLevel, usage[i].format});
        usage[i].count = first;
    }
    if ((form & kUsageZeros) == 0)
        return usage;
    std::vector<VkMicromapUsageEXT> withZeros;
    for (size_t i = 0; i < usage.size(); ++i) {
        const VkMicromapUsageEXT &next = usage[(i + 1) % usage.size()];
        withZeros.push_back({0, next.subdivisionLevel, next.format});
        withZeros.push_back(usage[i]);
    }
    return withZeros;
}

uint32_t bitsOf(const VkMicromapTriangleEXT &triangle)
{
    return (triangle.format == kTwoState ? 1u : 2u) << (2 * triangle.subdivisionLevel);
}

// The position of the bits of `own` in the data; nothing if it is not found or `own` is long.
std::optional<uint32_t> findData(std::span<const uint8_t> data, std::span<const uint8_t> own, uint32_t bits)
{
    constexpr size_t kMost = 64;
    if (own.size() > kMost)
        return {};
    const auto mask = static_cast<uint8_t>(bits < 8 ? (1u << bits) - 1 : 0xff);
    const auto found = std::search(data.begin(), data.end(), own.begin(), own.end(),
                                   [mask](uint8_t a, uint8_t b) { return (a & mask) == (b & mask); });
    return found == data.end() ? std::nullopt : std::optional(static_cast<uint32_t>(found - data.begin()));
}

constexpr uint8_t kGarbage = 0x5a; // must not be read

std::shared_ptr<Guarded> inputOf(Device &gpu, BuildInputs *inputs, const void *content, VkDeviceSize size,
                                 VkBufferUsageFlags usage, VkDeviceSize alignment)
{
    return inputs != nullptr ? inputs->upload(content, size, usage, alignment)
                             : std::make_shared<Guarded>(uploadAligned(gpu, content, size, usage, alignment));
}

// The geometry as a query of sizes may have it: "any VkDeviceOrHostAddressKHR or VkDeviceOrHostAddressConstKHR members
// of pBuildInfo are ignored by this command, except that the hostAddress member of
// VkAccelerationStructureGeometryTrianglesDataKHR::transformData will be examined to check if it is NULL"
// (vkGetAccelerationStructureBuildSizesKHR).
VkAccelerationStructureGeometryKHR withoutAddresses(const VkAccelerationStructureGeometryKHR &geometry)
{
    constexpr VkDeviceAddress kNone = 0x5a5a5a5a5a5a5a00;
    VkAccelerationStructureGeometryKHR out = geometry;
    if (geometry.geometryType == VK_GEOMETRY_TYPE_TRIANGLES_KHR) {
        VkAccelerationStructureGeometryTrianglesDataKHR &triangles = out.geometry.triangles;
        triangles.vertexData.deviceAddress = triangles.indexData.deviceAddress = kNone;
        if (triangles.transformData.hostAddress != nullptr)
            triangles.transformData.deviceAddress = kNone;
    } else if (geometry.geometryType == VK_GEOMETRY_TYPE_AABBS_KHR) {
        out.geometry.aabbs.data.deviceAddress = kNone;
    } else if (geometry.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR) {
        out.geometry.instances.data.deviceAddress = kNone;
    }
    return out;
}

uint32_t bytesOf(VkIndexType type)
{
    return type == VK_INDEX_TYPE_UINT32 ? 4 : type == VK_INDEX_TYPE_UINT8_EXT ? 1 : 2;
}

// The address of a structure, and of a micromap of VK_KHR_opacity_micromap. "If the acceleration structure was created
// with vkCreateAccelerationStructure2KHR, the return value will be the same address as addressRange.address"; "The
// returned address must be aligned to 256 bytes" (vkGetAccelerationStructureDeviceAddressKHR). created: that address,
// or 0
VkDeviceAddress addressOf(Device &gpu, VkAccelerationStructureKHR structure, VkDeviceAddress created)
{
    auto query = vkInit<VkAccelerationStructureDeviceAddressInfoKHR>({.accelerationStructure = structure});
    const VkDeviceAddress address = gpu.vk().GetAccelerationStructureDeviceAddressKHR(gpu.device(), &query);
    if (created != 0 && address != created)
        gpu.fault(
            "vkGetAccelerationStructureDeviceAddressKHR: an address other than that of the structure's creation (" +
            std::to_string(static_cast<int64_t>(address - created)) + " bytes from it)");
    if (address % 256 != 0)
        gpu.fault("vkGetAccelerationStructureDeviceAddressKHR: an address that is no multiple of 256");
    return address;
}

} // namespace

std::vector<uint8_t> packIndices(const Attachment &attachment, VkDeviceSize stride)
{
    const VkDeviceSize one = bytesOf(attachment.indexType);
    const size_t count = attachment.indices.size();
    std::vector<uint8_t> packed(attachment.indexOffset + std::max(stride * count, one), kGarbage);
    for (size_t i = 0; i < (stride == 0 ? std::min<size_t>(count, 1) : count); ++i) {
        const auto value = static_cast<uint32_t>(attachment.indices[i]);
        std::memcpy(packed.data() + attachment.indexOffset + i * stride, &value, one);
    }
    return packed;
}

uint32_t MicromapInput::add(uint32_t level, uint16_t format, std::span<const uint8_t> states)
{
    const uint32_t bits = format == kTwoState ? 1 : 2;
    VkMicromapTriangleEXT triangle{};
    triangle.dataOffset = static_cast<uint32_t>(data.size());
    triangle.subdivisionLevel = static_cast<uint16_t>(level);
    triangle.format = format;
    data.resize(data.size() + (states.size() * bits + 7) / 8);
    for (size_t i = 0; i < states.size(); ++i) {
        const size_t bit = i * bits;
        uint8_t &byte = data[triangle.dataOffset + bit / 8];
        byte = static_cast<uint8_t>(byte | (states[i] << (bit % 8)));
    }
    triangles.push_back(triangle);
    return static_cast<uint32_t>(triangles.size() - 1);
}

std::vector<VkMicromapUsageEXT> MicromapInput::usage() const
{
    if (!declared.empty())
        return declared;
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> counts;
    for (const VkMicromapTriangleEXT &t : triangles)
        ++counts[{t.format, t.subdivisionLevel}];
    return toUsage(counts, usageForm);
}

void MicromapInput::layOut(uint32_t layout)
{
    if (layout == 0)
        return;
    const std::vector<uint8_t> packed = std::exchange(data, {});
    for (size_t n = 0; n < triangles.size(); ++n) {
        const size_t i = (layout & kDataDescending) != 0 ? triangles.size() - 1 - n : n;
        const uint32_t bits = bitsOf(triangles[i]);
        std::vector<uint8_t> own(packed.begin() + triangles[i].dataOffset,
                                 packed.begin() + triangles[i].dataOffset + (bits + 7) / 8);
        if ((layout & kDataOverlapping) != 0) {
            if (const auto found = findData(data, own, bits)) {
                triangles[i].dataOffset = *found;
                continue;
            }
        }
        if ((layout & kDataGaps) != 0) {
            data.insert(data.end(), 1 + i % 7, 0x5a);
            if (bits < 8)
                own[0] = static_cast<uint8_t>(own[0] | (0xa5u << bits));
        }
        triangles[i].dataOffset = static_cast<uint32_t>(data.size());
        data.insert(data.end(), own.begin(), own.end());
    }
}

std::vector<VkMicromapUsageEXT> MicromapInput::usage(std::span<const int32_t> indices, uint32_t base,
                                                     uint32_t form) const
{
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> counts;
    for (const int32_t i : indices) {
        if (i < 0 || static_cast<size_t>(i) + base >= triangles.size())
            continue;
        const VkMicromapTriangleEXT &t = triangles[static_cast<size_t>(i) + base];
        ++counts[{t.format, t.subdivisionLevel}];
    }
    return toUsage(counts, form);
}

Micromap::Micromap(Device &gpu, MicromapInput input, VkBuildMicromapFlagsEXT flags, SharedScratch *scratch,
                   BuildInputs *inputs)
    : gpu_(gpu), input_(std::move(input)), flags_(flags), inputs_(inputs)
{
    describe();
    const VkMicromapBuildSizesInfoEXT sizes = micromapSizes(gpu_, info_, input_.onHost);
    create(sizes.micromapSize);
    upload(scratch, sizes.buildScratchSize);
}

bool Micromap::setInput(MicromapInput input, SharedScratch *scratch)
{
    input_ = std::move(input);
    describe();
    const VkMicromapBuildSizesInfoEXT sizes = micromapSizes(gpu_, info_, input_.onHost);
    if (sizes.micromapSize > size())
        return false;
    upload(scratch, sizes.buildScratchSize);
    return true;
}

void Micromap::describe()
{
    usage_ = input_.usage();
    info_ = vkInit<VkMicromapBuildInfoEXT>({.type = VK_MICROMAP_TYPE_OPACITY_MICROMAP_EXT,
                                            .flags = flags_,
                                            .mode = VK_BUILD_MICROMAP_MODE_BUILD_EXT,
                                            .usageCountsCount = static_cast<uint32_t>(usage_.size()),
                                            .pUsageCounts = input_.usagePointers ? nullptr : usage_.data(),
                                            .triangleArrayStride = input_.stride});
    if (input_.usagePointers) {
        scattered_ = scattered(usage_, usagePointers_);
        info_.ppUsageCounts = usagePointers_.data();
    }
}

void Micromap::upload(SharedScratch *scratch, VkDeviceSize scratchSize)
{
    std::vector<uint8_t> strided(input_.stride * input_.triangles.size(), kGarbage);
    for (size_t i = 0; i < input_.triangles.size(); ++i)
        std::memcpy(strided.data() + i * input_.stride, &input_.triangles[i], sizeof(VkMicromapTriangleEXT));
    const VkBufferUsageFlags usage = micromapInputUsage(gpu_);
    const VkDeviceSize alignment = micromapInputAlignment(gpu_);
    data_ = inputOf(gpu_, inputs_, input_.data.data(), input_.data.size(), usage, alignment);
    triangles_ = inputOf(gpu_, inputs_, strided.data(), strided.size(), usage, alignment);
    scratch_ = scratchOf(gpu_, scratch, scratchSize);
    info_.dstMicromap = handle_.ext;
    info_.data.deviceAddress = data_->address();
    info_.triangleArray.deviceAddress = triangles_->address();
    info_.scratchData.deviceAddress = scratch_->address();
}

Micromap::Micromap(Device &gpu, const Micromap &like, VkDeviceSize size)
    : gpu_(gpu), input_(like.input_), flags_(like.flags_), inputs_(like.inputs_)
{
    create(size);
}

void Micromap::create(VkDeviceSize size)
{
    storage_ = Guarded(gpu_, size, 256, micromapStorageUsage(gpu_));
    // A clone of a VkMicromapEXT "must have been created with the same parameters" (VkCopyMicromapModeEXT), its size
    // among them.
    const VkDeviceSize handleSize = gpu_.khr() ? storage_.handleSize() : size;
    handle_ =
        createMicromap(gpu_, storage_.buffer(), storage_.address() - storage_.offset(), storage_.offset(), handleSize,
                       handleSize != size ? VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR
                                          : VK_ACCELERATION_STRUCTURE_TYPE_OPACITY_MICROMAP_KHR);
    if (handle_.khr != VK_NULL_HANDLE)
        addressOf(gpu_, handle_.khr, storage_.address());
    gpu_.keepPrivateData(handle_.objectType(), handle_.object());
}

Micromap::~Micromap()
{
    if (!storage_.intact())
        gpu_.fault("a build wrote beyond its micromap" + storage_.damage());
    if (scratch_ && !scratch_->intact())
        gpu_.fault("a micromap build wrote beyond its scratch memory" + scratch_->damage());
    if (scratch_ && !(data_->intact() && triangles_->intact()))
        gpu_.fault("a micromap build wrote to its input");
    if (handle_.object() != 0)
        gpu_.expectPrivateData(handle_.objectType(), handle_.object());
    destroyMicromap(gpu_, handle_);
}

void Micromap::record(VkCommandBuffer commands)
{
    recordMicromapBuilds(gpu_, commands, std::array{MicromapBuild{info_, handle_}});
}

void Micromap::build()
{
    gpu_.submit([this](VkCommandBuffer commands) { record(commands); });
}

VkMicromapBuildInfoEXT Micromap::hostBuildInfo() const
{
    VkMicromapBuildInfoEXT info = info_;
    info.data.hostAddress = data_->bytes();
    info.triangleArray.hostAddress = triangles_->bytes();
    info.scratchData.hostAddress = scratch_->bytes();
    return info;
}

void Micromap::buildOnHost(bool deferred) const
{
    const VkMicromapBuildInfoEXT info = hostBuildInfo();
    HostCommands(gpu_, deferred).build(std::span(&info, 1));
}

void Micromap::scribble()
{
    for (const auto &buffer : {data_, triangles_, scratch_})
        std::memset(buffer->bytes(), 0x99, static_cast<size_t>(buffer->size()));
}

void Micromap::forgetInput()
{
    data_.reset();
    triangles_.reset();
    scratch_.reset();
}

uint32_t Geometry::primitives() const
{
    if (isAabbs || !boxes.empty())
        return static_cast<uint32_t>(boxes.size());
    return static_cast<uint32_t>(
               (indexType == VK_INDEX_TYPE_NONE_KHR ? vertices.size() - firstVertex : indices.size()) / 3) -
           skippedTriangles - spareTriangles;
}

Structure::~Structure()
{
    destroy();
}

void Structure::destroy()
{
    checkGuards();
    if (structure_ != VK_NULL_HANDLE)
        gpu_.expectPrivateData(VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(structure_));
    gpu_.vk().DestroyAccelerationStructureKHR(gpu_.device(), structure_, nullptr);
    structure_ = VK_NULL_HANDLE;
}

void Structure::checkGuards() const
{
    if (placedBuffer_ == VK_NULL_HANDLE && structure_ != VK_NULL_HANDLE && !storage_->intact())
        gpu_.fault("a build wrote beyond its acceleration structure" + storage_->damage());
    if (structure_ != VK_NULL_HANDLE && scratch_ && !scratch_->intact())
        gpu_.fault("an acceleration structure build wrote beyond its scratch memory" + scratch_->damage());
}

void Structure::placeIn(VkBuffer buffer, VkDeviceSize offset)
{
    placedBuffer_ = buffer;
    placedOffset_ = offset;
}

void Structure::create(VkDeviceSize size)
{
    destroy();
    size_ = size;
    if (placedBuffer_ == VK_NULL_HANDLE)
        storage_ = reusedStorage_ && reusedStorage_->size() >= size_
                       ? reusedStorage_
                       : std::make_shared<Guarded>(gpu_, size_, 256, gpu_.structureUsage());
    reusedStorage_.reset();
    auto create = vkInit<VkAccelerationStructureCreateInfoKHR>(
        {.buffer = placedBuffer_ != VK_NULL_HANDLE ? placedBuffer_ : storage_->buffer(),
         .offset = placedBuffer_ != VK_NULL_HANDLE ? placedOffset_ : storage_->offset(),
         .size = placedBuffer_ != VK_NULL_HANDLE ? size_ : storage_->handleSize()});
    create.type = create.size != size_ ? VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR : type_;
    // In packed memory, every other one by its address, where the API has that.
    const bool byAddress = gpu_.has(VK_KHR_DEVICE_ADDRESS_COMMANDS_EXTENSION_NAME) && gpu_.arena() != nullptr &&
                           placedBuffer_ == VK_NULL_HANDLE && create.offset / 256 % 2 != 0;
    if (byAddress) {
        auto create2 = vkInit<VkAccelerationStructureCreateInfo2KHR>(
            {.addressRange = {storage_->address(), create.size}, .addressFlags = kUnknownUsage, .type = create.type});
        CHECK_VK(gpu_.vk().CreateAccelerationStructure2KHR(gpu_.device(), &create2, nullptr, &structure_));
    } else {
        CHECK_VK(gpu_.vk().CreateAccelerationStructureKHR(gpu_.device(), &create, nullptr, &structure_));
    }
    address_ = addressOf(gpu_, structure_, byAddress ? storage_->address() : 0);
    if (placedBuffer_ == VK_NULL_HANDLE && !byAddress && create.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
        storage_->expectConsistent(address_);
    gpu_.keepPrivateData(VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, reinterpret_cast<uint64_t>(structure_));
}

void Structure::prepareBuild(VkBuildAccelerationStructureFlagsKHR flags, VkBuildAccelerationStructureModeKHR mode,
                             std::span<const uint32_t> maxPrimitives)
{
    info_ =
        vkInit<VkAccelerationStructureBuildGeometryInfoKHR>({.type = type_,
                                                             .flags = flags,
                                                             .mode = mode,
                                                             .geometryCount = static_cast<uint32_t>(geometries_.size()),
                                                             .pGeometries = geometries_.data()});
    if (usesPointers_) {
        // Backwards in memory, and twice, so that neither the first element nor an array behind it is mistaken for
        // them.
        pointedTo_.assign(geometries_.rbegin(), geometries_.rend());
        pointedTo_.insert(pointedTo_.end(), geometries_.rbegin(), geometries_.rend());
        pointers_.clear();
        for (size_t i = geometries_.size(); i-- > 0;)
            pointers_.push_back(&pointedTo_[i]);
        info_.pGeometries = nullptr;
        info_.ppGeometries = pointers_.data();
    }
    maxPrimitives_.assign(maxPrimitives.begin(), maxPrimitives.end());
    std::vector<VkAccelerationStructureGeometryKHR> described;
    std::vector<const VkAccelerationStructureGeometryKHR *> describedPointers;
    for (const VkAccelerationStructureGeometryKHR &geometry : geometries_)
        described.push_back(withoutAddresses(geometry));
    for (const VkAccelerationStructureGeometryKHR &geometry : described)
        describedPointers.push_back(&geometry);
    VkAccelerationStructureBuildGeometryInfoKHR query = info_;
    query.pGeometries = usesPointers_ ? nullptr : described.data();
    query.ppGeometries = usesPointers_ ? describedPointers.data() : nullptr;
    auto sizes = vkInit<VkAccelerationStructureBuildSizesInfoKHR>();
    gpu_.vk().GetAccelerationStructureBuildSizesKHR(gpu_.device(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR,
                                                    &query, maxPrimitives.data(), &sizes);
    const bool update = mode == VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
    // A compacted one is large enough for its updates in place: VUID-vkCmdBuildAccelerationStructuresKHR-pInfos-10126.
    if (sizes.accelerationStructureSize > size_ && !update)
        create(sizes.accelerationStructureSize);
    const Structure *const source = update ? std::exchange(source_, nullptr) : nullptr;
    if (source != nullptr)
        create(exact_ ? sizes.accelerationStructureSize : source->size());
    scratch_ = scratchOf(gpu_, sharedScratch_, update ? sizes.updateScratchSize : sizes.buildScratchSize);
    info_.srcAccelerationStructure = source != nullptr ? source->handle() : update ? structure_ : VK_NULL_HANDLE;
    info_.dstAccelerationStructure = structure_;
    info_.scratchData.deviceAddress = scratch_->address();
}

void Structure::record(VkCommandBuffer commands) const
{
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = ranges_.data();
    gpu_.vk().CmdBuildAccelerationStructuresKHR(commands, 1, &info_, &ranges);
}

std::shared_ptr<Guarded> Structure::uploadInput(const void *content, size_t size, size_t alignment) const
{
    return inputOf(gpu_, inputMemory_, content, size, kBuildInput, alignment);
}

VkDeviceAddress Blas::upload(const void *content, size_t size, size_t alignment)
{
    // With many geometries, their inputs share buffers: devices allow as few as 4096 allocations.
    constexpr size_t kManyGeometries = 128, kSharedBytes = size_t{1} << 20;
    if (inputs_.size() < kManyGeometries || size > kSharedBytes) {
        buffers_.push_back(uploadInput(content, size, alignment));
        filled_ = kSharedBytes;
        return buffers_.back()->address();
    }
    size_t begin = (filled_ + alignment - 1) / alignment * alignment;
    if (buffers_.empty() || begin + size > kSharedBytes) {
        buffers_.push_back(std::make_shared<Guarded>(gpu(), kSharedBytes, 256, kBuildInput));
        begin = 0;
    }
    filled_ = begin + size;
    buffers_.back()->write(begin, content, size);
    return buffers_.back()->address() + begin;
}

void Blas::describeBoxes(const Geometry &input, VkAccelerationStructureGeometryAabbsDataKHR &boxes,
                         VkAccelerationStructureBuildRangeInfoKHR &range)
{
    const uint32_t stride = input.stride != 0 ? input.stride : sizeof(VkAabbPositionsKHR);
    std::vector<uint8_t> bytes(input.leadingBytes + std::max<size_t>(input.boxes.size(), 1) * stride, kGarbage);
    for (size_t i = 0; i < input.boxes.size(); ++i)
        std::memcpy(bytes.data() + input.leadingBytes + i * stride, &input.boxes[i], sizeof input.boxes[i]);
    boxes = vkInit<VkAccelerationStructureGeometryAabbsDataKHR>({.stride = stride});
    boxes.data.deviceAddress = upload(bytes.data(), bytes.size(), 8);
    range.primitiveOffset = input.leadingBytes;
}

void Blas::describeTriangles(const Geometry &input, VkAccelerationStructureGeometryTrianglesDataKHR &triangles,
                             VkAccelerationStructureBuildRangeInfoKHR &range)
{
    const VertexFormat format = vertexFormat(input.vertexFormat);
    const uint32_t stride = input.stride != 0 ? input.stride : format.bytes;
    const bool indexed = input.indexType != VK_INDEX_TYPE_NONE_KHR;
    const uint32_t indexBytes = indexed ? bytesOf(input.indexType) : 0;
    const size_t before = indexed ? 0 : input.leadingBytes;
    std::vector<uint8_t> bytes(before + std::max<size_t>(input.vertices.size(), 1) * stride, kGarbage);
    for (size_t i = 0; i < input.vertices.size(); ++i)
        writeVertex(input.vertexFormat, input.vertices[i], static_cast<uint32_t>(i),
                    bytes.data() + before + i * stride);
    triangles = vkInit<VkAccelerationStructureGeometryTrianglesDataKHR>(
        {.vertexFormat = input.vertexFormat,
         .vertexStride = stride,
         .maxVertex = static_cast<uint32_t>(bytes.size() / stride) - 1,
         .indexType = input.indexType});
    triangles.vertexData.deviceAddress = upload(bytes.data(), bytes.size(), format.alignment);
    if (indexed) {
        bytes.assign(input.leadingBytes + std::max<size_t>(input.indices.size(), 1) * indexBytes, kGarbage);
        for (size_t i = 0; i < input.indices.size(); ++i)
            std::memcpy(bytes.data() + input.leadingBytes + i * indexBytes, &input.indices[i], indexBytes);
        triangles.indexData.deviceAddress = upload(bytes.data(), bytes.size(), indexBytes);
    }
    if (input.transform) {
        bytes.assign(input.transformOffset + sizeof *input.transform, kGarbage);
        std::memcpy(bytes.data() + input.transformOffset, &*input.transform, sizeof *input.transform);
        triangles.transformData.deviceAddress = upload(bytes.data(), bytes.size(), 16);
    }
    range.primitiveOffset = input.leadingBytes + input.skippedTriangles * 3 * (indexed ? indexBytes : stride);
    range.firstVertex = input.firstVertex;
    range.transformOffset = input.transformOffset;
}

void Blas::prepare(std::vector<Geometry> geometries, VkBuildAccelerationStructureFlagsKHR flags,
                   VkBuildAccelerationStructureModeKHR mode)
{
    inputs_ = std::move(geometries);
    buffers_.clear();
    usages_.assign(inputs_.size(), {});
    usagePointers_.assign(inputs_.size(), {});
    attachments_.assign(inputs_.size(), {});
    attachmentsKhr_.assign(inputs_.size(), {});
    geometries_.clear();
    ranges_.clear();
    std::vector<uint32_t> counts;
    for (size_t i = 0; i < inputs_.size(); ++i) {
        const Geometry &input = inputs_[i];
        auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.flags = input.flags});
        VkAccelerationStructureBuildRangeInfoKHR range{};
        range.primitiveCount = input.primitives();
        if (input.isAabbs || !input.boxes.empty()) {
            geometry.geometryType = VK_GEOMETRY_TYPE_AABBS_KHR;
            describeBoxes(input, geometry.geometry.aabbs, range);
        } else {
            geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
            describeTriangles(input, geometry.geometry.triangles, range);
        }
        if (input.micromap) {
            const Attachment &attachment = *input.micromap;
            VkAccelerationStructureTrianglesOpacityMicromapEXT &out = attachments_[i];
            out = vkInit<VkAccelerationStructureTrianglesOpacityMicromapEXT>(
                {.indexType = attachment.indexType, .baseTriangle = attachment.base});
            std::vector<int32_t> used = attachment.indices;
            if (attachment.indexType == VK_INDEX_TYPE_NONE_KHR) {
                used.clear();
                for (uint32_t p = 0; p < input.primitives(); ++p)
                    used.push_back(static_cast<int32_t>(p));
            } else {
                const uint32_t size = bytesOf(attachment.indexType);
                out.indexStride = attachment.stride.value_or(size);
                if (out.indexStride == 0 && !used.empty())
                    used.assign(used.size(), used[0]);
                const std::vector<uint8_t> packed = packIndices(attachment, out.indexStride);
                out.indexBuffer.deviceAddress = upload(packed.data(), packed.size(), size) + attachment.indexOffset;
            }
            if (attachment.micromap != nullptr) {
                usages_[i] = attachment.micromap->input().usage(used, attachment.base, attachment.usageForm);
                out.micromap = attachment.micromap->handle().ext;
            }
            out.usageCountsCount = static_cast<uint32_t>(usages_[i].size());
            if (attachment.usagePointers)
                usages_[i] = scattered(usages_[i], usagePointers_[i]);
            out.pUsageCounts = attachment.usagePointers ? nullptr : usages_[i].data();
            out.ppUsageCounts = attachment.usagePointers ? usagePointers_[i].data() : nullptr;
            geometry.geometry.triangles.pNext = &out;
            const bool khr =
                attachment.micromap != nullptr ? attachment.micromap->handle().khr != VK_NULL_HANDLE : gpu().khr();
            if (khr) {
                VkAccelerationStructureTrianglesOpacityMicromapKHR &own = attachmentsKhr_[i];
                own = vkInit<VkAccelerationStructureTrianglesOpacityMicromapKHR>(
                    {.indexType = out.indexType,
                     .indexBuffer = out.indexBuffer.deviceAddress,
                     .indexStride = out.indexStride,
                     .baseTriangle = out.baseTriangle,
                     .micromap = attachment.micromap != nullptr ? attachment.micromap->handle().khr : VK_NULL_HANDLE});
                geometry.geometry.triangles.pNext = &own;
            }
        }
        geometries_.push_back(geometry);
        ranges_.push_back(range);
        counts.push_back(range.primitiveCount + input.spareTriangles);
    }
    usePointers(std::ranges::any_of(inputs_, &Geometry::byPointer));
    prepareBuild(flags, mode, counts);
}

void Blas::build(std::vector<Geometry> geometries, VkBuildAccelerationStructureFlagsKHR flags,
                 VkBuildAccelerationStructureModeKHR mode)
{
    prepare(std::move(geometries), flags, mode);
    gpu().submit([this](VkCommandBuffer commands) { record(commands); });
}

StructureBuilds::StructureBuilds(Device &gpu, std::span<const Structure *const> structures, bool indirect) : gpu_(gpu)
{
    std::vector<VkAccelerationStructureBuildRangeInfoKHR> all;
    for (const Structure *structure : structures) {
        infos_.push_back(structure->buildInfo());
        ranges_.push_back(structure->ranges());
        const uint32_t geometries = infos_.back().geometryCount;
        addresses_.push_back(all.size() * sizeof(all[0]));
        all.insert(all.end(), structure->ranges(), structure->ranges() + geometries);
        strides_.push_back(sizeof(all[0]));
        std::vector<uint32_t> &counts = counts_.emplace_back();
        for (uint32_t g = 0; g < geometries; ++g)
            counts.push_back(structure->maxPrimitives(g));
    }
    if (!indirect)
        return;
    memory_ = gpu_.upload(std::span<const VkAccelerationStructureBuildRangeInfoKHR>(all),
                          VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT |
                              VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR);
    for (VkDeviceAddress &address : addresses_)
        address += memory_.address();
    for (const std::vector<uint32_t> &counts : counts_)
        maxCounts_.push_back(counts.data());
}

void StructureBuilds::record(VkCommandBuffer commands) const
{
    const auto count = static_cast<uint32_t>(infos_.size());
    if (count == 0)
        return;
    if (maxCounts_.empty())
        gpu_.vk().CmdBuildAccelerationStructuresKHR(commands, count, infos_.data(), ranges_.data());
    else
        gpu_.vk().CmdBuildAccelerationStructuresIndirectKHR(commands, count, infos_.data(), addresses_.data(),
                                                            strides_.data(), maxCounts_.data());
}

VkAccelerationStructureInstanceKHR instance(const Structure &blas, Vec3 place, uint32_t customIndex, uint32_t flags,
                                            uint32_t mask)
{
    VkAccelerationStructureInstanceKHR out{};
    for (size_t i = 0; i < 3; ++i) {
        out.transform.matrix[i][i] = 1;
        out.transform.matrix[i][3] = place[i];
    }
    out.instanceCustomIndex = customIndex & 0xffffffu;
    out.mask = mask & 0xffu;
    out.flags = flags & 0xffu;
    out.accelerationStructureReference = blas.address();
    return out;
}

void Tlas::prepare(std::span<const VkAccelerationStructureInstanceKHR> instances,
                   VkBuildAccelerationStructureFlagsKHR flags, VkBuildAccelerationStructureModeKHR mode,
                   Arrangement arrangement, uint32_t skipped, uint32_t spare)
{
    // The skipped ones hold garbage, which must not be read.
    std::vector<VkAccelerationStructureInstanceKHR> all(skipped);
    if (skipped > 0)
        std::memset(static_cast<void *>(all.data()), 0x5a, all.size() * sizeof(all[0]));
    all.insert(all.end(), instances.begin(), instances.end());
    instances_ = uploadInput(all.data(), all.size() * sizeof(all[0]), 16);
    auto geometry = vkInit<VkAccelerationStructureGeometryKHR>({.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR});
    VkAccelerationStructureGeometryInstancesDataKHR &data = geometry.geometry.instances;
    data = vkInit<VkAccelerationStructureGeometryInstancesDataKHR>();
    data.data.deviceAddress = instances_->address();
    VkAccelerationStructureBuildRangeInfoKHR range{};
    range.primitiveCount = static_cast<uint32_t>(instances.size());
    range.primitiveOffset = skipped * static_cast<uint32_t>(sizeof(VkAccelerationStructureInstanceKHR));
    if (arrangement == Arrangement::Pointers) {
        // Backwards in memory, so that array and pointers cannot be mistaken for each other. Two pointers for each
        // skipped one: VUID-VkAccelerationStructureBuildRangeInfoKHR-primitiveOffset-03660 demands multiples of 16.
        std::vector<VkDeviceAddress> addresses(2 * size_t{skipped}, 0x5a5a5a5a5a5a5a50u);
        std::vector<VkAccelerationStructureInstanceKHR> reversed(instances.rbegin(), instances.rend());
        instances_ = uploadInput(reversed.data(), reversed.size() * sizeof(reversed[0]), 16);
        for (size_t i = 0; i < instances.size(); ++i)
            addresses.push_back(instances_->address() +
                                (instances.size() - 1 - i) * sizeof(VkAccelerationStructureInstanceKHR));
        pointers_ = uploadInput(addresses.data(), addresses.size() * sizeof(VkDeviceAddress), 8);
        data.arrayOfPointers = VK_TRUE;
        data.data.deviceAddress = pointers_->address();
        range.primitiveOffset = 2 * skipped * static_cast<uint32_t>(sizeof(VkDeviceAddress));
    }
    geometries_ = {geometry};
    ranges_ = {range};
    const uint32_t most = range.primitiveCount + spare;
    prepareBuild(flags, mode, std::span(&most, 1));
}

void Tlas::build(std::span<const VkAccelerationStructureInstanceKHR> instances,
                 VkBuildAccelerationStructureFlagsKHR flags, VkBuildAccelerationStructureModeKHR mode,
                 Arrangement arrangement, uint32_t skipped)
{
    prepare(instances, flags, mode, arrangement, skipped);
    gpu().submit([this](VkCommandBuffer commands) { record(commands); });
}

void appendTriangle(std::vector<Vec3> &vertices, Vec3 place)
{
    vertices.push_back(place);
    vertices.push_back({place[0] + 1, place[1], place[2]});
    vertices.push_back({place[0], place[1] + 1, place[2]});
}

std::vector<Vec3> triangleRow(uint32_t n, Vec3 place)
{
    std::vector<Vec3> vertices;
    for (uint32_t i = 0; i < n; ++i)
        appendTriangle(vertices, {place[0] + 1.5f * static_cast<float>(i), place[1], place[2]});
    return vertices;
}

std::array<std::array<double, 2>, 3> cornersOfMicroTriangle(uint32_t index, uint32_t level)
{
    using Point = std::array<double, 2>;
    const auto middle = [](Point p, Point q) { return Point{(p[0] + q[0]) / 2, (p[1] + q[1]) / 2}; };
    Point a{0, 0}, b{1, 0}, c{0, 1}; // the curve enters at a, leaves at c
    for (uint32_t l = level; l-- > 0;) {
        const Point ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
        // Each child starts where its predecessor ended: a..ca, ca..ab (flipped), ab..bc, bc..c (flipped).
        switch (index >> (2 * l) & 3u) {
        case 0: b = ab, c = ca; break;
        case 1: a = ca, b = bc, c = ab; break;
        case 2: a = ab, c = bc; break;
        default: a = bc, b = ca; break;
        }
    }
    return {a, b, c};
}

std::array<double, 2> microTriangleCentre(uint32_t index, uint32_t level)
{
    const auto [a, b, c] = cornersOfMicroTriangle(index, level);
    return {(a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3};
}

} // namespace vellum::gpu
