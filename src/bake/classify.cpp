// SPDX-License-Identifier: Apache-2.0
#include "bake/classify.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <cstdlib>
#include <limits>
#include <optional>

#include "bake/exact.h"
#include "bake/numbers/float4.h"
#include "bake/piece.h"
#include "bake/placement.h"
#include "core/portable_math.h"

namespace vellum
{
namespace
{

// A sub-triangle with a box of more cells than this is divided before its cells are listed,
constexpr double kMostCells = 65536;
// or than this, if it has no more levels than that below it: then most cells need not be listed,
constexpr double kMostCellsOfFew = 1 << 21;
constexpr uint32_t kFewLevels = 5;
// or if it has more to list than this.
constexpr size_t kMostListed = 1 << 15;
// Of a micro-triangle with a box of more cells than this none are listed: one that decides is soon found.
constexpr double kMostLeafCells = 2048;

void fill(uint8_t *packed, uint32_t first, uint32_t count, State state)
{
    if (count < 4) {
        for (uint32_t i = first; i < first + count; ++i)
            writeState(packed, i, Format::FourState, state);
        return;
    }
    // A sub-triangle's micro-triangles are a run whose start and length are multiples of four states, one byte.
    std::memset(packed + first / 4, static_cast<int>(state) * 0x55, count / 4);
}

// The middles of the 16 micro-triangles two levels further down, as weights of the two steps.
struct Samples {
    std::array<float, 16> i{};
    std::array<float, 16> j{};
};
constexpr Samples kSamples = [] {
    Samples samples;
    size_t n = 0;
    for (unsigned i = 0; i < 4; ++i)
        for (unsigned j = 0; i + j < 4; ++j)
            for (unsigned thirds = 1; thirds < (i + j < 3 ? 3u : 2u); ++thirds, ++n) {
                samples.i[n] = static_cast<float>(3 * i + thirds) / 12;
                samples.j[n] = static_cast<float>(3 * j + thirds) / 12;
            }
    return samples;
}();
constexpr const std::array<float, 16> &kSampleI = kSamples.i;
constexpr const std::array<float, 16> &kSampleJ = kSamples.j;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

constexpr std::array<unsigned, 16> kBitsOf = {0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4};

// Single precision counts cells within a sub-triangle of that many well enough for a guess.
constexpr int64_t kMostColumns = 1 << 15;

} // namespace

// The cells around a micro-triangle that it may touch, and those that surely lie within, whatever its place. Bits as
// in CellMap::window(), of 64 columns each, one below the other.
struct Stencil {
    void make(const Placement &place, bool inverted);

    Point origin; // of the first cell, rounded down, from the lattice point
    size_t columns = 0;
    size_t rows = 0;
    std::vector<uint64_t> near;
    std::vector<uint64_t> within;
};

void Stencil::make(const Placement &p, bool inverted)
{
    // Rounding down moves a cell by at most 1 in x and y: the middle of all that it can be is a whole number from the
    // origin, and it is this far from there.
    const double half = 1 + 4 * p.slack;
    const double reachX = half + p.marginX;
    const double reachY = half + p.marginY;
    origin = {(inverted ? -p.high.x : p.low.x) - reachX, (inverted ? -p.high.y : p.low.y) - reachY};
    columns = static_cast<size_t>(p.high.x - p.low.x + 2 * reachX) + 1;
    rows = static_cast<size_t>(p.high.y - p.low.y + 2 * reachY) + 1;
    const size_t words = (columns + 63) / 64;
    near.assign(words * rows, 0);
    within.assign(words * rows, 0);
    // What lies on the inner sides of three lines is inside.
    struct Line {
        Point gradient;
        double constant;
    };
    const double turn = inverted ? -1 : 1;
    const Line lines[] = {{{turn * p.gradientI.x, turn * p.gradientI.y}, 0},
                          {{turn * p.gradientJ.x, turn * p.gradientJ.y}, 0},
                          {{-turn * p.gradientSum.x, -turn * p.gradientSum.y}, p.area}};
    for (size_t row = 0; row < rows; ++row) {
        const double y = origin.y + static_cast<double>(row);
        const auto mark = [&](std::vector<uint64_t> &bits, double outX, double outY, double sign) {
            double left = 0;
            double right = static_cast<double>(columns - 1);
            for (const Line &line : lines) {
                const double reach = std::abs(line.gradient.x) * outX + std::abs(line.gradient.y) * outY + p.lineSlack;
                const double rest = line.gradient.y * y + line.constant + sign * reach;
                const double at = -rest / line.gradient.x - origin.x;
                if (line.gradient.x > 0)
                    left = std::max(left, at);
                else if (line.gradient.x < 0)
                    right = std::min(right, at);
                else if (rest < 0)
                    right = -1;
            }
            if (left > right)
                return;
            const auto first = static_cast<size_t>(std::ceil(left));
            const auto last = static_cast<size_t>(right);
            for (size_t word = first / 64; word <= last / 64; ++word) {
                uint64_t &to = bits[word * rows + row];
                to = ~uint64_t{0};
                if (word == first / 64)
                    to &= ~uint64_t{0} << (first % 64);
                if (word == last / 64)
                    to &= ~uint64_t{0} >> (63 - last % 64);
            }
        };
        mark(near, reachX, reachY, 1);
        mark(within, half, half, -1);
    }
}

// One triangle on its path down the tree of sub-triangles, in the order of the curve.
//
// A sub-triangle has a list of the mixed cells that it touches. When it is divided, each of its four parts gets those
// that the part touches. A part with an empty list has one outcome all over, which follows from the part before it on
// the curve, with which it shares points, or else from any point of it. At the bottom, each cell of the list is
// examined exactly. The lists are computed in single precision with a margin for its rounding: a superfluous cell costs
// only time.
class Classifier::Walk
{
public:
    Walk(const Classifier &classifier, const TriangleUvs &uvs, uint32_t level, uint8_t *packed,
         ClassifierScratch &scratch)
        : texture_(classifier.texture_), cutoff_(classifier.options_.cutoff), map_(classifier.map_),
          cancelled_(classifier.options_.cancelled), uvs_(uvs), level_(level), packed_(packed), scratch_(scratch),
          place_(texture_, map_, classifier.options_, uvs, level, classifier.uvTerms_),
          piece_(place_, texture_.filter, classifier.thresholds_), leafCells_(place_.boxCells({0, 0, 1}))
    {
    }

