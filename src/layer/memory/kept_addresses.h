// SPDX-License-Identifier: Apache-2.0
// The addresses of the layer's tables in an earlier run. A file keeps them, so that the tables can get the same
// addresses again (bufferDeviceAddressCaptureReplay). On a GPU, rewritten shaders then have the same words in every
// run, as with FixedMemory on a CPU. Nothing else depends on it: if the file cannot be read, or an address cannot be
// had again, the table gets another address, which is kept instead.
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

    // `stem`: the beginning of the paths of the files for this physical device and driver. Devices that exist at the
    // same time have different addresses, and so different files, by their order.
    void open(const std::string &stem, const std::array<uint64_t, kTables> &tableBytes);
    [[nodiscard]] bool isOpen() const { return number_ >= 0; }
    // The kept address of a table; zeros if there is none.
    [[nodiscard]] ReplayAddress known(size_t table) const { return addresses_[table]; }
    // The address that the table has now.
    void set(size_t table, ReplayAddress address);
    // Writes the file if an address has changed.
    void write();

private:
    [[nodiscard]] std::string path() const;
    [[nodiscard]] uint64_t checksum() const;
    void read();

    std::string stem_;
    int number_ = -1; // of the file
    std::array<uint64_t, kTables> tableBytes_{};
    std::array<ReplayAddress, kTables> addresses_{};
    bool changed_ = false;
};

} // namespace vellum::layer
