// SPDX-License-Identifier: Apache-2.0
#include "layer/validation/gpu/serialized_data.h"

#include <algorithm>
#include <cstring>

#include "core/records.h"
#include "layer/input/checked.h"
#include "layer/input/copies.h"
#include "layer/rules/ids.h"
#include "layer/validation/gpu/gpu_checks.h"
#include "layer/validation/rules/rule_check.h"

namespace vellum::layer
{
namespace
{

// Words of the header of serialized data, as the specification has it.
constexpr size_t kVersionBytes = 2 * VK_UUID_SIZE;
constexpr size_t kTotalBytes = 8;
constexpr size_t kDeserializedBytes = 10;
constexpr size_t kBlockCount = 12;
constexpr size_t kBlockFormat = 13; // 0xffffffff: blocks follow, and not handles
constexpr size_t kFirstBlock = 14;
constexpr size_t kBlockWords = 4; // type, a reserved word, number of addresses
constexpr size_t kHeaderWords = 12;
constexpr uint32_t kMostWords = 2048; // the most words that are read

using Words = std::span<const uint32_t>;

uint64_t number64(Words words, size_t i)
{
    return words[i] | uint64_t{words[i + 1]} << 32;
}

// Calls visit(type, addresses) for each block, as far as there are words.
template <typename Visit>
void eachBlock(Words words, Visit visit)
{
    if (words.size() < kFirstBlock || words[kBlockFormat] != UINT32_MAX)
        return;
    size_t at = kFirstBlock;
    for (uint32_t b = 0; b < words[kBlockCount] && at + kBlockWords <= words.size(); ++b) {
        const uint64_t count = number64(words, at + 2);
        const size_t known = std::min<uint64_t>(count, (words.size() - at - kBlockWords) / 2);
        visit(words[at], words.subspan(at + kBlockWords, known * 2));
        if (known < count)
            return;
        at += kBlockWords + known * 2;
    }
}

// --- Headers ---

// A command whose data or sizes are known.
struct Command {
    DeviceModel &device;
    const std::string &place;
    const ValidatedStructure &structure;
    uint32_t &found; // one bit for each kGpuError* that an emulation reports for the same fault

