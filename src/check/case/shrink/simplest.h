// SPDX-License-Identifier: Apache-2.0
// The fields of a structure whose values can be simpler, by the list of all fields.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "check/case/fields.h"
#include "check/case/shrink/passes.h"

namespace vellum::check
{

// Gives one field its default, or clears one of its bits. An archive of fields.h; passes over lists and structures.
class Simplest
{
public:
    static constexpr size_t kNone = ~size_t{0};
    explicit Simplest(size_t changed) : changed_(changed) {}

    // The numbers of the fields and bits that are not simple yet.
    [[nodiscard]] const std::vector<size_t> &found() const { return found_; }

    template <class T>
    void value(const char *, T &field, const T &simplest)
    {
        if (next_ == changed_)
            field = simplest;
        if (field != simplest)
            found_.push_back(next_);
        ++next_;
    }
    template <class T, class Names>
    void name(const char *key, T &field, const Names &, T simplest)
    {
        value(key, field, simplest);
    }
    template <class Names>
    void bits(const char *key, uint32_t &field, const Names &names)
    {
        for (const Bit &bit : names)
            value(key, field, field & ~bit.value);
    }

    void always(auto &&...) {}
    template <class T, class Names>
    void name(const char *, T &, const Names &)
    {
    }
    void floats(auto &&...) {}
    void states(auto &&...) {}
    void vectors(auto &&...) {}
    void indices(auto &&...) {}
    void names(auto &&...) {}
    void object(auto &&...) {}
    void optional(auto &&...) {}
    void list(auto &&...) {}

private:
    size_t changed_;
    size_t next_ = 0;
    std::vector<size_t> found_;
};

// A change for each of these fields and bits.
template <class T>
std::vector<std::function<void(T &)>> simplerFields(T of)
{
    Simplest all(Simplest::kNone);
    fields::of(all, of);
    std::vector<std::function<void(T &)>> changes;
    for (const size_t number : all.found())
        changes.emplace_back([number](T &changed) {
            Simplest one(number);
            fields::of(one, changed);
        });
    return changes;
}

// Adds an edit for each, of the structure that `place` points to in a case, const or not.
template <class Place>
void addSimpler(std::vector<Edit> &edits, const Case &best, const Place &place)
{
    for (const auto &change : simplerFields(*place(best)))
        edits.emplace_back([change, place](Case &c) { change(*place(c)); });
}

} // namespace vellum::check
