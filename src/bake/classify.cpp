#include "bake/classify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include "bake/exact.h"
#include "bake/piece.h"
#include "bake/placement.h"

namespace vellum
{
namespace
{

// A sub-triangle with a box of more cells than this is divided before its cells are listed.
constexpr double kMostCells = 65536;

void fill(std::uint8_t *packed, std::uint32_t first, std::uint32_t count, State state)
{
    if (count < 4) {
        for (std::uint32_t i = first; i < first + count; ++i)
            writeState(packed, i, Format::FourState, state);
        return;
    }
    // A sub-triangle's micro-triangles are a run whose start and length are multiples of four states, one byte.
    std::memset(packed + first / 4, static_cast<int>(state) * 0x55, count / 4);
}

// The middles of the 16 micro-triangles two levels further down, as weights of the two steps.
constexpr std::array<Point, 16> kSamples = [] {
    std::array<Point, 16> samples;
    std::size_t n = 0;
    for (int i = 0; i < 4; ++i)
        for (int j = 0; i + j < 4; ++j) {
            samples[n++] = {(i + 1.0 / 3) / 4, (j + 1.0 / 3) / 4};
            if (i + j < 3)
                samples[n++] = {(i + 2.0 / 3) / 4, (j + 2.0 / 3) / 4};
        }
    return samples;
}();

} // namespace

// One triangle on its way down the tree of sub-triangles, in the order of the curve.
//
// A sub-triangle comes with the list of mixed cells that it touches. Divided, it hands each of its four parts those
// that the part touches. A part with none has one outcome all over, and what it is follows from the part before it on
// the curve, with which it shares points, or else from any point of it. At the bottom, each cell of the list is looked at
// closely. The lists are made in single precision with room for its rounding: a cell too many costs time only.
class Classifier::Walk
{
public:
    Walk(const Classifier &classifier, const TriangleUvs &uvs, std::uint32_t level, std::uint8_t *packed,
         ClassifierScratch &scratch)
        : m_texture(classifier.m_texture), m_cutoff(classifier.m_options.cutoff), m_map(classifier.m_map), m_uvs(uvs),
          m_level(level), m_packed(packed), m_scratch(scratch),
          m_place(m_texture, m_map, classifier.m_options, uvs, level),
          m_piece(m_place, m_texture.filter, classifier.m_thresholds)
    {
    }

    void run() { descendWide({{0, 0, 1 << m_level}, 0, false}, 0); }

private:
    using Near = ClassifierScratch::Near;

    // A sub-triangle of the level `depth`, its place on the curve, and whether the curve runs through it from the
    // lattice point (i + size, j) instead of (i, j).
    struct Node {
        SubTriangle sub;
        std::uint32_t index;
        bool swapped;
    };
    // The parts of a sub-triangle: at its lattice point, towards vertex 1, towards vertex 2, and in the middle.
    enum Part : std::size_t { kAtCorner, kTowardsI, kTowardsJ, kMiddle };

    static Node part(const Node &node, std::size_t child)
    {
        const auto [i, j, size] = node.sub;
        const std::int32_t half = size / 2;
        const std::uint32_t index = node.index * 4 + static_cast<std::uint32_t>(child);
        switch (partOf(node, child)) {
        case kAtCorner: return {{i, j, half}, index, node.swapped != (child == 3)};
        case kTowardsI: return {{i + half, j, half}, index, node.swapped != (child == 3)};
        case kTowardsJ: return {{i, j + half, half}, index, !node.swapped};
        default: return {{i + half, j + half, -half}, index, !node.swapped};
        }
    }
    // The curve enters a triangle at one corner, turns in the middle, and leaves it at vertex 2's.
    static Part partOf(const Node &node, std::size_t child)
    {
        switch (child) {
        case 0: return node.swapped ? kTowardsI : kAtCorner;
        case 1: return kMiddle;
        case 2: return node.swapped ? kAtCorner : kTowardsI;
        default: return kTowardsJ;
        }
    }

