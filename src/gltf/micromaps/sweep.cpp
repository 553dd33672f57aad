// SPDX-License-Identifier: Apache-2.0
#include "gltf/micromaps/sweep.h"

#include <algorithm>
#include <cmath>

#include "base/text.h"

namespace vellum
{
namespace
{

// What is recommended knows that share of what can be known.
constexpr int kEnoughPercent = 95;

std::vector<uint64_t> sweptBudgets()
{
    std::vector<uint64_t> budgets;
    for (uint64_t budget = 1024; budget <= uint64_t{64} << 20; budget *= 2)
        budgets.push_back(budget);
    return budgets;
}

std::vector<std::optional<uint32_t>> sweptLevels(uint32_t highest)
{
    std::vector<std::optional<uint32_t>> levels = {std::nullopt};
    for (uint32_t level = 1; level <= highest; ++level)
        levels.emplace_back(level);
    return levels;
}

} // namespace

DocumentOutlines sweepDocument(const Document &document, const DocumentBakeOptions &options)
{
    return outlineDocument(document, options, sweptLevels(options.bake.maxLevel), sweptBudgets());
}

std::string SweepRow::options() const
{
    if (setting.budget)
        return "--budget " + shortBytes(static_cast<double>(*setting.budget)); // a power of two
    std::string text = "--level " + (setting.level ? std::to_string(*setting.level) : "auto");
    return setting.format == Format::TwoState ? text + " --states 2" : text;
}

std::vector<SweepRow> rowsOf(const std::vector<const DocumentOutlines *> &files)
{
    std::vector<SweepRow> rows;
    for (size_t i = 0; !files.empty() && i < files.front()->outlines.size(); ++i) {
        SweepRow row;
        row.setting = files.front()->outlines[i].setting;
        for (const DocumentOutlines *file : files) {
            const DocumentOutline &outline = file->outlines[i];
            row.bytes += outline.bytes;
            row.known += outline.known / static_cast<double>(files.size());
            row.proven += outline.proven / static_cast<double>(files.size());
            row.tooLarge = row.tooLarge || outline.tooLarge;
            for (size_t level = 0; level < row.levels.size(); ++level)
                row.levels[level] += outline.levels[level];
        }
        // The next lower level, or the next smaller budget.
        const auto before = std::find_if(rows.rbegin(), rows.rend(), [&](const SweepRow &other) {
            return other.setting.format == row.setting.format &&
                   other.setting.budget.has_value() == row.setting.budget.has_value() &&
                   other.setting.level.has_value() == row.setting.level.has_value();
        });
        if (before != rows.rend() && row.setting.budget && row.bytes == before->bytes && row.known == before->known)
            continue;
        if (before != rows.rend() && row.known - before->known > 1e-9)
            row.bytesPerPercent = (static_cast<double>(row.bytes) - static_cast<double>(before->bytes)) /
                                  (100 * (row.known - before->known));
        rows.push_back(row);
    }
    // Levels in 4 states, then in 2, then budgets.
    std::stable_partition(rows.begin(), rows.end(), [](const SweepRow &row) {
        return row.setting.format == Format::FourState && !row.setting.budget;
    });
    return rows;
}

std::optional<Recommendation> recommend(const std::vector<SweepRow> &rows, const std::string &given)
{
    double best = 0;
    for (const SweepRow &row : rows)
        if (row.eligible())
            best = std::max(best, row.known);
    if (!(best > 0))
        return std::nullopt;
    const auto fewest = [&](double known) {
        size_t found = rows.size();
        for (size_t i = 0; i < rows.size(); ++i)
            if (rows[i].eligible() && rows[i].known >= known &&
                (found == rows.size() || rows[i].bytes < rows[found].bytes))
                found = i;
        return found;
    };
    Recommendation made;
    made.row = fewest(kEnoughPercent * best / 100);
    const SweepRow &row = rows[made.row];
    made.options = row.options() + given;
    made.reason = "the fewest bytes that know " + std::to_string(kEnoughPercent) +
                  " % of what the best setting here knows (" + percent(row.known) + " of " + percent(best) + ")";
    // A whole percentage point more, or all there is.
    const size_t next = fewest(std::min(row.known + 0.01, best));
    if (rows[next].known > row.known && rows[next].bytes > row.bytes)
        made.reason += "; after it, each further percentage point takes " +
                       grouped(static_cast<uint64_t>(static_cast<double>(rows[next].bytes - row.bytes) /
                                                     (100 * (rows[next].known - row.known)))) +
                       " bytes";
    return made;
}

void write(const SweepRow &row, JsonWriter &json)
{
    json.beginObject().member("options", row.options()).key("level");
    row.setting.level ? json.value(*row.setting.level) : json.null();
    json.member("states", row.setting.format == Format::TwoState ? 2 : 4).key("budget");
    row.setting.budget ? json.value(*row.setting.budget) : json.null();
    json.member("bytes", row.bytes).member("tooLarge", row.tooLarge);
    json.member("known", row.known).member("proven", row.proven).key("bytesPerPercent");
    row.bytesPerPercent ? json.value(*row.bytesPerPercent) : json.null();
    json.member("shaderCalls", row.shaderCalls()).key("levels").beginObject();
    for (size_t level = 0; level < row.levels.size(); ++level)
        if (row.levels[level] != 0)
            json.member(std::to_string(level), row.levels[level]);
    json.end().end();
}

std::string shortBytes(double bytes)
{
    for (const char *unit : {"", "K", "M"}) {
        if (bytes < 1024)
            return std::to_string(std::lround(bytes)) + unit;
        bytes /= 1024;
    }
    return std::to_string(std::lround(bytes)) + "G";
}

} // namespace vellum
