// SPDX-License-Identifier: Apache-2.0
// Takes an input of a fuzz target apart, from the front. What is missing at its end reads as 0.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

namespace vellum::fuzz
{

class Reader
{
public:
    explicit Reader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

    [[nodiscard]] bool empty() const { return bytes_.empty(); }

    template <typename T>
    T take()
    {
        T value{};
        const size_t n = bytes_.size() < sizeof value ? bytes_.size() : sizeof value;
        if (n > 0)
            std::memcpy(&value, bytes_.data(), n);
        bytes_ = bytes_.subspan(n);
        return value;
    }
    uint8_t byte() { return take<uint8_t>(); }
    bool flag() { return (byte() & 1) != 0; }
    // True one time in `n`, for inputs that no case covers.
    bool oneIn(unsigned n) { return byte() % n == n - 1; }
    uint32_t below(uint32_t n) { return n <= 256 ? byte() % n : take<uint32_t>() % n; }

    // The next bytes, for a reader of their own.
    Reader part(size_t n)
    {
        n = n < bytes_.size() ? n : bytes_.size();
        const Reader first(bytes_.first(n));
        bytes_ = bytes_.subspan(n);
        return first;
    }

    // Fills `out` with what is left, over and over; with 0 where nothing is.
    void fill(std::span<uint8_t> out)
    {
        size_t filled = std::min(bytes_.size(), out.size());
        std::copy_n(bytes_.begin(), filled, out.begin());
        if (filled == 0)
            std::fill(out.begin(), out.end(), uint8_t{0});
        for (; filled > 0 && filled < out.size(); filled *= 2)
            std::copy_n(out.begin(), std::min(filled, out.size() - filled), out.begin() + static_cast<long>(filled));
        bytes_ = {};
    }

private:
    std::span<const uint8_t> bytes_;
};

} // namespace vellum::fuzz
