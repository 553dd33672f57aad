// SPDX-License-Identifier: Apache-2.0
#include "check/case/shrink/shrink.h"

#include <algorithm>

#include "check/case/bytes.h"
#include "check/case/case.h"
#include "check/case/shrink/passes.h"

namespace vellum::check
{
namespace
{

constexpr uint32_t kConfirmations = 3;
constexpr size_t kMostEarlierBytes = size_t{1} << 26;

size_t hashOf(const Case &c)
{
    Bytes bytes;
    fields::of(bytes, c);
    return std::hash<std::string>()(bytes.text());
}

} // namespace

Attempts::Attempts(const Case &c, const StillFails &stillFails, const ShrinkLimits &limits)
    : stillFails_(stillFails), limits_(limits),
      end_(std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                                  std::chrono::duration<double>(std::min(limits.seconds, 1e6)))),
      best_(c), seen_{hashOf(c)}
{
}

bool Attempts::exhausted() const
{
    return runs_ >= limits_.runs || std::chrono::steady_clock::now() >= end_;
}

bool Attempts::attempt(const Edit &edit)
{
    if (exhausted())
        return false;
    Case candidate = best_;
    edit(candidate);
    if (!seen_.insert(hashOf(candidate)).second || !invalid(candidate).empty())
        return false;
    ++runs_;
    if (!stillFails_(candidate))
        return false;
    // Every second one is forgotten when they are too large.
    if (earlierBytes_ > kMostEarlierBytes) {
        earlierBytes_ = 0;
        for (size_t i = 0; 2 * i < earlier_.size(); ++i) {
            if (i != 0)
                earlier_[i] = std::move(earlier_[2 * i]);
            earlierBytes_ += earlier_[i].size();
        }
        earlier_.resize((earlier_.size() + 1) / 2);
    }
    earlier_.push_back(toJson(best_));
    earlierBytes_ += earlier_.back().size();
    best_ = std::move(candidate);
    return true;
}

void Attempts::attemptPart(const std::vector<Edit> &edits, size_t from, size_t count)
{
    const auto all = [&](Case &c) {
        for (size_t i = from; i < from + count; ++i)
            edits[i](c);
    };
    if (count == 0 || attempt(all) || count == 1)
        return;
    attemptPart(edits, from, count / 2);
    attemptPart(edits, from + count / 2, count - count / 2);
}

void Attempts::attemptAll(const std::vector<Edit> &edits)
{
    attemptPart(edits, 0, edits.size());
}

void Attempts::removeStretches(size_t count, const Remove &remove, size_t finest)
{
    // Single ones of thousands are not worth a run each.
    constexpr size_t kFewEnough = 1024, kMostStretches = 256;
    for (size_t stretch = count; stretch >= finest && stretch > 0; stretch /= 2) {
        if (count > kFewEnough && count / stretch > kMostStretches)
            return;
        for (size_t end = count; end > 0 && !exhausted();) {
            const size_t from = end > stretch ? end - stretch : 0;
            if (attempt([&](Case &c) { remove(c, from, end - from); }))
                count -= end - from;
            end = from;
        }
    }
}

uint32_t Attempts::failures(const Case &c)
{
    uint32_t failed = 0;
    for (uint32_t i = 0; i < kConfirmations; ++i, ++runs_)
        failed += stillFails_(c) ? 1u : 0u;
    return failed;
}

void Attempts::confirm(Shrunk &result)
{
    result.confirmations = kConfirmations;
    result.failures = failures(best_);
    result.smallest = best_;
    const auto failsAlways = [&](size_t earlier) {
        const Case c = caseFromJson(earlier_[earlier]);
        const uint32_t failed = failures(c);
        if (failed > result.failures || failed == kConfirmations) {
            result.failures = failed;
            result.smallest = c;
        }
        return failed == kConfirmations;
    };
    if (result.failures == kConfirmations)
        return;
    // From the smallest towards the first in growing steps, then back between the last two of these.
    size_t wrong = earlier_.size(), right = wrong;
    for (size_t step = 1; wrong > 0 && right == earlier_.size(); step *= 2) {
        const size_t at = wrong - std::min(step, wrong);
        (failsAlways(at) ? right : wrong) = at;
    }
    while (right + 1 < wrong) {
        const size_t middle = (right + wrong) / 2;
        (failsAlways(middle) ? right : wrong) = middle;
    }
}

Shrunk shrink(const Case &c, const StillFails &stillFails, const ShrinkLimits &limits)
{
    Attempts attempts(c, stillFails, limits);
    Shrunk result;
    for (std::string before; !result.complete && !attempts.exhausted();) {
        before = toJson(attempts.best());
        const bool first = attempts.runs() == 0;
        removeRays(attempts, first ? limits.ray : std::nullopt);
        if (first)
            lowerAllLevels(attempts);
        removeParts(attempts);
        simplifyMicromaps(attempts);
        simplifyUses(attempts);
        simplifyPlans(attempts);
        simplifyScene(attempts);
        result.complete = toJson(attempts.best()) == before;
    }
    attempts.confirm(result);
    result.runs = attempts.runs();
    return result;
}

} // namespace vellum::check
