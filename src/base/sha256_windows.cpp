// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.h"

#include <algorithm>
#include <stdexcept>

#include <windows.h>

#include <bcrypt.h>

namespace vellum
{
namespace
{

void check(NTSTATUS status)
{
    if (status < 0)
        throw std::runtime_error("Windows cannot compute SHA-256");
}

// Opened once: opening takes longer than hashing a few megabytes.
BCRYPT_ALG_HANDLE provider()
{
    static const BCRYPT_ALG_HANDLE opened = [] {
        BCRYPT_ALG_HANDLE handle = nullptr;
        check(BCryptOpenAlgorithmProvider(&handle, BCRYPT_SHA256_ALGORITHM, nullptr, 0));
        return handle;
    }();
    return opened;
}

} // namespace

Sha256::Sha256() : state_(nullptr)
{
    check(BCryptCreateHash(provider(), &state_, nullptr, 0, nullptr, 0, 0));
}

Sha256::~Sha256()
{
    BCryptDestroyHash(state_);
}

void Sha256::add(std::span<const uint8_t> bytes)
{
    constexpr size_t kMost = size_t{1} << 30; // of a ULONG
    while (!bytes.empty()) {
        const std::span<const uint8_t> part = bytes.first(std::min(bytes.size(), kMost));
        // It does not write there.
        check(BCryptHashData(state_, const_cast<PUCHAR>(part.data()), static_cast<ULONG>(part.size()), 0));
        bytes = bytes.subspan(part.size());
    }
}

Digest Sha256::finish()
{
    Digest digest;
    check(BCryptFinishHash(state_, digest.data(), static_cast<ULONG>(digest.size()), 0));
    return digest;
}

} // namespace vellum