    // What the lists of a sub-triangle's parts are made with; lengths in cells, from a lattice point near by.
    struct Frame {
        std::int32_t i, j;
        float stepIx, stepIy, stepJx, stepJy;
        float lowX, lowY, highX, highY; // the box of a sub-triangle of size 1
        float area;
        float reachI, reachJ, reachSum; // half a cell in the three functions, margins and rounding
        float reachX, reachY;           // margins and rounding
        float valueLow, valueHigh;      // a value is surely transparent below, and opaque above
        bool bilinear;
    };

    void descendWide(const Node &node, std::uint32_t depth);
    void descend(const Frame &frame, const Node &node, std::uint32_t depth, std::size_t list, std::size_t count);
    void list(const Node &node, Frame &frame);
    unsigned partsTouched(const Frame &frame, const Node &node, std::uint32_t depth, const Near &cell) const;
    void uniform(const Node &node, std::uint32_t depth);
    void leaf(const Node &node, std::size_t list, std::size_t count);
    bool crosses(const SubTriangle &sub, const Cell &cell);
    int sideOf(const SubTriangle &sub);
    State guess(const SubTriangle &sub) const;
    const ExactTriangle &exact();

    const AlphaTexture &m_texture;
    double m_cutoff;
    const CellMap &m_map;
    const TriangleUvs &m_uvs;
    std::uint32_t m_level;
    std::uint8_t *m_packed;
    ClassifierScratch &m_scratch;
    Placement m_place;
    PieceTest m_piece;
    std::optional<ExactTriangle> m_exact;
    int m_side = -1; // of the part before on the curve: 1 opaque, 0 transparent, -1 unknown
};

const ExactTriangle &Classifier::Walk::exact()
{
    if (!m_exact)
        m_exact.emplace(m_texture, m_cutoff, m_uvs, m_level);
    return *m_exact;
}

// Lists the mixed cells of a sub-triangle, or divides it until it has few enough.
void Classifier::Walk::descendWide(const Node &node, std::uint32_t depth)
{
    if (!m_map.anyMixed()) {
        uniform(node, depth);
        return;
    }
    if (m_place.boxCells(node.sub) <= kMostCells) {
        Frame frame;
        list(node, frame);
        const std::size_t count = m_scratch.cells.size();
        m_scratch.lists.resize(count);
        for (std::size_t i = 0; i < count; ++i)
            m_scratch.lists[i] = static_cast<std::uint32_t>(i);
        if (count == 0)
            uniform(node, depth);
        else if (depth == m_level)
            leaf(node, 0, count);
        else
            descend(frame, node, depth, 0, count);
        return;
    }
    if (depth < m_level) {
        for (std::size_t child = 0; child < 4; ++child)
            descendWide(part(node, child), depth + 1);
        return;
    }
    const bool mixed =
        m_place.forMixed(m_map, node.sub, [&](const Cell &cell) { return crosses(node.sub, cell); });
    if (!mixed) {
        uniform(node, depth);
        return;
    }
    m_side = -1;
    writeState(m_packed, node.index, Format::FourState, guess(node.sub));
}

void Classifier::Walk::list(const Node &node, Frame &frame)
{
    const Placement &p = m_place;
    const Point origin = p.at(node.sub.i, node.sub.j);
    const double steps = std::abs(static_cast<double>(node.sub.size));
    const auto toFloat = [](double x) { return static_cast<float>(x); };
    // A few units in the last place of the largest coordinates and functions near here.
    constexpr double kRounding = 0x1p-20;
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
             m_texture.filter == Filter::Bilinear};
    const double valueRounding = p.valueSlack + kRounding * (m_map.largest() + std::abs(m_cutoff));
    frame.valueLow = toFloat(m_piece.thresholds().transparent - valueRounding);
    frame.valueHigh = toFloat(m_piece.thresholds().opaque + valueRounding);

    m_scratch.cells.clear();
    m_scratch.near.clear();
    p.forMixed(m_map, node.sub, [&](const Cell &cell) {
        const double x = static_cast<double>(cell.x - p.baseX) - origin.x;
        const double y = static_cast<double>(cell.y - p.baseY) - origin.y;
        const Point middle{x + 0.5, y + 0.5};
        // Not a number where one of the texels is not finite, which keeps every part from being dropped.
        const float f00 = cell.f00 + 0 * (cell.f10 + cell.f01 + cell.f11);
        m_scratch.cells.push_back(cell);
        m_scratch.near.push_back({toFloat(x), toFloat(y),
                                  toFloat(p.gradientI.x * middle.x + p.gradientI.y * middle.y),
                                  toFloat(p.gradientJ.x * middle.x + p.gradientJ.y * middle.y), f00, cell.f10 - f00,
                                  cell.f01 - f00, cell.f11 - cell.f10 - cell.f01 + f00});
        return false;
    });
}