    // `error`, `ofMicromaps`: the kGpuError* that an emulation reports for the same fault of a structure, of a
    // micromap.
    void fault(const char *vuid, const std::string &text, uint32_t error, uint32_t ofMicromaps) const
    {
        device.at(Place(place), structure.handle).report(vuid, nullptr, text);
        if (structure.isMicromap() || structure.type == VK_ACCELERATION_STRUCTURE_TYPE_GENERIC_KHR)
            found |= 1u << ofMicromaps;
        if (!structure.isMicromap())
            found |= 1u << error;
    }
};

struct HeaderIds {
    const char *compatible;
    const char *total;
    const char *size;
};
constexpr HeaderIds kExtIds{rules::ids::kMicromapCompatible, "VUID-VkCopyMemoryToMicromapInfoEXT-src-07547",
                            "VUID-VkCopyMemoryToMicromapInfoEXT-dst-07550"};
constexpr HeaderIds kKhrIds{rules::ids::kCompatible, rules::ids::kDamaged, rules::ids::kDeserializedSize};

bool isExt(const ValidatedStructure &structure)
{
    return structure.handle.type == VK_OBJECT_TYPE_MICROMAP_EXT;
}

bool isCompatible(const DeviceModel &device, Words words, bool ext)
{
    const auto *version = reinterpret_cast<const uint8_t *>(words.data());
    VkAccelerationStructureCompatibilityKHR result = VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
    if (ext) {
        const VkMicromapVersionInfoEXT info{VK_STRUCTURE_TYPE_MICROMAP_VERSION_INFO_EXT, nullptr, version};
        device.next.GetDeviceMicromapCompatibilityEXT(device.driver.handle, &info, &result);
    } else {
        const VkAccelerationStructureVersionInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_VERSION_INFO_KHR,
                                                         nullptr, version};
        device.driver.next.GetDeviceAccelerationStructureCompatibilityKHR(device.driver.handle, &info, &result);
    }
    return result == VK_ACCELERATION_STRUCTURE_COMPATIBILITY_COMPATIBLE_KHR;
}

void reportBlocks(const Command &command, Words words)
{
    DeviceModel &device = command.device;
    uint32_t block = 0;
    eachBlock(words, [&](uint32_t type, Words addresses) {
        const std::string where = "block " + std::to_string(block++) + " of the header at src ";
        const bool known = type == VK_ACCELERATION_STRUCTURE_SERIALIZED_BLOCK_TYPE_OPACITY_MICROMAP_KHR;
        if (!known || !device.driver.enabled.khrFeature) // emulation takes the data for damaged
            command.found |= 1u << shared::kGpuErrorDamagedData;
        if (!known) {
            device.at(Place(command.place), command.structure.handle)
                .report("VUID-VkCopyMemoryToAccelerationStructureInfoKHR-src-11583", nullptr,
                        where + "has the unknown type " + std::to_string(type));
            return;
        }
        if (!device.driver.enabled.khrFeature)
            device.at(Place(command.place), command.structure.handle)
                .report("VUID-VkCopyMemoryToAccelerationStructureInfoKHR-dst-11584", nullptr,
                        where + "names micromaps; the feature micromap is not enabled");
        for (size_t i = 0; i < addresses.size() && device.objects.byMemory.isComplete(); i += 2) {
            // 0: a geometry without a micromap.
            const VkDeviceAddress address = number64(addresses, i);
            if (address == 0 || device.objects.byMemory.everAt(address))
                continue;
            return command.fault(rules::ids::kDeserializedMicromaps,
                                 where + "has an address where no micromap begins: that of number " +
                                     std::to_string(i / 2),
                                 shared::kGpuErrorUnknownMicromap, shared::kGpuErrorMicromapData);
        }
    });
}

// Returns whether the data has sizes and blocks after the version. In that of micromaps the specification defines the
// version only; emulation writes the sizes as well. The content of a generic structure is unknown.
bool hasSizes(const DeviceModel &device, VkAccelerationStructureTypeKHR type)
{
    return device.emulated || type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR ||
           type == VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
}

// `readable`: bytes from the data to the end of its buffer.
void reportHeader(const Command &command, Words words, VkDeviceSize readable)
{
    const ValidatedStructure &target = command.structure;
    const bool ext = isExt(target);
    const HeaderIds &ids = ext ? kExtIds : kKhrIds;
    if (!isCompatible(command.device, words, ext))
        return command.fault(ids.compatible,
                             "the version in the header at src is not compatible with this device: the data is not "
                             "serialized data, or of another driver",
                             shared::kGpuErrorForeignData, shared::kGpuErrorMicromapData);
    if (!hasSizes(command.device, target.type))
        return;
    const uint64_t total = number64(words, kTotalBytes);
    // "The size used to serialize" is that of the source, or of the serialized data: Khronos' tests of micromaps take
    // it for the latter.
    const uint64_t source = number64(words, kDeserializedBytes);
    const uint64_t size = target.isMicromap() ? std::min(source, total) : source;
    if (total > readable)
        command.fault(ids.total,
                      "the header at src states " + std::to_string(total) + " bytes; its buffer ends after " +
                          std::to_string(readable),
                      shared::kGpuErrorDamagedData, shared::kGpuErrorMicromapData);
    if (size > target.size)
        command.fault(ids.size,
                      "dst " + command.device.nameOf(target.handle) + " was created with " +
                          std::to_string(target.size) + " bytes; the header at src states that deserialization needs " +
                          std::to_string(size),
                      shared::kGpuErrorTargetTooSmall, shared::kGpuErrorMicromapTooSmall);
    if (!ext)
        reportBlocks(command, words);
}

// --- Sizes ---

// A query of the size of one structure, for one recording of a command.
class SizeQuery
{
public:
    SizeQuery(DeviceModel &device, VkQueryType type)
        : device_(device), type_(type), capture_(Capture::make(device.captureMemory, kResultWords, kResultWords))
    {
        VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
        info.queryType = type;
        info.queryCount = 1;
        if (capture_)
            device.next.CreateQueryPool(device.driver.handle, &info, nullptr, &pool_);
    }
    SizeQuery(const SizeQuery &) = delete;
    SizeQuery &operator=(const SizeQuery &) = delete;
    ~SizeQuery() { device_.next.DestroyQueryPool(device_.driver.handle, pool_, nullptr); }

