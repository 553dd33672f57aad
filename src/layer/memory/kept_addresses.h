// SPDX-License-Identifier: Apache-2.0
// The addresses of the layer's tables, the same in every run where that is possible.
//
// Rewritten shaders contain the addresses as constants, and a driver's caches identify shaders by their words: with the
// same addresses the next run finds the pipelines of this one. Nothing else depends on it. If an address cannot be had,
// the table gets another one, and other words are only other keys.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "layer/memory/gpu_memory.h"

namespace vellum::layer
{

// Host memory at a fixed address, for devices whose device addresses are host addresses, as on a CPU. If an address is
// taken, by another device of the process or by anything else, the next one is tried.
class FixedMemory
{
public:
    FixedMemory() = default;
    ~FixedMemory();
    FixedMemory(const FixedMemory &) = delete;
    FixedMemory &operator=(const FixedMemory &) = delete;

    static constexpr size_t kAlignment = 65536; // of addresses, and of sizes
    static constexpr size_t kMostBytes = size_t{1} << 24;

    // Reserves at most kMostBytes, zeroed. Returns false if none of the addresses is free.
    bool reserve(size_t bytes);
    // Null before reserve() succeeded.
    [[nodiscard]] std::byte *data() const { return data_; }

private:
    std::byte *data_ = nullptr;
    size_t bytes_ = 0;
};

// The addresses of an earlier run. A file keeps them, so that the tables can get the same ones again
// (bufferDeviceAddressCaptureReplay), as on a GPU. Where they get others, these are kept instead.
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
