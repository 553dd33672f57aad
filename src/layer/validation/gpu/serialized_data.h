// SPDX-License-Identifier: Apache-2.0
// Serialized data, and sizes that only the device knows. The commands are checked when they are executed for the first
// time, and reported once that is complete.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include <vulkan/vulkan.h>

#include "layer/validation/model/contents.h"

namespace vellum::layer
{

struct DeviceModel;
struct GpuChecks;
class RuleCheck;

// The words at the beginning of serialized data that was deserialized.
class SerializedHeader
{
public:
    enum class State { NotRead, Read, Lost };
    // `capture`: a shader writes `count` words to it.
    SerializedHeader(std::shared_ptr<Capture> capture, uint32_t count) : capture_(std::move(capture)), count_(count) {}
    explicit SerializedHeader(std::vector<uint32_t> words) : own_(std::move(words)) {}

    // Lost: the command was executed several times, perhaps with other data.
    [[nodiscard]] State state() const;
    [[nodiscard]] std::span<const uint32_t> words() const; // once they are read
    // The addresses of micromaps in the blocks of the header, as far as there are words.
    [[nodiscard]] std::vector<VkDeviceAddress> micromaps() const;

    uint64_t number = 0;  // DeviceModel::numbers when the data was deserialized
    bool isWrong = false; // data in host memory, which was reported

private:
    std::vector<uint32_t> own_;
    std::shared_ptr<Capture> capture_;
    uint32_t count_ = 0;
};

// Checks that wait for the device.
class PendingChecks
{
public:
    // Returns whether it is done. If it reports a fault, it sets the bit of `found` for each kGpuError* by which an
    // emulation reports the same fault.
    using Check = std::function<bool(uint32_t &found)>;
    void add(Check check);
    // A fault was reported by another check; bits as of `found`.
    void found(uint32_t bits) { found_ |= bits; }
    // Evaluates the checks. When all are done, reports the errors of the emulation's shaders that no check has
    // reported.
    void report(DeviceModel &device);

private:
    std::atomic<bool> any_ = false; // read without the mutex
    std::mutex mutex_;
    std::vector<Check> checks_;
    std::atomic<uint32_t> found_ = 0; // one bit for each kGpuError* that checks have reported
};

// Checks data that is deserialized, before the command is recorded. Returns its header; null if it is not known.
std::shared_ptr<SerializedHeader> checkSerializedData(GpuChecks &gpu, const RuleCheck &check, VkDeviceAddress data,
                                                      const std::shared_ptr<ValidatedStructure> &target);
// As above, for data in host memory, before it is deserialized.
std::shared_ptr<SerializedHeader> checkSerializedData(const RuleCheck &check, const void *data,
                                                      const ValidatedStructure *target);

// Serialization needs no more memory than there is at `target`. Before the command is recorded.
void checkSerializedSize(GpuChecks &gpu, const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
                         VkDeviceAddress target);
// A compacted structure fits `target`. Before the command is recorded.
void checkCompactedSize(GpuChecks &gpu, const RuleCheck &check, const std::shared_ptr<ValidatedStructure> &source,
                        const std::shared_ptr<ValidatedStructure> &target);

// The fault of the micromaps of a structure that was deserialized, at the time of a number; empty: no fault is known.
// CommandLogs::submissions is held, and the header is read.
std::string wrongMicromapOf(const DeviceModel &device, const StructureContents &contents, uint64_t number);
// The micromaps of a structure that was deserialized are deserialized as well when the command is executed.
void checkDeserializedMicromaps(GpuChecks &gpu, const RuleCheck &check,
                                const std::shared_ptr<ValidatedStructure> &source, const char *vuid);

} // namespace vellum::layer
