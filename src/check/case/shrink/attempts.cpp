// SPDX-License-Identifier: Apache-2.0
#include "check/case/shrink/attempts.h"

#include <algorithm>

#include "check/case/bytes.h"
#include "check/case/json.h"
#include "check/case/validity.h"

namespace vellum::check
{
namespace
{

constexpr uint32_t kConfirmations = 3;
constexpr size_t kMostEarlier = 32;

size_t hashOf(const Case &c)
{
    Bytes bytes;
    fields::ofCase(bytes, c);
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
    // Every second one is forgotten when there are too many.
    if (earlier_.size() == kMostEarlier) {
        for (size_t i = 1; i < kMostEarlier / 2; ++i)
            earlier_[i] = std::move(earlier_[2 * i]);
        earlier_.resize(kMostEarlier / 2);
    }
    earlier_.push_back(toJson(best_));
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
    // Of thousands, single ones are not worth a run each.
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
    // From the smallest to the first.
    for (auto text = earlier_.rbegin(); text != earlier_.rend() && result.failures < kConfirmations; ++text) {
        const Case c = caseFromJson(*text);
        const uint32_t failed = failures(c);
        if (failed > result.failures) {
            result.failures = failed;
            result.smallest = c;
        }
    }
}

} // namespace vellum::check