// Which parts of a sub-triangle a cell touches and may change the outcome in, as bits by Part.
unsigned Classifier::Walk::partsTouched(const Frame &frame, const Node &node, std::uint32_t depth,
                                        const Near &cell) const
{
    const auto half = static_cast<float>(node.sub.size / 2);
    const auto i = static_cast<float>(node.sub.i - frame.i);
    const auto j = static_cast<float>(node.sub.j - frame.j);
    const float flip = half < 0 ? -1.0f : 1.0f;
    // Three lines divide a triangle into its four parts: i, j and their sum half way.
    const float fromI = flip * (cell.i - (i + half) * frame.area);
    const float fromJ = flip * (cell.j - (j + half) * frame.area);
    const float fromSum = flip * (cell.i + cell.j - (i + j + half) * frame.area);
    const bool before[] = {fromI <= frame.reachI, fromJ <= frame.reachJ, fromSum <= frame.reachSum};
    const bool behind[] = {fromI >= -frame.reachI, fromJ >= -frame.reachJ, fromSum >= -frame.reachSum};
    const bool touched[] = {before[2] && before[0] && before[1], behind[0] && behind[2] && before[1],
                            behind[1] && behind[2] && before[0], before[0] && before[1] && behind[2]};
    unsigned result = 0;
    const float x = i * frame.stepIx + j * frame.stepJx - cell.x;
    const float y = i * frame.stepIy + j * frame.stepJy - cell.y;
    const float steps = half * flip;
    const bool small = frame.bilinear && (frame.highX - frame.lowX) * steps < 2 && (frame.highY - frame.lowY) * steps < 2;
    for (std::size_t k = 0; k < 4; ++k) {
        if (!touched[k])
            continue;
        const bool down = (k == kMiddle) != (half < 0);
        const float px = x + (k == kTowardsI || k == kMiddle ? half * frame.stepIx : 0) +
                         (k == kTowardsJ || k == kMiddle ? half * frame.stepJx : 0);
        const float py = y + (k == kTowardsI || k == kMiddle ? half * frame.stepIy : 0) +
                         (k == kTowardsJ || k == kMiddle ? half * frame.stepJy : 0);
        float x0 = px + (down ? -frame.highX : frame.lowX) * steps - frame.reachX;
        float x1 = px + (down ? -frame.lowX : frame.highX) * steps + frame.reachX;
        float y0 = py + (down ? -frame.highY : frame.lowY) * steps - frame.reachY;
        float y1 = py + (down ? -frame.lowY : frame.highY) * steps + frame.reachY;
        if (x1 < 0 || x0 > 1 || y1 < 0 || y0 > 1)
            continue;
        if (small) {
            // The extremes over the box of the part are at its corners.
            x0 = std::max(x0, 0.0f);
            y0 = std::max(y0, 0.0f);
            x1 = std::min(x1, 1.0f);
            y1 = std::min(y1, 1.0f);
            const float left = cell.cy + cell.cxy * x0;
            const float right = cell.cy + cell.cxy * x1;
            const float f00 = cell.f00 + cell.cx * x0 + left * y0;
            const float f10 = cell.f00 + cell.cx * x1 + right * y0;
            const float f01 = cell.f00 + cell.cx * x0 + left * y1;
            const float f11 = cell.f00 + cell.cx * x1 + right * y1;
            const float low = std::min(std::min(f00, f10), std::min(f01, f11));
            const float high = std::max(std::max(f00, f10), std::max(f01, f11));
            if (low >= frame.valueHigh || high < frame.valueLow)
                continue;
        }
        result |= 1u << k;
    }
    static_cast<void>(depth);
    return result;
}

