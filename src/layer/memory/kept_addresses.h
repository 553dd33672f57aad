// Where the layer's tables lay in an earlier run, kept in a file, so that they can be asked for there again
// (bufferDeviceAddressCaptureReplay): on a GPU, that lets rewritten shaders have the same words in every run, as
// FixedMemory does on a CPU. Nothing but that depends on it. What cannot be read, or cannot be had again, is another
// address, which is kept instead.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

class KeptAddresses
{
public:
    static constexpr size_t kTables = 2;

    KeptAddresses() = default;
    ~KeptAddresses();
    KeptAddresses(const KeptAddresses &) = delete;
    KeptAddresses &operator=(const KeptAddresses &) = delete;

    // `stem`: begin of the path of files about this physical device and driver. Devices that exist at the same time
    // have different addresses, and files: the first device has the first.
    void open(const std::string &stem, const std::array<uint64_t, kTables> &tableBytes);
    [[nodiscard]] bool isOpen() const { return location_ >= 0; }
    // What is known of a table; zeros where nothing is.
    [[nodiscard]] ReplayAddress known(size_t table) const { return addresses_[table]; }
    // The table is there now.
    void set(size_t table, ReplayAddress address);
    // Writes the file, where anything has changed.
    void write();

private:
    [[nodiscard]] std::string path() const;
    [[nodiscard]] uint64_t checksum() const;
    void read();

    std::string stem_;
    int location_ = -1;
    std::array<uint64_t, kTables> tableBytes_{};
    std::array<ReplayAddress, kTables> addresses_{};
    bool changed_ = false;
};

} // namespace vellum::layer
