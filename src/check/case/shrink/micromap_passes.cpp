// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <set>
#include <span>

#include "check/case/names.h"
#include "check/case/shrink/passes.h"
#include "check/case/shrink/removal.h"
#include "check/oracle/cpu_trace.h"

namespace vellum::check
{
namespace
{

using oracle::MeshMicromap;
using oracle::MicromapTriangle;
using EditTriangle = std::function<void(MicromapTriangle &)>;
using EditUse = std::function<void(MeshMicromap &)>;

bool isUniform(const MicromapTriangle &triangle)
{
    return std::ranges::all_of(triangle.states, [&](uint8_t state) { return state == triangle.states[0]; });
}

// An edit for each triangle of a micromap that `of` is true for, of the scene and of steps.
std::vector<Edit> editsOfTriangles(const Case &best, const std::function<bool(const MicromapTriangle &)> &of,
                                   const EditTriangle &edit)
{
    std::vector<Edit> edits;
    Case copy = best;
    for (uint32_t i = 0; i < copy.scene.micromaps.size(); ++i) {
        size_t list = 0;
        forEachStates(copy, i, [&](std::vector<MicromapTriangle> &triangles) {
            for (size_t t = 0; t < triangles.size(); ++t) {
                if (!of(triangles[t]))
                    continue;
                edits.emplace_back([i, list, t, edit](Case &c) {
                    size_t k = 0;
                    forEachStates(c, i, [&](std::vector<MicromapTriangle> &found) {
                        if (k++ == list)
                            edit(found[t]);
                    });
                });
            }
            ++list;
        });
    }
    return edits;
}

// An edit for each triangle of a micromap that `of` is true for, wherever it has states: what is built in place keeps
// levels and formats.
std::vector<Edit> editsOfShapes(const Case &best, const std::function<bool(const MicromapTriangle &)> &of,
                                const EditTriangle &edit)
{
    std::vector<Edit> edits;
    Case copy = best;
    for (uint32_t i = 0; i < copy.scene.micromaps.size(); ++i) {
        std::set<size_t> found;
        forEachStates(copy, i, [&](const std::vector<MicromapTriangle> &triangles) {
            for (size_t t = 0; t < triangles.size(); ++t)
                if (of(triangles[t]))
                    found.insert(t);
        });
        for (const size_t t : found)
            edits.emplace_back([i, t, edit](Case &c) {
                forEachStates(c, i, [&](std::vector<MicromapTriangle> &triangles) {
                    if (t < triangles.size())
                        edit(triangles[t]);
                });
            });
    }
    return edits;
}

void makeUniform(Attempts &attempts)
{
    for (const uint8_t state : {uint8_t{1}, uint8_t{0}, uint8_t{2}, uint8_t{3}}) {
        attempts.attemptAll(editsOfTriangles(
            attempts.best(),
            [&](const MicromapTriangle &t) { return !isUniform(t) && std::ranges::count(t.states, state) > 0; },
            [state](MicromapTriangle &t) { std::ranges::fill(t.states, state); }));
    }
}

uint8_t usualState(const MicromapTriangle &triangle)
{
    std::array<size_t, 4> counts{};
    for (const uint8_t state : triangle.states)
        ++counts[state & 3];
    return static_cast<uint8_t>(std::ranges::max_element(counts) - counts.begin());
}

// The state that a micro-triangle of a lower level gets: that of a child in the same part (0 to 3), of the
// micro-triangle with the same number, the first that is not the usual one; or states in turn, of which it gets the
// n-th first.
enum Reduction : size_t { kSameNumber = 4, kUnusual, kInTurn, kReductions = kInTurn + 4 };

void lowerTo(MicromapTriangle &triangle, uint32_t level, size_t reduction)
{
    if (triangle.level <= level)
        return;
    const size_t count = size_t{1} << (2 * level), children = triangle.states.size() / count;
    const uint8_t usual = usualState(triangle);
    const uint8_t values = triangle.format == kTwoState ? 2 : 4;
    std::vector<uint8_t> states(count);
    for (size_t i = 0; i < count; ++i) {
        const auto first = triangle.states.begin() + static_cast<ptrdiff_t>(i * children);
        const auto end = first + static_cast<ptrdiff_t>(children);
        if (reduction >= kInTurn) {
            states[i] = static_cast<uint8_t>((i + reduction - kInTurn) % values);
        } else if (reduction == kUnusual) {
            const auto found = std::find_if(first, end, [usual](uint8_t state) { return state != usual; });
            states[i] = found != end ? *found : usual;
        } else {
            // The part of the part ... of part number `reduction`.
            states[i] = reduction == kSameNumber ? triangle.states[i]
                                                 : first[static_cast<ptrdiff_t>((children - 1) / 3 * reduction)];
        }
    }
    triangle.level = level;
    triangle.states = std::move(states);
}

// Rays through all micro-triangles of that level, instead of the one that is left.
void aimEverywhere(Case &c, uint32_t level)
{
    const oracle::Scene scene = sceneAfter(c);
    const Ray ray = scene.rays[0];
    const std::optional<oracle::Hit> hit = oracle::nearestTriangle(scene, ray);
    if (!hit)
        return;
    c.scene.rays.clear();
    for (uint32_t i = 0; i < 1u << (2 * level); ++i)
        c.scene.rays.push_back(oracle::aimedAt(scene, *hit, ray, microTriangleCentre(i, level)));
}

uint32_t highestLevel(const Case &c)
{
    uint32_t highest = 0;
    Case copy = c;
    for (uint32_t i = 0; i < copy.scene.micromaps.size(); ++i)
        forEachStates(copy, i, [&](const std::vector<MicromapTriangle> &triangles) {
            for (const MicromapTriangle &triangle : triangles)
                highest = std::max(highest, triangle.level);
        });
    return highest;
}

// Gives all triangles that level at most.
void lowerAll(Case &c, uint32_t level, size_t reduction)
{
    for (uint32_t i = 0; i < c.scene.micromaps.size(); ++i)
        forEachStates(c, i, [&](std::vector<MicromapTriangle> &triangles) {
            for (MicromapTriangle &triangle : triangles)
                lowerTo(triangle, level, reduction);
        });
}

void lowerLevels(Attempts &attempts)
{
    constexpr uint32_t kMostAimed = 2; // levels with 16 rays at most
    const uint32_t highest = highestLevel(attempts.best());
    for (uint32_t level = 0; level < highest; ++level) {
        for (size_t reduction = 0; reduction < kReductions; ++reduction) {
            const auto edits = editsOfShapes(
                attempts.best(), [&](const MicromapTriangle &t) { return t.level > level; },
                [level, reduction](MicromapTriangle &t) { lowerTo(t, level, reduction); });
            attempts.attemptAll(edits);
            if (!edits.empty() && level <= kMostAimed && attempts.best().scene.rays.size() == 1)
                attempts.attempt([&](Case &c) {
                    lowerAll(c, level, reduction);
                    aimEverywhere(c, level);
                });
        }
    }
}

// An edit for each stretch of that many states that has others than the usual one. list: of forEachStates.
void addFills(const MicromapTriangle &triangle, size_t stretch, uint32_t micromap, size_t list, size_t number,
              std::vector<Edit> &edits)
{
    const uint8_t usual = usualState(triangle);
    const auto fill = [](MicromapTriangle &t, size_t from, size_t count, uint8_t state) {
        const auto first = t.states.begin() + static_cast<ptrdiff_t>(from);
        std::fill(first, first + static_cast<ptrdiff_t>(count), state);
    };
    for (size_t from = 0; from < triangle.states.size(); from += stretch) {
        const size_t count = std::min(stretch, triangle.states.size() - from);
        const std::span<const uint8_t> states(&triangle.states[from], count);
        if (std::ranges::all_of(states, [usual](uint8_t state) { return state == usual; }))
            continue;
        edits.emplace_back([=](Case &c) {
            size_t k = 0;
            forEachStates(c, micromap, [&](std::vector<MicromapTriangle> &triangles) {
                if (k++ == list)
                    fill(triangles[number], from, count, usual);
            });
        });
    }
}

// Gives micro-triangles that do not matter the state that most have: first long stretches of them, then shorter ones,
// at most kMostEdits. A triangle of level 12 that is almost uniform makes a short file, and its case runs fast.
void fillStates(Attempts &attempts)
{
    constexpr size_t kParts = 16;
    constexpr size_t kMostEdits = 512;
    size_t largest = 0;
    for (size_t stretch = size_t{1} << 20; stretch > 0; stretch /= kParts) {
        std::vector<Edit> edits;
        Case copy = attempts.best();
        for (uint32_t i = 0; i < copy.scene.micromaps.size(); ++i) {
            size_t list = 0;
            forEachStates(copy, i, [&](const std::vector<MicromapTriangle> &triangles) {
                for (size_t t = 0; t < triangles.size(); ++t) {
                    largest = std::max(largest, triangles[t].states.size());
                    addFills(triangles[t], stretch, i, list, t, edits);
                }
                ++list;
            });
        }
        if (edits.size() > kMostEdits)
            return;
        if (stretch < largest)
            attempts.attemptAll(edits);
    }
}

// An edit for each use that `of` is true for; where there are many, for each of some stretches of them.
std::vector<Edit> editsOfUses(const Case &best, const std::function<bool(const MeshMicromap &)> &of,
                              const EditUse &edit)
{
    constexpr size_t kMostEdits = 256;
    std::vector<size_t> numbers;
    Case copy = best;
    size_t number = 0;
    forEachUse(copy, [&](const MeshMicromap &use) {
        if (of(use))
            numbers.push_back(number);
        ++number;
    });
    std::vector<Edit> edits;
    const size_t stretch = numbers.size() / kMostEdits + 1;
    for (size_t i = 0; i < numbers.size(); i += stretch) {
        const size_t first = numbers[i], last = numbers[std::min(i + stretch, numbers.size()) - 1];
        edits.emplace_back([first, last, of, edit](Case &c) {
            size_t k = 0;
            forEachUse(c, [&](MeshMicromap &found) {
                if (k >= first && k <= last && of(found))
                    edit(found);
                ++k;
            });
        });
    }
    return edits;
}

// Removes the index buffer, as if it were 0, 1, 2...
void makeDirect(MeshMicromap &use)
{
    if (!use.indices.empty() && use.indices[0] > 0)
        use.base += static_cast<uint32_t>(use.indices[0]);
    for (size_t i = 0; i < use.indices.size(); ++i)
        use.indices[i] = static_cast<int32_t>(i);
    use.indexType = VK_INDEX_TYPE_NONE_KHR;
    use.stride.reset();
    use.indexOffset = 0;
}

void removeBase(MeshMicromap &use)
{
    for (int32_t &index : use.indices)
        if (index >= 0 && !isDirect(use))
            index += static_cast<int32_t>(use.base);
    use.base = 0;
}

} // namespace

void lowerAllLevels(Attempts &attempts)
{
    constexpr uint32_t kMostLevels = 2;
    const uint32_t highest = highestLevel(attempts.best());
    for (uint32_t level = 0; level < std::min(highest, kMostLevels); ++level)
        for (const size_t reduction : {size_t{kUnusual}, size_t{kSameNumber}, size_t{kInTurn}, size_t{kInTurn} + 1})
            if (attempts.attempt([&](Case &c) { lowerAll(c, level, reduction); }))
                return;
}

void simplifyMicromaps(Attempts &attempts)
{
    makeUniform(attempts);
    fillStates(attempts);
    lowerLevels(attempts);
    attempts.attemptAll(editsOfTriangles(
        attempts.best(),
        [](const MicromapTriangle &t) { return std::ranges::any_of(t.states, [](uint8_t s) { return s > 1; }); },
        [](MicromapTriangle &t) {
            for (uint8_t &state : t.states)
                state &= 1;
        }));
    attempts.attemptAll(editsOfShapes(
        attempts.best(), [](const MicromapTriangle &t) { return t.format != kFourState; },
        [](MicromapTriangle &t) { t.format = kFourState; }));
    std::vector<Edit> edits;
    for (size_t i = 0; i < attempts.best().scene.micromaps.size(); ++i)
        addSimpler(edits, attempts.best(), [i](auto &c) { return &c.scene.micromaps[i]; });
    attempts.attemptAll(edits);
}

void simplifyUses(Attempts &attempts)
{
    const auto attempt = [&](const std::function<bool(const MeshMicromap &)> &of, const EditUse &edit) {
        attempts.attemptAll(editsOfUses(attempts.best(), of, edit));
    };
    attempt([](const MeshMicromap &use) { return use.usagePointers; },
            [](MeshMicromap &use) { use.usagePointers = false; });
    for (const Bit &bit : kUsageNames)
        attempt([&bit](const MeshMicromap &use) { return (use.usage & bit.value) != 0; },
                [&bit](MeshMicromap &use) { use.usage &= ~bit.value; });
    attempt([](const MeshMicromap &use) { return use.stride.has_value(); },
            [](MeshMicromap &use) {
                if (use.stride == 0u && !use.indices.empty())
                    std::ranges::fill(use.indices, use.indices[0]);
                use.stride.reset();
            });
    attempt([](const MeshMicromap &use) { return use.indexOffset != 0; },
            [](MeshMicromap &use) { use.indexOffset = 0; });
    attempt([](const MeshMicromap &use) { return use.base != 0; }, removeBase);
    attempt([](const MeshMicromap &use) { return use.base != 0; }, [](MeshMicromap &use) { use.base = 0; });
    attempt([](const MeshMicromap &use) { return use.base > 1; }, [](MeshMicromap &use) { use.base = 1; });
    attempt([](const MeshMicromap &use) { return std::ranges::any_of(use.indices, [](int32_t i) { return i > 0; }); },
            [](MeshMicromap &use) {
                for (int32_t &index : use.indices)
                    index = isDirect(use) ? index : std::min(index, 0);
            });
    attempt(
        [](const MeshMicromap &use) {
            return use.micromap && std::ranges::all_of(use.indices, [](int32_t i) { return i < 0; });
        },
        [](MeshMicromap &use) { use.micromap.reset(); });
    attempt([](const MeshMicromap &use) { return !isDirect(use); }, makeDirect);
    attempt([](const MeshMicromap &use) { return !isDirect(use) && use.indexType != VK_INDEX_TYPE_UINT32; },
            [](MeshMicromap &use) {
                use.indexType = VK_INDEX_TYPE_UINT32;
                use.stride.reset();
                use.indexOffset = 0;
            });
}

} // namespace vellum::check
