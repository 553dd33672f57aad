// SPDX-License-Identifier: Apache-2.0
#include "bake/outline.h"

#include <map>
#include <unordered_set>

#include "bake/levels.h"

namespace vellum
{
namespace
{

// Adds up what the distinct triangles of a bake become.
class Outliner
{
public:
    Outliner(const DistinctTriangles &distinct, const BakeOptions &options, const BakeSetting &setting)
        : distinct_(distinct), options_(options), known_(distinct.triangles.size())
    {
        outline_.setting = setting;
    }

    // `key`: dataKey(), or 0 for a special index. In the order of the triangles.
    void add(size_t which, uint32_t level, Format format, uint64_t key, float known)
    {
        const Distinct &triangle = distinct_.triangles[which];
        known_[which] = known;
        uint64_t &dataBytes = dataBytes_[triangle.group];
        if (key == 0)
            return;
        outline_.levels[level] += triangle.uses;
        if (!keys_.insert(key).second)
            return;
        dataBytes += packedBytes(level, format);
        outline_.bytes += packedBytes(level, format) + kRecordBytes;
    }

    BakeOutline finish()
    {
        for (const auto &[group, bytes] : dataBytes_) {
            outline_.bytes += bytes == 0 ? options_.emptyGroupBytes : 0;
            outline_.tooLarge = outline_.tooLarge || bytes > options_.maxDataBytes;
        }
        outline_.known.reserve(distinct_.of.size());
        for (const uint32_t which : distinct_.of)
            outline_.known.push_back(known_[which]);
        return std::move(outline_);
    }

private:
    const DistinctTriangles &distinct_;
    const BakeOptions &options_;
    std::vector<float> known_;
    std::unordered_set<uint64_t> keys_;
    std::map<uint32_t, uint64_t> dataBytes_; // by group
    BakeOutline outline_;
};

// A triangle at one level, in 4 and in 2 states.
struct AtLevel {
    float known = 0; // in 4 states
    std::array<uint64_t, 2> keys{};
    float proven = 0; // of what 2 states are made from
};

AtLevel classifyAt(Distinct triangle, uint32_t level, const BakeOptions &options, PackedScratch &scratch)
{
    triangle.level = level;
    triangle.format = Format::FourState;
    scratch.packed.assign(triangle.classifiedBytes(), 0);
    triangle.material->classify(*triangle.uvs, level, scratch.packed.data(), scratch.classifier);
    const StateCounts counts = countStates(scratch.packed.data(), level);
    AtLevel result;
    const auto all = static_cast<float>(microTriangleCount(level));
    result.proven = static_cast<float>(counts[0] + counts[1]) / all;
    for (const Format format : {Format::FourState, Format::TwoState}) {
        triangle.format = format;
        Packed packed{scratch.packed.data(), {}, counts, 0};
        finish(triangle, options, packed);
        if (format == Format::FourState)
            result.known = static_cast<float>(packed.counts[0] + packed.counts[1]) / all;
        if (!packed.uniform)
            result.keys[format == Format::TwoState ? 1 : 0] = dataKey(triangle, level, packed.data, format);
    }
    return result;
}

} // namespace

void outlineBakes(std::span<const BakeInput> inputs, const BakeOptions &options,
                  std::span<const std::optional<uint32_t>> levels, std::span<const uint64_t> budgets,
                  const std::function<void(const BakeOutline &)> &take)
{
    BakeOptions automatic = options;
    automatic.level.reset();
    automatic.format = Format::FourState;
    checkBake(inputs, automatic);
    const unsigned threads = threadCount(options.threads);
    const DistinctTriangles distinct(inputs, automatic);
    Progress progress(options.progress, distinct.of.size() * (levels.size() + (budgets.empty() ? 0 : 1)));

    std::vector<AtLevel> triangles(distinct.triangles.size());
    for (const std::optional<uint32_t> level : levels) {
        const auto levelOf = [&](size_t i) { return level.value_or(distinct.triangles[i].level); };
        inParallel<PackedScratch>(threads, triangles.size(), options.cancelled, [&](size_t i, PackedScratch &scratch) {
            triangles[i] = classifyAt(distinct.triangles[i], levelOf(i), automatic, scratch);
            progress.done(distinct.triangles[i].uses);
        });
        for (const Format format : {Format::FourState, Format::TwoState}) {
            const bool two = format == Format::TwoState;
            Outliner outliner(distinct, automatic, {level, format, {}});
            for (size_t i = 0; i < triangles.size(); ++i)
                outliner.add(i, levelOf(i), format, triangles[i].keys[two ? 1 : 0],
                             two ? triangles[i].proven : triangles[i].known);
            take(outliner.finish());
        }
    }
    if (budgets.empty())
        return;
    LevelChooser chooser(distinct, automatic, threads, progress);
    for (const uint64_t budget : budgets) {
        const std::vector<LevelChoice> choices = chooser.withinBudget(budget);
        Outliner outliner(distinct, automatic, {std::nullopt, Format::FourState, budget});
        for (size_t i = 0; i < choices.size(); ++i)
            outliner.add(i, choices[i].level, Format::FourState, choices[i].data[choices[i].level],
                         choices[i].known[choices[i].level]);
        take(outliner.finish());
    }
}

} // namespace vellum