    [[nodiscard]] bool exists() const { return pool_ != VK_NULL_HANDLE; }
    void record(VkCommandBuffer commandBuffer, const ValidatedStructure &structure) const
    {
        InjectedWork work(device_.commands, commandBuffer);
        work.barrier();
        device_.next.CmdResetQueryPool(commandBuffer, pool_, 0, 1);
        if (isExt(structure)) {
            const auto micromap = reinterpret_cast<VkMicromapEXT>(structure.handle.handle);
            auto query = queryOf(&micromap);
            const input::Checked checked(&micromap, query);
            device_.next.CmdWriteMicromapsPropertiesEXT(commandBuffer, 1, &micromap, type_, pool_, 0);
        } else {
            const auto handle = reinterpret_cast<VkAccelerationStructureKHR>(structure.handle.handle);
            auto query = queryOf(&handle);
            const input::Checked checked(&handle, query);
            device_.next.CmdWriteAccelerationStructuresPropertiesKHR(commandBuffer, 1, &handle, type_, pool_, 0);
        }
        // A query that was never reset must not be read by the host (VUID-vkGetQueryPoolResults-None-09401), and the
        // host does not know when this is executed. The availability that could be copied with the size has no order.
        device_.next.CmdCopyQueryPoolResults(commandBuffer, pool_, 0, 1, capture_->buffer(), capture_->offset(),
                                             sizeof(VkDeviceSize), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
        work.barrier(true);
        device_.driver.next.CmdFillBuffer(commandBuffer, capture_->buffer(),
                                          capture_->offset() + kAvailable * sizeof(uint32_t), sizeof(uint32_t), 1);
        work.barrier(true);
    }
    // Nothing before it was executed.
    [[nodiscard]] std::optional<VkDeviceSize> result() const
    {
        const uint32_t *words = capture_->words();
        if (__atomic_load_n(words + kAvailable, __ATOMIC_ACQUIRE) == 0)
            return std::nullopt;
        return number64({words, kResultWords}, 0);
    }

private:
    template <typename Handle>
    [[nodiscard]] input::PropertyQuery queryOf(const Handle *handle) const
    {
        input::PropertyQuery query = input::parseQuery(1, handle, type_, 0);
        query.byValidation = true;
        return query;
    }

    static constexpr size_t kAvailable = 2; // after the size
    static constexpr size_t kResultWords = 4;

    DeviceModel &device_;
    VkQueryType type_;
    std::shared_ptr<Capture> capture_;
    VkQueryPool pool_ = VK_NULL_HANDLE;
};

// Adds a check when the command is executed for the first time.
void addWhenExecuted(GpuChecks &gpu, const RuleCheck &check, PendingChecks::Check pending)
{
    check.afterExecution([&gpu, pending = std::move(pending)](bool) mutable {
        if (pending)
            gpu.pending.add(std::exchange(pending, nullptr));
    });
}

// The size of `source` is at most `most`. `error`: the kGpuError* that an emulation reports for the same fault.
void checkSize(GpuChecks &gpu, const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
               VkQueryType type, const char *vuid, VkDeviceSize most, const std::string &text, uint32_t error)
{
    DeviceModel &device = check.model();
    const CommandState *state = device.commands.states.get(check.commandBuffer());
    if (!device.checks.gpu || !source || !source->buffer || !source->buffer->memory || !state ||
        state->inheritsConditionalRendering)
        return;
    auto query = std::make_shared<SizeQuery>(device, type);
    if (!query->exists())
        return;
    query->record(check.commandBuffer(), *source);
    check.afterExecution([query](bool) {}); // it lives as long as the commands, which may be submitted again
    addWhenExecuted(gpu, check,
                    [&device, query = std::move(query), place = check.place().text(), vuid, most, text, source,
                     error](uint32_t &found) {
                        const auto size = query->result();
                        if (size && *size > most)
                            Command{device, place, *source, found}.fault(
                                vuid,
                                text + "; src " + device.nameOf(source->handle) + " needs " + std::to_string(*size),
                                error, shared::kGpuErrorMicromapTooSmall);
                        return size.has_value();
                    });
}

} // namespace

SerializedHeader::State SerializedHeader::state() const
{
    const uint32_t written = capture_ ? capture_->written() : 1;
    return written == 0 ? State::NotRead : written == 1 ? State::Read : State::Lost;
}

std::span<const uint32_t> SerializedHeader::words() const
{
    return capture_ ? std::span(capture_->words() + shared::kDeserializedWordsAt, count_) : std::span(own_);
}

std::vector<VkDeviceAddress> SerializedHeader::micromaps() const
{
    std::vector<VkDeviceAddress> found;
    eachBlock(words(), [&found](uint32_t, Words addresses) {
        for (size_t i = 0; i < addresses.size(); i += 2)
            found.push_back(number64(addresses, i));
    });
    return found;
}

void PendingChecks::add(Check check)
{
    const std::lock_guard lock(mutex_);
    checks_.push_back(std::move(check));
    any_ = true;
}

void PendingChecks::report(DeviceModel &device)
{
    if (!any_ && !device.reportGpuErrors)
        return;
    const HeldMessages held;
    if (any_) {
        const std::lock_guard submissions(device.logs.submissions); // change what structures hold
        const std::lock_guard lock(mutex_);
        uint32_t found = 0;
        std::erase_if(checks_, [&found](const Check &check) { return check(found); });
        found_ |= found;
        any_ = !checks_.empty();
    }
    if (any_ || !device.reportGpuErrors)
        return;
    device.reportGpuErrors(found_.exchange(0));
}

std::shared_ptr<SerializedHeader> checkSerializedData(GpuChecks &gpu, const RuleCheck &check, VkDeviceAddress data,
                                                      const std::shared_ptr<ValidatedStructure> &target)
{
    DeviceModel &device = check.model();
    const VkDeviceSize readable = device.buffers.addresses.bytesFrom(data);
    const CommandState *state = device.commands.states.get(check.commandBuffer());
    if (!device.checks.gpu || !target || !target->record || !state || state->inheritsConditionalRendering ||
        readable == UINT64_MAX || readable < kHeaderWords * 4 || data % 4 != 0)
        return nullptr;
    const auto count = static_cast<uint32_t>(std::min<VkDeviceSize>(readable / 4, kMostWords));
    auto capture =
        Capture::make(device.captureMemory, shared::kDeserializedWordsAt + count, shared::kDeserializedWordsAt);
    if (!capture)
        return nullptr;
    const shared::DeserializedWordsPush push{.source = data,
                                             .target = capture->address(),
                                             .record = device.records.addressOf(target->record.get()),
                                             .count = count,
                                             .unused = 0};
    {
        InjectedWork work(device.commands, check.commandBuffer());
        work.barrier();
        if (!work.dispatch(InjectedShader::DeserializedWords, push, 1, 1))
            return nullptr;
        work.barrier(true);
    }
    auto header = std::make_shared<SerializedHeader>(std::move(capture), count);
    check.afterExecution([&device, header](bool) { header->number = ++device.numbers; });
    addWhenExecuted(gpu, check, [&device, header, place = check.place().text(), readable, target](uint32_t &found) {
        if (header->state() == SerializedHeader::State::Read)
            reportHeader({device, place, *target, found}, header->words(), readable);
        return header->state() != SerializedHeader::State::NotRead;
    });
    return header;
}

std::shared_ptr<SerializedHeader> checkSerializedData(const RuleCheck &check, const void *data,
                                                      const ValidatedStructure *target)
{
    DeviceModel &device = check.model();
    if (!device.checks.gpu || !target || !data)
        return nullptr;
    std::vector<uint32_t> words(kHeaderWords);
    std::memcpy(words.data(), data, kVersionBytes);
    if (isCompatible(device, words, isExt(*target)) && hasSizes(device, target->type)) {
        std::memcpy(words.data(), data, kHeaderWords * sizeof(uint32_t));
        words.resize(std::min<uint64_t>(number64(words, kTotalBytes) / sizeof(uint32_t), kMostWords));
        words.resize(std::max(words.size(), kHeaderWords));
        std::memcpy(words.data(), data, words.size() * sizeof(uint32_t));
    }
    uint32_t found = 0;
    {
        const HeldMessages held;
        const std::lock_guard submissions(device.logs.submissions); // change what structures hold
        reportHeader({device, check.place().text(), *target, found}, words, UINT64_MAX);
    }
    auto header = std::make_shared<SerializedHeader>(std::move(words));
    header->isWrong = found != 0;
    header->number = ++device.numbers;
    return header;
}

void checkSerializedSize(GpuChecks &gpu, const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
                         VkDeviceAddress target)
{
    const VkDeviceSize most = check.model().buffers.addresses.bytesFrom(target);
    if (!source || most == UINT64_MAX)
        return;
    const bool ext = isExt(*source);
    checkSize(gpu, check, source,
              ext ? VK_QUERY_TYPE_MICROMAP_SERIALIZATION_SIZE_EXT
                  : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR,
              ext ? "VUID-VkCopyMicromapToMemoryInfoEXT-dst-07541" : rules::ids::kSerializedSize, most,
              "the buffer has " + std::to_string(most) + " bytes at dst", shared::kGpuErrorMemoryTooSmall);
}

void checkCompactedSize(GpuChecks &gpu, const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
                        const std::shared_ptr<ValidatedStructure> &target)
{
    if (!target)
        return;
    const bool ext = isExt(*target);
    checkSize(gpu, check, source,
              ext ? VK_QUERY_TYPE_MICROMAP_COMPACTED_SIZE_EXT : VK_QUERY_TYPE_ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR,
              ext ? "VELLUM-micromap-copy-size" : rules::ids::kCompactedSize, target->size,
              "dst " + check.model().nameOf(target->handle) + " was created with " + std::to_string(target->size) +
                  " bytes",
              shared::kGpuErrorCopyTooSmall);
}

std::string wrongMicromapOf(const DeviceModel &device, const StructureContents &contents, uint64_t number)
{
    const SerializedHeader &header = *contents.header;
    // Micromaps that were built before the structure was deserialized may be those of its original build, which
    // attached them.
    const auto isWrong = [&](const ValidatedStructure &micromap) {
        const auto &built = micromap.contents;
        const bool isAttached = micromap.mayBeAttached || (built && built->isAttached);
        return micromap.number <= number && micromap.since <= number &&
               (!built || (!built->deserialized && (micromap.built > header.number || !isAttached)));
    };
    if (!hasSizes(device, contents.type) || !device.objects.byMemory.isComplete())
        return {};
    for (const VkDeviceAddress address : header.micromaps()) {
        if (address == 0) // a geometry without a micromap
            continue;
        const auto known = device.objects.byMemory.at(address);
        if (known.empty() || !std::ranges::all_of(known, [&](const auto &micromap) { return isWrong(*micromap); }))
            continue;
        const ValidatedStructure &micromap = *known.front();
        return "the structure was deserialized; its micromap " + device.nameOf(micromap.handle) +
               (micromap.contents ? " was built, and not deserialized" : " was not deserialized");
    }
    return {};
}

void checkDeserializedMicromaps(GpuChecks &gpu, const RuleCheck &check,
                                const std::shared_ptr<ValidatedStructure> &source, const char *vuid)
{
    if (!source)
        return;
    DeviceModel &device = check.model();
    device.logs.add(check.commandBuffer(), [&device, &gpu, place = check.place().text(), source,
                                            vuid](const Submission &submission) {
        const auto contents = source->contents;
        if (!contents || !contents->header || !submission.ordered)
            return;
        gpu.pending.add([&device, place, source, vuid, contents, number = device.numbers.load()](uint32_t &) {
            if (contents->header->state() == SerializedHeader::State::NotRead)
                return false;
            if (contents->header->state() == SerializedHeader::State::Read)
                if (const std::string wrong = wrongMicromapOf(device, *contents, number); !wrong.empty())
                    device.at(Place(place), source->handle).report(vuid, nullptr, wrong);
            return true;
        });
    });
}

} // namespace vellum::layer
