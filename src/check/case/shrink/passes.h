// SPDX-License-Identifier: Apache-2.0
// Attempts to make a case smaller, each kept if the case still fails, and the passes that make them.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <unordered_set>
#include <vector>

#include "check/case/fields.h"
#include "check/case/shrink/shrink.h"

namespace vellum::check
{

// Does not depend on the order in which edits are made, nor on which others are.
using Edit = std::function<void(Case &)>;

class Attempts
{
public:
    Attempts(const Case &c, const StillFails &stillFails, const ShrinkLimits &limits);

    [[nodiscard]] const Case &best() const { return best_; }
    [[nodiscard]] uint32_t runs() const { return runs_; }
    [[nodiscard]] bool exhausted() const;

    // Returns whether the edited case is another one, valid, new, and fails. It is the best from then on.
    bool attempt(const Edit &edit);
    // Makes as many of the edits as can be made, which begins with all of them.
    void attemptAll(const std::vector<Edit> &edits);
    // Removes as many of `count` elements as can be, from the last to the first, in ever smaller stretches of at least
    // `finest`.
    using Remove = std::function<void(Case &, size_t from, size_t count)>;
    void removeStretches(size_t count, const Remove &remove, size_t finest = 1);

    // Runs the best case some times. If that does not fail each time, goes back to an earlier one that does, or fails
    // more often.
    void confirm(Shrunk &result);

private:
    [[nodiscard]] uint32_t failures(const Case &c);
    void attemptPart(const std::vector<Edit> &edits, size_t from, size_t count);

    const StillFails &stillFails_;
    ShrinkLimits limits_;
    std::chrono::steady_clock::time_point end_;
    Case best_;
    uint32_t runs_ = 0;
    std::unordered_set<size_t> seen_;
    std::vector<std::string> earlier_; // earlier best cases, or some of them, as JSON
    size_t earlierBytes_ = 0;
};

void removeRays(Attempts &attempts, std::optional<uint32_t> ray);
// All triangles of micromaps get one of the lowest levels at once, if the case still fails. Takes few runs: in a large
// scene, nothing else may lower them in time.
void lowerAllLevels(Attempts &attempts);
// Rays, steps, instances, objects, meshes, triangles, micromaps and their triangles that the failure does not need.
void removeParts(Attempts &attempts);
// States, levels and formats.
void simplifyMicromaps(Attempts &attempts);
// The uses of micromaps by meshes.
void simplifyUses(Attempts &attempts);
// Instances, rays and coordinates.
void simplifyScene(Attempts &attempts);
// How the case is built and traced, and the kinds of steps.
void simplifyPlans(Attempts &attempts);

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