    void run() { descendWide({{0, 0, 1 << level_}, 0, false}, 0); }

private:
    // A sub-triangle of the level `depth`, its place on the curve, and whether the curve runs through it from the
    // lattice point (i + size, j) instead of (i, j).
    struct Node {
        SubTriangle sub;
        uint32_t index;
        bool swapped;
    };
    // The parts of a sub-triangle: at its lattice point, towards vertex 1, towards vertex 2, and in the middle.
    enum Part : size_t { kAtCorner, kTowardsI, kTowardsJ, kMiddle };

    static Node part(const Node &node, size_t child)
    {
        const auto [i, j, size] = node.sub;
        const int32_t half = size / 2;
        const uint32_t index = node.index * 4 + static_cast<uint32_t>(child);
        switch (partOf(node, child)) {
        case kAtCorner: return {{i, j, half}, index, node.swapped != (child == 3)};
        case kTowardsI: return {{i + half, j, half}, index, node.swapped != (child == 3)};
        case kTowardsJ: return {{i, j + half, half}, index, !node.swapped};
        default: return {{i + half, j + half, -half}, index, !node.swapped};
        }
    }
    // The curve enters a triangle at one corner, turns in the middle, and leaves it at vertex 2's.
    static Part partOf(const Node &node, size_t child)
    {
        switch (child) {
        case 0: return node.swapped ? kTowardsI : kAtCorner;
        case 1: return kMiddle;
        case 2: return node.swapped ? kAtCorner : kTowardsI;
        default: return kTowardsJ;
        }
    }

    // The frame in which the lists of a sub-triangle's parts are made; lengths in cells, from a lattice point near by.
    struct Frame {
        int32_t i, j;
        float stepIx, stepIy, stepJx, stepJy;
        float lowX, lowY, highX, highY; // the box of a sub-triangle of size 1
        float area;
        float reachI, reachJ, reachSum; // half a cell in the three functions, margins and rounding
        float reachX, reachY;           // margins and rounding
        float valueLow, valueHigh;      // a value is surely transparent below, and opaque above
        bool bilinear;
    };

    // Longer work is cancelled part-way: sub-triangles of this many levels, or of many cells.
    static constexpr uint32_t kLevelsBetweenPolls = 6;
    void poll() const
    {
        if (cancelled_ && cancelled_())
            throw BakeCancelled();
    }
    void descendWide(const Node &node, uint32_t depth);
    void search(const Node &node, uint32_t depth, bool windowed);
    [[nodiscard]] bool isMixed(const SubTriangle &sub, bool windowed);
    void descend(const Frame &frame, const Node &node, uint32_t depth, size_t list, size_t count);
    bool list(const Node &node, Frame &frame);
    class Within;
    struct Parts;
    void uniform(const Node &node, uint32_t depth);
    void leaf(const Node &node, size_t list, size_t count);
    // The lattice point of a micro-triangle, seen from a cell.
    [[nodiscard]] Point cornerIn(const SubTriangle &sub, const Cell &cell) const
    {
        const Point corner = place_.at(sub.i, sub.j);
        return {corner.x - static_cast<double>(cell.x - place_.baseX),
                corner.y - static_cast<double>(cell.y - place_.baseY)};
    }
    bool crosses(const SubTriangle &sub, const Cell &cell);
    int sideOf(const SubTriangle &sub);
    State guess(const SubTriangle &sub) const;
    const ExactTriangle &exact();

