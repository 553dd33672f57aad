// SPDX-License-Identifier: Apache-2.0
// The word that a misspelt one was probably meant to be.
#pragma once

#include <algorithm>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

namespace vellum
{

// Levenshtein's: the letters to insert, remove or replace.
inline size_t editDistance(std::string_view a, std::string_view b)
{
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 0; i < a.size(); ++i) {
        size_t diagonal = row[0];
        row[0] = i + 1;
        for (size_t j = 0; j < b.size(); ++j) {
            const size_t replaced = diagonal + (a[i] == b[j] ? 0u : 1u);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
}

// Returns whether `word` is not `meant`, and at most two edits away from it.
inline bool isMisspelling(std::string_view word, std::string_view meant)
{
    return word != meant && editDistance(word, meant) <= 2;
}

// The candidate that `word` was probably meant to be; empty if none is near.
inline std::string nearestWord(std::string_view word, const std::vector<std::string> &candidates)
{
    std::string best;
    size_t least = word.size() / 2 + 1; // beyond that it is another word
    for (const std::string &candidate : candidates) {
        const bool begins = word.size() > 1 && candidate.starts_with(word);
        const size_t away = begins ? 0 : editDistance(word, candidate);
        if (away < least) {
            least = away;
            best = candidate;
        }
    }
    return best;
}

// "; did you mean bake?"; empty if nothing is near.
inline std::string suggestion(std::string_view word, const std::vector<std::string> &candidates)
{
    const std::string best = nearestWord(word, candidates);
    return best.empty() ? std::string() : "; did you mean " + best + "?";
}

} // namespace vellum
