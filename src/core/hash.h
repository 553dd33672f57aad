// FNV-1a, 64 bits: for what need not withstand an adversary.
#pragma once

#include <cstdint>

namespace vellum
{

class Hash
{
public:
    // A byte, or a larger unit as a whole.
    void add(std::uint64_t unit) { value_ = (value_ ^ unit) * 0x100000001b3u; }
    // Of anything whose elements are numbers or bytes, unit by unit.
    template <typename Range>
    static std::uint64_t of(const Range &range)
    {
        Hash hash;
        for (const auto unit : range)
            hash.add(static_cast<std::uint64_t>(unit));
        return hash.value_;
    }
    [[nodiscard]] std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_ = 0xcbf29ce484222325u;
};

} // namespace vellum
