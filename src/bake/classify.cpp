// SPDX-License-Identifier: Apache-2.0
#include "bake/classify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "bake/exact.h"
#include "bake/numbers/float4.h"
#include "bake/placement.h"
#include "core/portable_math.h"

namespace vellum
{
namespace
{

// A sub-triangle with a box of more cells than this is divided before its cells are listed,
constexpr double kMostCells = 65536;
// or if it has more to list than this.
constexpr size_t kMostListed = 1 << 15;
// Micro-triangles with a box of this many cells are compared with the bits of the cells instead, unless the texture is
// smaller than a window,
constexpr double kLeastStencil = 80;
constexpr double kMostStencil = 65536;
// and others with a box of more cells than this are visited row by row: a cell that decides is soon found.
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
    struct Window;
    void search(const Node &node, uint32_t depth, const Window *around);
    bool isMixed(const SubTriangle &sub, const Window *around);
    bool crossesAt(const SubTriangle &sub, int64_t x, int64_t y);
    void descend(const Frame &frame, const Node &node, uint32_t depth, size_t list, size_t count);
    bool list(const Node &node, Frame &frame);
    struct Parts;
    void uniform(const Node &node, uint32_t depth);
    void unknown(const Node &node);
    void leaf(const Node &node, size_t list, size_t count);
    // The lattice point of a micro-triangle, seen from a cell.
    [[nodiscard]] Point cornerIn(const SubTriangle &sub, int64_t x, int64_t y) const
    {
        const Point corner = place_.at(sub.i, sub.j);
        return {corner.x - static_cast<double>(x - place_.baseX), corner.y - static_cast<double>(y - place_.baseY)};
    }
    // The cell of a local coordinate.
    static int64_t cellAt(int64_t base, double local) { return base + static_cast<int64_t>(std::floor(local)); }
    bool crosses(const SubTriangle &sub, const Cell &cell, const NearCell &near);
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
    double leafCells_; // in the box of a micro-triangle
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
    const bool large = std::min(map_.axisX().cells(), map_.axisY().cells()) >= CellMap::kTile;
    if (large && leafCells_ >= kLeastStencil && leafCells_ <= kMostStencil) {
        for (const size_t inverted : {0u, 1u})
            scratch_.stencils[inverted].make(place_, inverted != 0);
        search(node, depth, nullptr);
        return;
    }
    Frame frame;
    if (leafCells_ <= kMostLeafCells && place_.boxCells(node.sub) <= kMostCells && list(node, frame)) {
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
    unknown(node);
}

void Classifier::Walk::unknown(const Node &node)
{
    side_ = -1;
    writeState(packed_, node.index, Format::FourState, guess(node.sub));
}

// Bits of the mixed cells around a sub-triangle.
struct Classifier::Walk::Window {
    int64_t x, y;
    std::array<uint64_t, CellMap::kTile> rows;
};

// Classifies micro-triangles by stencils. `around`: a window that has all their cells, if there is one.
void Classifier::Walk::search(const Node &node, uint32_t depth, const Window *around)
{
    if (depth == level_) {
        if (isMixed(node.sub, around))
            unknown(node);
        else
            uniform(node, depth);
        return;
    }
    if (level_ - depth > kLevelsBetweenPolls)
        poll();
    Window window;
    if (around == nullptr) {
        // Its size is that of a stencil, and how far it moves.
        const bool inverted = node.sub.size < 0;
        const Stencil &stencil = scratch_.stencils[inverted ? 1 : 0];
        const double steps = std::abs(static_cast<double>(node.sub.size)) - 1;
        const double width = (place_.high.x - place_.low.x) * steps + 2 + static_cast<double>(stencil.columns);
        const double height = (place_.high.y - place_.low.y) * steps + 2 + static_cast<double>(stencil.rows);
        if (width <= CellMap::kTile && height <= CellMap::kTile) {
            const Point corner = place_.at(node.sub.i, node.sub.j);
            const Point first = inverted ? Point{-place_.high.x, -place_.high.y} : place_.low;
            const double more = 8 * place_.slack;
            window.x = cellAt(place_.baseX, corner.x + first.x * steps + stencil.origin.x - more);
            window.y = cellAt(place_.baseY, corner.y + first.y * steps + stencil.origin.y - more);
            if (!map_.window(window.x, window.y, static_cast<size_t>(width), static_cast<size_t>(height),
                             window.rows.data())) {
                uniform(node, depth);
                return;
            }
            around = &window;
        }
    }
    for (size_t child = 0; child < 4; ++child)
        search(part(node, child), depth + 1, around);
}

bool Classifier::Walk::isMixed(const SubTriangle &sub, const Window *around)
{
    constexpr auto kTile = static_cast<size_t>(CellMap::kTile);
    const bool inverted = sub.size < 0;
    const Stencil &stencil = scratch_.stencils[inverted ? 1 : 0];
    const Point corner = place_.at(sub.i, sub.j);
    const int64_t x = cellAt(place_.baseX, corner.x + stencil.origin.x);
    const int64_t y = cellAt(place_.baseY, corner.y + stencil.origin.y);
    for (size_t column = 0; column < stencil.columns; column += kTile)
        for (size_t row = 0; row < stencil.rows; row += kTile) {
            const int64_t left = x + static_cast<int64_t>(column);
            const int64_t top = y + static_cast<int64_t>(row);
            const size_t rows = std::min(kTile, stencil.rows - row);
            const uint64_t *touched = &stencil.touched[column / kTile * stencil.rows + row];
            const uint64_t *within = &stencil.within[column / kTile * stencil.rows + row];
            if (std::all_of(touched, touched + rows, [](uint64_t bits) { return bits == 0; }))
                continue;
            std::array<uint64_t, kTile> mixed;
            if (around != nullptr) {
                const uint64_t *from = &around->rows[static_cast<size_t>(top - around->y)];
                for (size_t k = 0; k < rows; ++k)
                    mixed[k] = from[k] >> (left - around->x);
            } else if (!map_.window(left, top, std::min(kTile, stencil.columns - column), rows, mixed.data())) {
                continue;
            }
            uint64_t anyTouched = 0;
            uint64_t anyWithin = 0;
            for (size_t k = 0; k < rows; ++k) {
                anyTouched |= mixed[k] & touched[k];
                anyWithin |= mixed[k] & within[k];
            }
            // All its texels lie in the micro-triangle, and they are on both sides.
            if (anyWithin != 0)
                return true;
            if (anyTouched == 0)
                continue;
            for (size_t k = 0; k < rows; ++k)
                for (uint64_t rest = mixed[k] & touched[k]; rest != 0; rest &= rest - 1)
                    if (crossesAt(sub, left + std::countr_zero(rest), top + static_cast<int64_t>(k)))
                        return true;
        }
    return false;
}

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
    scratch_.places.clear();
    scratch_.cells.clear();
    scratch_.near.clear();
    // Texels are far away: while those of one cell come, the next ones are found.
    const bool tooMany = p.forMixed(map_, node.sub, [&](const CellMap::Place &cell) {
        map_.prefetch(cell);
        scratch_.places.push_back(cell);
        scratch_.near.push_back(nearAt(cell.x, cell.y));
        return scratch_.places.size() > kMostListed;
    });
    if (tooMany)
        return false;
    for (size_t n = 0; n < scratch_.places.size(); ++n) {
        const Cell cell = map_.read(scratch_.places[n]);
        scratch_.cells.push_back(cell);
        piece_.setValues(scratch_.near[n], cell);
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
        if (crosses(node.sub, scratch_.cells[which], scratch_.near[which])) {
            unknown(node);
            return;
        }
    }
    uniform(node, level_);
}

bool Classifier::Walk::crossesAt(const SubTriangle &sub, int64_t x, int64_t y)
{
    if (!piece_.touches(cornerIn(sub, x, y), sub.size < 0))
        return false;
    const Cell cell = map_.cell(x, y);
    NearCell near{};
    piece_.setValues(near, cell);
    return crosses(sub, cell, near);
}

bool Classifier::Walk::crosses(const SubTriangle &sub, const Cell &cell, const NearCell &near)
{
    if (texture_.filter == Filter::Bilinear)
        if (const Crossing crossing = piece_.quick(cornerIn(sub, cell.x, cell.y), sub.size < 0, near);
            crossing != Crossing::Open)
            return crossing == Crossing::Yes;
    return crosses(sub, cell);
}

bool Classifier::Walk::crosses(const SubTriangle &sub, const Cell &cell)
{
    const Crossing crossing = piece_(cornerIn(sub, cell.x, cell.y), sub.size < 0, cell);
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
        const Float4 value =
            (texels[0] * (one - a) + texels[1] * a) * (one - b) + (texels[2] * (one - a) + texels[3] * a) * b;
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