    const AlphaTexture &texture_;
    double cutoff_;
    const CellMap &map_;
    const std::function<bool()> &cancelled_;
    const TriangleUvs &uvs_;
    uint32_t level_;
    uint8_t *packed_;
    ClassifierScratch &scratch_;
    Placement place_;
    PieceTest piece_;
    double leafCells_;    // in the box of a micro-triangle
    std::array<Stencil, 2> stencils_; // of micro-triangles, where they are used; the second if inverted
    // Mixed cells around the sub-triangle that is searched.
    struct Window {
        int64_t x, y;
        std::array<uint64_t, 64> rows;
    };
    Window window_;
    size_t deciding_ = 0; // so many cells of the list lie within a micro-triangle each
    std::optional<ExactTriangle> exact_;
    int side_ = -1; // of the part before on the curve: 1 opaque, 0 transparent, -1 unknown
};

const ExactTriangle &Classifier::Walk::exact()
{
    if (!exact_)
        exact_.emplace(texture_, cutoff_, uvs_, level_);
    return *exact_;
}

// Lists the mixed cells of a sub-triangle, or divides it until it has few enough.
void Classifier::Walk::descendWide(const Node &node, uint32_t depth)
{
    poll();
    // Cells beyond these read no other texels.
    if (place_.spansTexture(map_, node.sub) && !map_.anyMixedIn(0, map_.axisX().cells())) {
        uniform(node, depth);
        return;
    }
    static const double from = std::getenv("FROM") ? std::atof(std::getenv("FROM")) : 300;
    static const double to = std::getenv("TO") ? std::atof(std::getenv("TO")) : 65536;
    if (leafCells_ >= from && leafCells_ <= to) {
        stencils_[0].make(place_, false);
        stencils_[1].make(place_, true);
        search(node, depth, false);
        return;
    }
    Frame frame;
    const double most = level_ - depth <= kFewLevels ? kMostCellsOfFew : kMostCells;
    if (place_.boxCells(node.sub) <= most && leafCells_ <= kMostLeafCells && list(node, frame)) {
        const size_t count = scratch_.cells.size();
        scratch_.lists.resize(count);
        for (size_t i = 0; i < count; ++i)
            scratch_.lists[i] = static_cast<uint32_t>(i);
        if (count == 0)
            uniform(node, depth);
        else if (depth == level_)
            leaf(node, 0, count);
        else
            descend(frame, node, depth, 0, count);
        return;
    }
    if (depth < level_) {
        for (size_t child = 0; child < 4; ++child)
            descendWide(part(node, child), depth + 1);
        return;
    }
    const bool mixed =
        place_.forMixed(map_, node.sub, [&](const CellMap::Place &cell) { return crosses(node.sub, map_.read(cell)); });
    if (!mixed) {
        uniform(node, depth);
        return;
    }
    side_ = -1;
    writeState(packed_, node.index, Format::FourState, guess(node.sub));
}

void Classifier::Walk::search(const Node &node, uint32_t depth, bool windowed)
{
    if (depth < level_) {
        const Stencil &stencil = stencils_[node.sub.size < 0 ? 1u : 0u];
        const double more = std::abs(node.sub.size) - 1;
        const double width = static_cast<double>(stencil.columns) + (place_.high.x - place_.low.x) * more + 2;
        const double height = static_cast<double>(stencil.rows) + (place_.high.y - place_.low.y) * more + 2;
        if (!windowed && width <= 64 && height <= 64) {
            const Point corner = place_.at(node.sub.i, node.sub.j);
            const Point &low = node.sub.size < 0 ? place_.high : place_.low;
            const double turn = node.sub.size < 0 ? -more : more;
            const Point origin{corner.x + low.x * turn + stencil.origin.x - 4 * place_.slack, corner.y + low.y * turn + stencil.origin.y - 4 * place_.slack};
            window_.x = place_.baseX + static_cast<int64_t>(std::floor(origin.x));
            window_.y = place_.baseY + static_cast<int64_t>(std::floor(origin.y));
            windowed = true;
            if (!map_.window(window_.x, window_.y, static_cast<size_t>(width), static_cast<size_t>(height), window_.rows.data())) {
                uniform(node, depth);
                return;
            }
        }
        for (size_t child = 0; child < 4; ++child)
            search(part(node, child), depth + 1, windowed);
    } else if (isMixed(node.sub, windowed)) {
        side_ = -1;
        writeState(packed_, node.index, Format::FourState, guess(node.sub));
    } else {
        uniform(node, depth);
    }
}

bool Classifier::Walk::isMixed(const SubTriangle &sub, bool windowed)
{
    const Stencil &stencil = stencils_[sub.size < 0 ? 1u : 0u];
    const Point corner = place_.at(sub.i, sub.j);
    const auto x = place_.baseX + static_cast<int64_t>(std::floor(corner.x + stencil.origin.x));
    const auto y = place_.baseY + static_cast<int64_t>(std::floor(corner.y + stencil.origin.y));
    std::array<uint64_t, 64> window;
    for (size_t column = 0; column < stencil.columns; column += 64) {
        for (size_t row = 0; row < stencil.rows; row += 64) {
            const size_t rows = std::min<size_t>(64, stencil.rows - row);
            const auto left = x + static_cast<int64_t>(column);
            const auto top = y + static_cast<int64_t>(row);
            if (windowed) {
                const uint64_t *from = &window_.rows[static_cast<size_t>(top - window_.y)];
                const auto shift = static_cast<unsigned>(left - window_.x);
                for (size_t k = 0; k < rows; ++k)
                    window[k] = from[k] >> shift;
            } else if (!map_.window(left, top, std::min<size_t>(64, stencil.columns - column), rows, window.data())) {
                continue;
            }
            const uint64_t *near = &stencil.near[column / 64 * stencil.rows + row];
            const uint64_t *within = &stencil.within[column / 64 * stencil.rows + row];
            uint64_t anyNear = 0;
            uint64_t anyWithin = 0;
            for (size_t k = 0; k < rows; ++k) {
                anyNear |= window[k] & near[k];
                anyWithin |= window[k] & within[k];
            }
            if (anyWithin != 0)
                return true;
            if (anyNear == 0)
                continue;
            for (size_t k = 0; k < rows; ++k) {
                for (uint64_t rest = window[k] & near[k]; rest != 0; rest &= rest - 1) {
                    const int64_t cellX = left + std::countr_zero(rest);
                    const int64_t cellY = top + static_cast<int64_t>(k);
                    const Point seen{corner.x - static_cast<double>(cellX - place_.baseX),
                                     corner.y - static_cast<double>(cellY - place_.baseY)};
                    if (!piece_.touches(seen, sub.size < 0))
                        continue;
                    const Cell cell = map_.cell(cellX, cellY);
                    Crossing crossing = Crossing::Open;
                    if (texture_.filter == Filter::Bilinear) {
                        NearCell values;
                        piece_.setValues(values, cell);
                        crossing = piece_.quick(seen, sub.size < 0, values);
                    }
                    if (crossing == Crossing::Yes || (crossing == Crossing::Open && crosses(sub, cell)))
                        return true;
                }
            }
        }
    }
    return false;
}

// Which micro-triangles of a sub-triangle have a mixed cell that lies within, margins included: that one decides, and
// others need not be looked at.
class Classifier::Walk::Within
{
public:
    Within(const Frame &f, const Node &node, std::vector<uint32_t> &decided)
        : perArea_((node.sub.size < 0 ? -1.0f : 1.0f) / f.area),
          reach_(Float4(f.reachI, f.reachJ, f.reachSum, 0) * Float4(1 / f.area)),
          width_(Float4(1.0f) - reach_ - reach_), steps_(std::abs(node.sub.size)),
          // Few cells lie within smaller ones.
          fits_(2 * (f.reachI + f.reachJ + f.reachSum) < f.area)
    {
        if (fits_)
            decided.assign(2 * static_cast<size_t>(steps_) * static_cast<size_t>(steps_) / kWord + 1, 0);
        decided_ = decided.data();
    }
    // Calls found(k, isWithin) for those of some cells in a row, the bits of `mixed`, which are not within a
    // micro-triangle, or the first that is. `start`: that of the lowest bit, `first`. `slopeI`, `slopeJ`: what the
    // functions grow by from a cell to the next.
    template <typename Found>
    void add(uint64_t mixed, int first, const NearCell &start, float slopeI, float slopeJ, Found &&found)
    {
        const Float4 row = functions(start.i, start.j) - reach_;
        const Float4 slope = functions(slopeI, slopeJ);
        const Float4 most(kNoLimit, kNoLimit, static_cast<float>(steps_), kNoLimit);
        const Float4 width = width_;
        const Float4 zero(0.0f);
        uint32_t *const decided = decided_;
        for (; mixed != 0; mixed &= mixed - 1) {
            const int k = std::countr_zero(mixed);
            const Float4 from = row + slope * Float4(static_cast<float>(k - first));
            const Float4 whole = fits_ ? truncated(from) : from;
            if (!fits_ || (atLeast(from, zero) & below(from, most) & below(from - whole, width)) != 15) {
                found(k, false);
                continue;
            }
            std::array<float, 4> steps;
            whole.store(steps.data());
            const size_t at =
                placeOf(static_cast<int32_t>(steps[0]), static_cast<int32_t>(steps[1]), static_cast<int32_t>(steps[2]));
            const uint32_t bit = uint32_t{1} << at % kWord;
            if ((decided[at / kWord] & bit) == 0) {
                decided[at / kWord] |= bit;
                found(k, true);
            }
        }
    }
    // Whether all micro-triangles that the cell can touch have one.
    [[nodiscard]] bool allDecided(const NearCell &cell) const
    {
        if (!fits_)
            return false;
        const Float4 middle = functions(cell.i, cell.j);
        std::array<float, 4> first;
        std::array<float, 4> last;
        max(Float4(0.0f), middle - reach_).store(first.data());
        min(Float4(static_cast<float>(steps_ - 1)), middle + reach_).store(last.data());
        const auto whole = [](float steps) { return static_cast<int32_t>(steps); };
        for (int32_t i = whole(first[0]); i <= whole(last[0]); ++i)
            for (int32_t j = whole(first[1]); j <= whole(last[1]); ++j)
                for (int32_t k = std::max(i + j, whole(first[2])); k <= std::min(i + j + 1, whole(last[2])); ++k)
                    if (const size_t at = placeOf(i, j, k); (decided_[at / kWord] >> at % kWord & 1) == 0)
                        return false;
        return true;
    }

private:
    static constexpr size_t kWord = 32;
    static constexpr float kNoLimit = std::numeric_limits<float>::max();

