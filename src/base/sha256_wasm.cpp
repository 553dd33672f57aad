// SPDX-License-Identifier: Apache-2.0
// SHA-256 (FIPS 180-4) where there is no library for it.
#include <bit>

#include "base/sha256.h"

namespace vellum
{
namespace
{

constexpr size_t kBlock = 64;
constexpr size_t kLengthOffset = kBlock - sizeof(uint64_t);
using Words = std::array<uint32_t, 8>;

constexpr std::array<uint32_t, 64> kRounds = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

struct State {
    Words hash = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    std::array<uint8_t, kBlock> block{};
    uint64_t length = 0;

    void add(uint8_t byte)
    {
        block[length++ % kBlock] = byte;
        if (length % kBlock == 0)
            mix();
    }
    void mix();
};

void State::mix()
{
    std::array<uint32_t, 64> w{};
    for (size_t i = 0; i < 16; ++i)
        for (size_t k = 0; k < 4; ++k)
            w[i] = w[i] << 8 | block[4 * i + k];
    for (size_t i = 16; i < 64; ++i) {
        const uint32_t a = w[i - 15];
        const uint32_t b = w[i - 2];
        w[i] = w[i - 16] + (std::rotr(a, 7) ^ std::rotr(a, 18) ^ a >> 3) + w[i - 7] +
               (std::rotr(b, 17) ^ std::rotr(b, 19) ^ b >> 10);
    }
    Words v = hash;
    for (size_t i = 0; i < 64; ++i) {
        const uint32_t e = v[4];
        const uint32_t a = v[0];
        const uint32_t first = v[7] + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) +
                               ((e & v[5]) ^ (~e & v[6])) + kRounds[i] + w[i];
        const uint32_t second =
            (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + ((a & v[1]) ^ (a & v[2]) ^ (v[1] & v[2]));
        v = {first + second, v[0], v[1], v[2], v[3] + first, v[4], v[5], v[6]};
    }
    for (size_t i = 0; i < v.size(); ++i)
        hash[i] += v[i];
}

State &stateOf(void *state)
{
    return *static_cast<State *>(state);
}

} // namespace

Sha256::Sha256() : state_(new State) {}

Sha256::~Sha256()
{
    delete static_cast<State *>(state_);
}

void Sha256::add(std::span<const uint8_t> bytes)
{
    for (const uint8_t byte : bytes)
        stateOf(state_).add(byte);
}

Digest Sha256::finish()
{
    State &state = stateOf(state_);
    const uint64_t bits = 8 * state.length;
    state.add(0x80);
    while (state.length % kBlock != kLengthOffset)
        state.add(0);
    for (unsigned shift = 64; shift != 0;) {
        shift -= 8;
        state.add(static_cast<uint8_t>(bits >> shift));
    }
    Digest digest{};
    for (size_t i = 0; i < digest.size(); ++i)
        digest[i] = static_cast<uint8_t>(state.hash[i / 4] >> (24 - 8 * (i % 4)));
    return digest;
}

} // namespace vellum
