// SPDX-License-Identifier: Apache-2.0
// SHA-256, computed by libcrypto of OpenSSL or by Windows.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace vellum
{

using Digest = std::array<uint8_t, 32>;

// Digests what is added, in that order. Throws std::runtime_error if the library fails.
class Sha256
{
public:
    Sha256();
    ~Sha256();
    Sha256(const Sha256 &) = delete;
    Sha256 &operator=(const Sha256 &) = delete;

    void add(std::span<const uint8_t> bytes);
    // The last call.
    Digest finish();

private:
    void *state_; // the library's
};

} // namespace vellum