    // i, j and their sum in steps.
    [[nodiscard]] Float4 functions(float i, float j) const { return Float4(i, j, i + j, 0) * Float4(perArea_); }
    // The bit of a micro-triangle, by the whole part of its functions.
    [[nodiscard]] size_t placeOf(int32_t i, int32_t j, int32_t sum) const
    {
        return 2 * (static_cast<size_t>(i) * static_cast<size_t>(steps_) + static_cast<size_t>(j)) +
               static_cast<size_t>(sum - i - j);
    }

    float perArea_;
    Float4 reach_;
    Float4 width_; // of what is within, in each function
    int32_t steps_;
    bool fits_;
    uint32_t *decided_;
};

bool Classifier::Walk::list(const Node &node, Frame &frame)
{
    const Placement &p = place_;
    const Point origin = p.at(node.sub.i, node.sub.j);
    const double steps = std::abs(static_cast<double>(node.sub.size));
    const auto toFloat = [](double x) { return static_cast<float>(x); };
    // Every coordinate and function near here is the result of some ten operations that round to 2^-24 of the largest,
    // and every value of some thirty.
    constexpr double kRounding = 0x1p-19;
    constexpr double kValueRounding = 0x1p-18;
    const double width = (p.high.x - p.low.x) * steps + p.marginX + 4;
    const double height = (p.high.y - p.low.y) * steps + p.marginY + 4;
    const auto reach = [&](const Point &gradient) {
        const double cell = std::abs(gradient.x) * (0.5 + p.marginX) + std::abs(gradient.y) * (0.5 + p.marginY);
        return toFloat(cell + p.lineSlack + kRounding * (p.area * steps + 4 * cell));
    };
    frame = {node.sub.i,
             node.sub.j,
             toFloat(p.stepI.x),
             toFloat(p.stepI.y),
             toFloat(p.stepJ.x),
             toFloat(p.stepJ.y),
             toFloat(p.low.x),
             toFloat(p.low.y),
             toFloat(p.high.x),
             toFloat(p.high.y),
             toFloat(p.area),
             reach(p.gradientI),
             reach(p.gradientJ),
             reach(p.gradientSum),
             toFloat(p.marginX + 2 * p.slack + kRounding * width),
             toFloat(p.marginY + 2 * p.slack + kRounding * height),
             0,
             0,
             texture_.filter == Filter::Bilinear};
    const double valueRounding = p.valueSlack + kValueRounding * (map_.largest() + std::abs(cutoff_));
    frame.valueLow = toFloat(piece_.thresholds().transparent - valueRounding);
    frame.valueHigh = toFloat(piece_.thresholds().opaque + valueRounding);

    const auto nearAt = [&p, origin, toFloat](int64_t column, int64_t row) {
        const double x = static_cast<double>(column - p.baseX) - origin.x;
        const double y = static_cast<double>(row - p.baseY) - origin.y;
        return NearCell{toFloat(x),
                        toFloat(y),
                        toFloat(p.gradientI.x * (x + 0.5) + p.gradientI.y * (y + 0.5)),
                        toFloat(p.gradientJ.x * (x + 0.5) + p.gradientJ.y * (y + 0.5)),
                        kNaN,
                        kNaN,
                        kNaN,
                        kNaN};
    };
    Within within(frame, node, scratch_.decided);
    scratch_.places.clear();
    scratch_.cells.clear();
    scratch_.near.clear();
    const bool tooMany = p.forMixedWords(map_, node.sub, [&](const CellMap::Word &word) {
        const int first = std::countr_zero(word.mixed);
        const NearCell start = nearAt(word.column(first), word.y);
        const float turn = word.mirrored ? -1.0f : 1.0f;
        within.add(word.mixed, first, start, turn * toFloat(p.gradientI.x), turn * toFloat(p.gradientJ.x),
                   [&](int k, bool isWithin) {
                       if (!isWithin) {
                           scratch_.places.push_back(map_.place(word, k));
                           return;
                       }
                       const int64_t x = word.column(k);
                       scratch_.cells.push_back({x, word.y, kNaN, kNaN, kNaN, kNaN});
                       scratch_.near.push_back(nearAt(x, word.y));
                   });
        return scratch_.places.size() + scratch_.cells.size() > kMostListed;
    });
    if (tooMany)
        return false;
    deciding_ = scratch_.cells.size();
    // Texels are far away: while those of one cell come, the next ones are found.
    std::erase_if(scratch_.places, [&](const CellMap::Place &cell) {
        const NearCell near = nearAt(cell.x, cell.y);
        if (within.allDecided(near))
            return true;
        map_.prefetch(cell);
        scratch_.near.push_back(near);
        return false;
    });
    for (size_t n = 0; n < scratch_.places.size(); ++n) {
        const Cell cell = map_.read(scratch_.places[n]);
        scratch_.cells.push_back(cell);
        piece_.setValues(scratch_.near[deciding_ + n], cell);
    }
    return true;
}

// The parts of one sub-triangle, to be tested against many cells; a lane for each Part.
struct Classifier::Walk::Parts {
    Parts(const Frame &f, const Node &node)
        : flip(node.sub.size < 0 ? -1.0f : 1.0f), reachI(f.reachI), reachJ(f.reachJ), reachSum(f.reachSum),
          valueLow(f.valueLow), valueHigh(f.valueHigh)
    {
        const auto half = static_cast<float>(node.sub.size / 2);
        const auto i = static_cast<float>(node.sub.i - f.i);
        const auto j = static_cast<float>(node.sub.j - f.j);
        lineI = (i + half) * f.area;
        lineJ = (j + half) * f.area;
        lineSum = (i + j + half) * f.area;

        const Float4 partI(i, i + half, i, i + half);
        const Float4 partJ(j, j, j + half, j + half);
        const Float4 x = partI * Float4(f.stepIx) + partJ * Float4(f.stepJx);
        const Float4 y = partI * Float4(f.stepIy) + partJ * Float4(f.stepJy);
        const float steps = half * flip;
        const auto box = [&](Float4 at, float low, float high, float &width, float reach, Float4 &from, Float4 &to) {
            const float down = (flip > 0 ? low : -high) * steps;
            const float up = (flip > 0 ? high : -low) * steps;
            from = at + Float4(down, down, down, -up) - Float4(reach);
            to = at + Float4(up, up, up, -down) + Float4(reach);
            width = up - down;
        };
        float width = 0;
        float height = 0;
        box(x, f.lowX, f.highX, width, f.reachX, left, right);
        box(y, f.lowY, f.highY, height, f.reachY, top, bottom);
        small = f.bilinear && width < kSmall && height < kSmall;
    }

