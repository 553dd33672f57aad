// SPDX-License-Identifier: Apache-2.0
// Attempts to make a case smaller, each kept if the case still fails, and the passes that make them.
#pragma once

#include <chrono>
#include <unordered_set>

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

} // namespace vellum::check