void Classifier::Walk::descend(const Frame &frame, const Node &node, std::uint32_t depth, std::size_t list,
                               std::size_t count)
{
    std::vector<std::uint32_t> &lists = m_scratch.lists;
    const std::size_t start = list + count;
    if (lists.size() < start + 4 * count)
        lists.resize(start + 4 * count);
    std::array<std::size_t, 4> counts{};
    for (std::size_t n = 0; n < count; ++n) {
        const std::uint32_t cell = lists[list + n];
        const unsigned parts = partsTouched(frame, node, depth, m_scratch.near[cell]);
        for (std::size_t k = 0; k < 4; ++k) {
            lists[start + k * count + counts[k]] = cell;
            counts[k] += parts >> k & 1;
        }
    }
    // One after the other, so that each list can be followed by those below it.
    std::size_t next = start;
    std::array<std::size_t, 4> begins{};
    for (std::size_t k = 0; k < 4; ++k) {
        std::copy_n(lists.begin() + static_cast<std::ptrdiff_t>(start + k * count), counts[k],
                    lists.begin() + static_cast<std::ptrdiff_t>(next));
        begins[k] = next;
        next += counts[k];
    }
    for (std::size_t child = 0; child < 4; ++child) {
        const Part k = partOf(node, child);
        const Node below = part(node, child);
        if (counts[k] == 0) {
            uniform(below, depth + 1);
            continue;
        }
        if (depth + 1 == m_level) {
            leaf(below, begins[k], counts[k]);
            continue;
        }
        // Moves the list behind all four, where those below it have room.
        if (lists.size() < next + counts[k])
            lists.resize(next + counts[k]);
        std::copy_n(lists.begin() + static_cast<std::ptrdiff_t>(begins[k]), counts[k],
                    lists.begin() + static_cast<std::ptrdiff_t>(next));
        descend(frame, below, depth + 1, next, counts[k]);
    }
}

void Classifier::Walk::uniform(const Node &node, std::uint32_t depth)
{
    if (m_side < 0)
        m_side = sideOf(node.sub);
    const std::uint32_t below = microTriangleCount(m_level - depth);
    const State state = m_side < 0 ? State::UnknownOpaque : m_side == 1 ? State::Opaque : State::Transparent;
    fill(m_packed, node.index * below, below, state);
}

void Classifier::Walk::leaf(const Node &node, std::size_t list, std::size_t count)
{
    for (std::size_t n = 0; n < count; ++n) {
        if (crosses(node.sub, m_scratch.cells[m_scratch.lists[list + n]])) {
            m_side = -1;
            writeState(m_packed, node.index, Format::FourState, guess(node.sub));
            return;
        }
    }
    uniform(node, m_level);
}

bool Classifier::Walk::crosses(const SubTriangle &sub, const Cell &cell)
{
    Point corner = m_place.at(sub.i, sub.j);
    corner.x -= static_cast<double>(cell.x - m_place.baseX);
    corner.y -= static_cast<double>(cell.y - m_place.baseY);
    const Crossing crossing = m_piece(corner, sub.size < 0, cell);
    if (crossing != Crossing::Open)
        return crossing == Crossing::Yes;
    if (!m_place.exact)
        return true;
    Cell unwrapped = cell;
    unwrapped.x += m_place.unwrappedX - m_place.baseX;
    unwrapped.y += m_place.unwrappedY - m_place.baseY;
    return exact().crosses({{{sub.i, sub.j}, {sub.i + sub.size, sub.j}, {sub.i, sub.j + sub.size}}}, unwrapped);
}