    // The parts that a cell touches and whose outcome it may change, as bits by Part.
    [[nodiscard]] unsigned touched(const NearCell &cell) const
    {
        // Three lines divide a triangle into its parts: i, j and their sum half way.
        const float fromI = flip * (cell.i - lineI);
        const float fromJ = flip * (cell.j - lineJ);
        const float fromSum = flip * (cell.i + cell.j - lineSum);
        const unsigned beforeI = fromI <= reachI ? kAllBut(kTowardsI) : 0;
        const unsigned beforeJ = fromJ <= reachJ ? kAllBut(kTowardsJ) : 0;
        const unsigned beforeSum = fromSum <= reachSum ? 1u << kAtCorner : 0;
        const unsigned behindI = fromI >= -reachI ? 1u << kTowardsI : 0;
        const unsigned behindJ = fromJ >= -reachJ ? 1u << kTowardsJ : 0;
        const unsigned behindSum = fromSum >= -reachSum ? kAllBut(kAtCorner) : 0;
        unsigned parts = (beforeI | behindI) & (beforeJ | behindJ) & (beforeSum | behindSum);

        Float4 x0 = left - Float4(cell.x);
        Float4 x1 = right - Float4(cell.x);
        Float4 y0 = top - Float4(cell.y);
        Float4 y1 = bottom - Float4(cell.y);
        const Float4 zero(0.0f);
        const Float4 one(1.0f);
        parts &= atLeast(x1, zero) & atLeast(one, x0) & atLeast(y1, zero) & atLeast(one, y0);
        if (!small || parts == 0)
            return parts;
        // The extremes over the box of a part are at its corners.
        x0 = max(x0, zero);
        y0 = max(y0, zero);
        x1 = min(x1, one);
        y1 = min(y1, one);
        const Float4 f00(cell.f00);
        const Float4 cx(cell.cx);
        const Float4 cy(cell.cy);
        const Float4 cxy(cell.cxy);
        const Float4 leftF = f00 + cx * x0;
        const Float4 leftSlope = cy + cxy * x0;
        const Float4 rightF = f00 + cx * x1;
        const Float4 rightSlope = cy + cxy * x1;
        const Float4 a = leftF + leftSlope * y0;
        const Float4 b = leftF + leftSlope * y1;
        const Float4 c = rightF + rightSlope * y0;
        const Float4 d = rightF + rightSlope * y1;
        const unsigned opaque = atLeast(min(min(a, b), min(c, d)), Float4(valueHigh));
        const unsigned transparent = below(max(max(a, b), max(c, d)), Float4(valueLow));
        return parts & ~(opaque | transparent);
    }

private:
    // Above this many cells across, the box of a part is not worth a look.
    static constexpr float kSmall = 2;
    static constexpr unsigned kAllBut(Part part) { return 15u & ~(1u << part); }