// The outcome in a sub-triangle that has but one: that at its middle, if rounding allows to tell, or at a corner.
int Classifier::Walk::sideOf(const SubTriangle &sub)
{
    const Point corner = m_place.at(sub.i, sub.j);
    const double third = sub.size / 3.0;
    const double x = corner.x + third * (m_place.stepI.x + m_place.stepJ.x);
    const double y = corner.y + third * (m_place.stepI.y + m_place.stepJ.y);
    const double column = std::floor(x);
    const double row = std::floor(y);
    const std::int64_t cellX = m_place.baseX + static_cast<std::int64_t>(column);
    const std::int64_t cellY = m_place.baseY + static_cast<std::int64_t>(row);
    // Rounding can name a neighbour of the right cell. Where neither is mixed, they are alike.
    if (const int side = m_map.side(cellX, cellY); side >= 0)
        return side;
    const Cell cell = m_map.cell(cellX, cellY);
    const double a = x - column;
    const double b = y - row;
    if (m_texture.filter == Filter::Bilinear) {
        const double value = (double{cell.f00} * (1 - a) + double{cell.f10} * a) * (1 - b) +
                             (double{cell.f01} * (1 - a) + double{cell.f11} * a) * b;
        if (value >= m_cutoff + m_place.valueSlack)
            return 1;
        if (value < m_cutoff - m_place.valueSlack)
            return 0;
    } else if (std::abs(a - 0.5) > 2 * m_place.slack && std::abs(b - 0.5) > 2 * m_place.slack) {
        const float texel = b < 0.5 ? (a < 0.5 ? cell.f00 : cell.f10) : (a < 0.5 ? cell.f01 : cell.f11);
        if (std::isfinite(texel))
            return double{texel} >= m_cutoff ? 1 : 0;
    }
    return exact().side({sub.i, sub.j}, m_map);
}

// What most of an unknown micro-triangle is, by sampling.
State Classifier::Walk::guess(const SubTriangle &sub) const
{
    const Point corner = m_place.at(sub.i, sub.j);
    const double s = sub.size;
    unsigned opaque = 0;
    for (const Point &sample : kSamples) {
        const double x = corner.x + s * (sample.x * m_place.stepI.x + sample.y * m_place.stepJ.x);
        const double y = corner.y + s * (sample.x * m_place.stepI.y + sample.y * m_place.stepJ.y);
        const double column = std::floor(x);
        const double row = std::floor(y);
        const Cell cell = m_map.cell(m_place.baseX + static_cast<std::int64_t>(column),
                                     m_place.baseY + static_cast<std::int64_t>(row));
        double a = x - column;
        double b = y - row;
        if (m_texture.filter == Filter::Nearest) {
            a = a < 0.5 ? 0 : 1;
            b = b < 0.5 ? 0 : 1;
        }
        const double value = (double{cell.f00} * (1 - a) + double{cell.f10} * a) * (1 - b) +
                             (double{cell.f01} * (1 - a) + double{cell.f11} * a) * b;
        opaque += value >= m_cutoff ? 1u : 0u;
    }
    return 2 * opaque >= kSamples.size() ? State::UnknownOpaque : State::UnknownTransparent;
}

Classifier::Classifier(const AlphaTexture &texture, const BakeOptions &options)
    : m_texture(texture), m_options(options),
      m_thresholds{options.cutoff - options.valueTolerance, options.cutoff + options.valueTolerance},
      m_map(texture, m_thresholds)
{
}

std::uint32_t Classifier::levelFor(const TriangleUvs &uvs) const
{
    if (m_options.level)
        return *m_options.level;
    if (!usable(uvs, m_texture))
        return 0;
    const auto edge = [&](const TexCoord &from, const TexCoord &to) {
        return std::array<double, 2>{(double{to.u} - from.u) * m_texture.width,
                                     (double{to.v} - from.v) * m_texture.height};
    };
    const auto a = edge(uvs[0], uvs[1]);
    const auto b = edge(uvs[0], uvs[2]);
    const double area = std::abs(a[0] * b[1] - a[1] * b[0]);
    const double wanted = std::ceil(0.5 * std::log2(area / (m_options.texelsPerEdge * m_options.texelsPerEdge)));
    if (!(wanted > 0)) // a zero area gives -infinity, which must not be converted
        return 0;
    return static_cast<std::uint32_t>(std::min<double>(wanted, m_options.maxLevel));
}

void Classifier::classify(const TriangleUvs &uvs, std::uint32_t level, std::uint8_t *packed,
                          ClassifierScratch &scratch) const
{
    if (!usable(uvs, m_texture)) {
        fill(packed, 0, microTriangleCount(level), State::UnknownOpaque);
        return;
    }
    Walk(*this, uvs, level, packed, scratch).run();
}

} // namespace vellum