    float flip;
    float lineI, lineJ, lineSum;
    float reachI, reachJ, reachSum;
    float valueLow, valueHigh;
    Float4 left, right, top, bottom; // boxes of the parts
    bool small;
};

void Classifier::Walk::descend(const Frame &frame, const Node &node, uint32_t depth, size_t list, size_t count)
{
    if (level_ - depth > kLevelsBetweenPolls)
        poll();
    std::vector<uint32_t> &lists = scratch_.lists;
    const size_t start = list + count;
    // Four lists, and a place behind them for the one that is followed first.
    if (lists.size() < start + 5 * count)
        lists.resize(start + 5 * count);
    const Parts parts(frame, node);
    std::array<size_t, 4> counts{};
    for (size_t n = 0; n < count; ++n) {
        const uint32_t cell = lists[list + n];
        const unsigned touched = parts.touched(scratch_.near[cell]);
        for (size_t k = 0; k < 4; ++k) {
            lists[start + k * count + counts[k]] = cell;
            counts[k] += touched >> k & 1;
        }
    }
    for (size_t child = 0; child < 4; ++child) {
        const Part k = partOf(node, child);
        const Node below = part(node, child);
        const size_t from = start + k * count;
        if (counts[k] == 0) {
            uniform(below, depth + 1);
        } else if (depth + 1 == level_) {
            leaf(below, from, counts[k]);
        } else {
            // The calls below need the memory behind their list.
            const size_t to = start + 4 * count;
            std::copy_n(lists.data() + from, counts[k], lists.data() + to);
            descend(frame, below, depth + 1, to, counts[k]);
        }
    }
}

void Classifier::Walk::uniform(const Node &node, uint32_t depth)
{
    if (side_ < 0)
        side_ = sideOf(node.sub);
    const uint32_t below = microTriangleCount(level_ - depth);
    const State state = side_ < 0 ? State::UnknownOpaque : side_ == 1 ? State::Opaque : State::Transparent;
    fill(packed_, node.index * below, below, state);
}

void Classifier::Walk::leaf(const Node &node, size_t list, size_t count)
{
    for (size_t n = 0; n < count; ++n) {
        const uint32_t which = scratch_.lists[list + n];
        if (which < deciding_) {
            side_ = -1;
            writeState(packed_, node.index, Format::FourState, guess(node.sub));
            return;
        }
        const Cell &cell = scratch_.cells[which];
        Crossing crossing = Crossing::Open;
        if (texture_.filter == Filter::Bilinear)
            crossing = piece_.quick(cornerIn(node.sub, cell), node.sub.size < 0, scratch_.near[which]);
        if (crossing == Crossing::Yes || (crossing == Crossing::Open && crosses(node.sub, cell))) {
            side_ = -1;
            writeState(packed_, node.index, Format::FourState, guess(node.sub));
            return;
        }
    }
    uniform(node, level_);
}

bool Classifier::Walk::crosses(const SubTriangle &sub, const Cell &cell)
{
    const Crossing crossing = piece_(cornerIn(sub, cell), sub.size < 0, cell);
    if (crossing != Crossing::Open)
        return crossing == Crossing::Yes;
    if (!place_.exact)
        return true;
    Cell unwrapped = cell;
    unwrapped.x += place_.unwrappedX - place_.baseX;
    unwrapped.y += place_.unwrappedY - place_.baseY;
    return exact().crosses({{{sub.i, sub.j}, {sub.i + sub.size, sub.j}, {sub.i, sub.j + sub.size}}}, unwrapped);
}

// The outcome in a uniform sub-triangle: that at its middle, if rounding permits a decision, or at a corner.
int Classifier::Walk::sideOf(const SubTriangle &sub)
{
    const Point corner = place_.at(sub.i, sub.j);
    const double third = sub.size / 3.0;
    const double x = corner.x + third * (place_.stepI.x + place_.stepJ.x);
    const double y = corner.y + third * (place_.stepI.y + place_.stepJ.y);
    const double column = std::floor(x);
    const double row = std::floor(y);
    const int64_t cellX = place_.baseX + static_cast<int64_t>(column);
    const int64_t cellY = place_.baseY + static_cast<int64_t>(row);
    // Rounding can name a neighbour of the right cell. Where neither is mixed, they are alike.
    if (const int side = map_.side(cellX, cellY); side >= 0)
        return side;
    const Cell cell = map_.cell(cellX, cellY);
    const double a = x - column;
    const double b = y - row;
    if (texture_.filter == Filter::Bilinear) {
        const double value = (double{cell.f00} * (1 - a) + double{cell.f10} * a) * (1 - b) +
                             (double{cell.f01} * (1 - a) + double{cell.f11} * a) * b;
        if (value >= cutoff_ + place_.valueSlack)
            return 1;
        if (value < cutoff_ - place_.valueSlack)
            return 0;
    } else if (std::abs(a - 0.5) > 2 * place_.slack && std::abs(b - 0.5) > 2 * place_.slack) {
        const float texel = b < 0.5 ? (a < 0.5 ? cell.f00 : cell.f10) : (a < 0.5 ? cell.f01 : cell.f11);
        if (std::isfinite(texel))
            return double{texel} >= cutoff_ ? 1 : 0;
    }
    return exact().side({sub.i, sub.j}, map_);
}

// The state that most of an unknown micro-triangle has, by sampling.
State Classifier::Walk::guess(const SubTriangle &sub) const
{
    const Placement &p = place_;
    Point corner = p.at(sub.i, sub.j);
    const bool down = sub.size < 0;
    const Point low{corner.x + (down ? -p.high.x : p.low.x), corner.y + (down ? -p.high.y : p.low.y)};
    const Point high{corner.x + (down ? -p.low.x : p.high.x), corner.y + (down ? -p.low.y : p.high.y)};
    const double left = std::floor(low.x - 2 * p.slack);
    const double top = std::floor(low.y - 2 * p.slack);
    const int64_t x0 = p.baseX + static_cast<int64_t>(left);
    const int64_t y0 = p.baseY + static_cast<int64_t>(top);
    const auto columns = static_cast<int64_t>(high.x + 2 * p.slack - left);
    const auto rows = static_cast<int64_t>(high.y + 2 * p.slack - top);
    // Single precision is enough for a guess, but not to stay inside the window: hence the bounds.
    const auto limit = [](int64_t cells) { return Float4(static_cast<float>(cells) + 0.999f); };
    const Float4 limitX = limit(columns);
    const Float4 limitY = limit(rows);
    corner = {corner.x - left, corner.y - top};
    const auto s = static_cast<float>(sub.size);
    const auto toFloat = [](double x) { return static_cast<float>(x); };
    const bool nearest = texture_.filter == Filter::Nearest;
    const Float4 zero(0.0f);
    const Float4 one(1.0f);
    const bool inside = columns < kMostColumns && rows < kMostColumns && map_.isInside(x0, y0, x0 + columns, y0 + rows);
    // Otherwise the texels of the cells around are copied, row by row, unless they are too many.
    constexpr size_t kPitch = CellMap::kMostCopied;
    const bool copied = !inside && columns + 2 <= int64_t{kPitch} && rows + 2 <= int64_t{kPitch};
    std::array<float, kPitch * kPitch> copy;
    if (copied)
        map_.copy(x0, y0, static_cast<size_t>(columns + 2), static_cast<size_t>(rows + 2), copy.data(), kPitch);
    const size_t right = texture_.pixelStride();
    const size_t below = texture_.rowStride();
    const uint8_t *codes = texture_.codes.first;
    const size_t origin = inside ? texture_.place(static_cast<size_t>(x0), static_cast<size_t>(y0)) : 0;
    // The texels f00, f10, f01 and f11 of four samples.
    const auto texelsAt = [&](const std::array<float, 4> &columnOf, const std::array<float, 4> &rowOf) {
        const auto read = [&](auto &&texel, size_t firstAt, size_t toRight, size_t toBelow) {
            std::array<size_t, 4> at;
            for (size_t k = 0; k < 4; ++k)
                at[k] = firstAt + static_cast<size_t>(static_cast<int64_t>(rowOf[k])) * toBelow +
                        static_cast<size_t>(static_cast<int64_t>(columnOf[k])) * toRight;
            const auto four = [&](size_t apart) {
                return Float4(texel(at[0] + apart), texel(at[1] + apart), texel(at[2] + apart), texel(at[3] + apart));
            };
            return std::array<Float4, 4>{four(0), four(toRight), four(toBelow), four(toBelow + toRight)};
        };
        if (inside && codes != nullptr)
            return read([&](size_t place) { return texture_.codes.values[codes[place]]; }, origin, right, below);
        if (inside)
            return read([&](size_t place) { return texture_.alpha[place]; }, origin, right, below);
        if (copied)
            return read([&](size_t place) { return copy[place]; }, 0, 1, kPitch);
        std::array<Cell, 4> cells;
        for (size_t k = 0; k < 4; ++k)
            cells[k] = map_.cell(x0 + static_cast<int64_t>(columnOf[k]), y0 + static_cast<int64_t>(rowOf[k]));
        const auto four = [&](float Cell::*texel) {
            return Float4(cells[0].*texel, cells[1].*texel, cells[2].*texel, cells[3].*texel);
        };
        return std::array<Float4, 4>{four(&Cell::f00), four(&Cell::f10), four(&Cell::f01), four(&Cell::f11)};
    };
    unsigned opaque = 0;
    for (size_t n = 0; n < kSampleI.size(); n += 4) {
        const Float4 i = Float4(kSampleI[n], kSampleI[n + 1], kSampleI[n + 2], kSampleI[n + 3]) * Float4(s);
        const Float4 j = Float4(kSampleJ[n], kSampleJ[n + 1], kSampleJ[n + 2], kSampleJ[n + 3]) * Float4(s);
        const auto along = [&](double start, double stepI, double stepJ, Float4 most) {
            const Float4 at = Float4(toFloat(start)) + i * Float4(toFloat(stepI)) + j * Float4(toFloat(stepJ));
            return min(max(at, zero), most);
        };
        const Float4 x = along(corner.x, p.stepI.x, p.stepJ.x, limitX);
        const Float4 y = along(corner.y, p.stepI.y, p.stepJ.y, limitY);
        const Float4 column = truncated(x);
        const Float4 row = truncated(y);
        std::array<float, 4> columnOf;
        std::array<float, 4> rowOf;
        column.store(columnOf.data());
        row.store(rowOf.data());
        const std::array<Float4, 4> texels = texelsAt(columnOf, rowOf);
        const auto weight = [&](Float4 at) { return nearest ? selectBelow(at, Float4(0.5f), zero, one) : at; };
        const Float4 a = weight(x - column);
        const Float4 b = weight(y - row);
        const Float4 value = (texels[0] * (one - a) + texels[1] * a) * (one - b) +
                             (texels[2] * (one - a) + texels[3] * a) * b;
        opaque += kBitsOf[atLeast(value, Float4(toFloat(cutoff_)))];
    }
    return 2 * opaque >= kSampleI.size() ? State::UnknownOpaque : State::UnknownTransparent;
}

Classifier::Classifier(const AlphaTexture &texture, const BakeOptions &options, double uvTerms)
    : texture_(texture), options_(options),
      uvTerms_(uvTerms), thresholds_{options.cutoff - options.valueTolerance, options.cutoff + options.valueTolerance},
      map_(texture, thresholds_)
{
}

uint32_t Classifier::levelFor(const TriangleUvs &uvs) const
{
    if (options_.level)
        return *options_.level;
    if (!usable(uvs, texture_))
        return 0;
    const auto edge = [&](const TexCoord &from, const TexCoord &to) {
        return std::array<double, 2>{(double{to.u} - from.u) * texture_.width,
                                     (double{to.v} - from.v) * texture_.height};
    };
    const auto a = edge(uvs[0], uvs[1]);
    const auto b = edge(uvs[0], uvs[2]);
    const double area = std::abs(a[0] * b[1] - a[1] * b[0]);
    // Each level quarters a micro-triangle.
    const double quotient = area / (double{kLevelSlack} * options_.texelsPerEdge * options_.texelsPerEdge);
    if (!(quotient > 1))
        return 0;
    return std::min(static_cast<uint32_t>(ceilLog2(std::min(quotient, 0x1p100)) + 1) / 2, options_.maxLevel);
}

void Classifier::classify(const TriangleUvs &uvs, uint32_t level, uint8_t *packed, ClassifierScratch &scratch) const
{
    if (!usable(uvs, texture_)) {
        fill(packed, 0, microTriangleCount(level), State::UnknownOpaque);
        return;
    }
    Walk(*this, uvs, level, packed, scratch).run();
}

} // namespace vellum
