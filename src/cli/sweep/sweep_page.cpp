// SPDX-License-Identifier: Apache-2.0
// The chart of `vellum sweep`, and the page with it.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

#include "base/picture.h"
#include "base/text.h"
#include "cli/sweep/sweep.h"
#include "inspect/page.h"

namespace vellum::cli
{
namespace
{

struct Series {
    const char *name;
    const char *color;
    std::vector<const SweepRow *> rows; // joined by a line
};

std::vector<Series> seriesOf(const std::vector<SweepRow> &rows)
{
    std::vector<Series> series = {{"budgets", "#d55e00", {}},
                                  {"levels, 4 states", "#0a5fbf", {}},
                                  {"levels, 2 states: what is proven", "#59616c", {}}};
    for (const SweepRow &row : rows)
        if (!row.tooLarge)
            series[row.setting.budget ? 0 : row.setting.format == Format::FourState ? 1 : 2].rows.push_back(&row);
    return series;
}

// Bytes on a logarithmic scale to the right, the known share of the surface upwards.
class Chart
{
public:
    explicit Chart(const Sweep &sweep) : sweep_(sweep), series_(seriesOf(sweep.rows))
    {
        double low = 1e300;
        double high = 1;
        for (const Series &series : series_)
            for (const SweepRow *row : series.rows) {
                low = std::min(low, std::log2(static_cast<double>(std::max<uint64_t>(row->bytes, 1))));
                high = std::max(high, std::log2(static_cast<double>(std::max<uint64_t>(row->bytes, 1))));
            }
        low_ = std::floor(std::min(low, high));
        high_ = std::max(std::ceil(high), low_ + 2);
    }

    std::string draw()
    {
        svg_ = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"system-ui, "
                           "'DejaVu Sans', sans-serif\" font-size=\"12\" fill=\"#15181d\" role=\"img\" "
                           "aria-label=\"Share of the surface that is known, by bytes of micromaps\">\n"
                           "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
                           kWidth, kHeight);
        drawAxes();
        for (const Series &series : series_)
            drawSeries(series);
        drawRecommendation();
        return svg_ + "</svg>\n";
    }

private:
    static constexpr double kWidth = 900, kHeight = 470;
    static constexpr double kLeft = 64, kRight = 24, kTop = 52, kBottom = 54;

    [[nodiscard]] double x(double logBytes) const
    {
        return kLeft + (kWidth - kLeft - kRight) * (logBytes - low_) / (high_ - low_);
    }
    [[nodiscard]] static double y(double known) { return kTop + (kHeight - kTop - kBottom) * (1 - known); }
    // 2 states know everything; what is of interest is how much of it is proven.
    [[nodiscard]] static double shown(const SweepRow &row)
    {
        return row.setting.format == Format::TwoState ? row.proven : row.known;
    }
    [[nodiscard]] double x(const SweepRow &row) const
    {
        return x(std::log2(static_cast<double>(std::max<uint64_t>(row.bytes, 1))));
    }
    void text(double x, double y, const char *anchor, const char *color, const std::string &words)
    {
        svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n", x, y, anchor,
                            color, markupText(words));
    }
    void line(double x1, double y1, double x2, double y2, const char *color)
    {
        svg_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\"/>\n", x1, y1, x2, y2, color);
    }

    void drawAxes();
    void drawSeries(const Series &series);
    void drawRecommendation();

    const Sweep &sweep_;
    std::vector<Series> series_;
    double low_ = 0; // of the logarithm
    double high_ = 0;
    std::string svg_;
};

void Chart::drawAxes()
{
    constexpr const char *kMuted = "#59616c";
    for (int tenth = 0; tenth <= 10; tenth += 2) {
        line(kLeft, y(tenth / 10.0), kWidth - kRight, y(tenth / 10.0), "#dfe2e7");
        text(kLeft - 8, y(tenth / 10.0) + 4, "end", kMuted, fmt::format("{} %", 10 * tenth));
    }
    const double step = high_ - low_ > 14 ? 2 : 1;
    for (double log = low_; log <= high_; log += step) {
        line(x(log), y(0), x(log), y(0) + 5, kMuted);
        text(x(log), y(0) + 20, "middle", kMuted, shortBytes(std::exp2(log)));
    }
    text((kLeft + kWidth - kRight) / 2, kHeight - 12, "middle", kMuted,
         sweep_.bakeable > 1 ? "bytes of micromaps of all files" : "bytes of micromaps");
    text(kLeft - 48, 18, "start", "#15181d", "share of the alpha-tested surface that is known");
    double right = kWidth - kRight;
    for (auto series = series_.rbegin(); series != series_.rend(); ++series) {
        text(right, 18, "end", series->color, series->name);
        right -= 6.6 * static_cast<double>(std::string_view(series->name).size()) + 20;
    }
}

void Chart::drawSeries(const Series &series)
{
    std::string path;
    for (const SweepRow *row : series.rows)
        if (row->setting.level || row->setting.budget)
            path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(*row), y(shown(*row)));
    svg_ += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n", path, series.color);
    for (const SweepRow *row : series.rows) {
        const bool budget = row->setting.budget.has_value();
        const bool two = row->setting.format == Format::TwoState;
        svg_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" stroke=\"{}\">", x(*row),
                            y(shown(*row)), budget ? 3 : 4, two ? "#ffffff" : series.color, series.color);
        svg_ += fmt::format("<title>{}: {} bytes, {} known</title></circle>\n", markupText(row->options()),
                            grouped(row->bytes), percent(shown(*row)));
        if (budget)
            continue;
        // Names of 2 states are above their line, those of 4 states below theirs, and automatic levels' below these.
        if (two && row->setting.level)
            text(x(*row) - 7, y(shown(*row)) - 7, "end", series.color, std::to_string(*row->setting.level));
        else if (row->setting.level)
            text(x(*row) + 7, y(shown(*row)) + 15, "start", series.color, std::to_string(*row->setting.level));
        else if (!two)
            text(x(*row) + 7, y(shown(*row)) + 28, "start", series.color, "auto");
    }
}

void Chart::drawRecommendation()
{
    if (!sweep_.recommendation)
        return;
    const SweepRow &row = sweep_.rows[sweep_.recommendation->row];
    svg_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"9\" fill=\"none\" stroke=\"#007a5e\" "
                        "stroke-width=\"2\"/>\n",
                        x(row), y(row.known));
    const bool left = x(row) > kWidth / 2;
    line(x(row), y(row.known) + 9, x(row), y(row.known) + 44, "#007a5e");
    text(x(row) + (left ? 6 : -6), y(row.known) + 58, left ? "end" : "start", "#007a5e",
         "recommended: " + row.options());
}

std::string htmlTableOf(const Sweep &sweep)
{
    std::string html = "<div class=\"scroll\"><table>\n";
    size_t row = 0; // 0 is the head
    for (const auto &cells : tableOf(sweep)) {
        const bool chosen = sweep.recommendation && sweep.recommendation->row + 1 == row;
        html += chosen ? "<tr class=\"chosen\">" : "<tr>";
        for (const std::string &cell : cells)
            html += (row == 0 ? "<th>" : "<td>") + markupText(cell);
        html += "</tr>\n";
        ++row;
    }
    return html + "</table></div>\n";
}

} // namespace

std::string sweepChart(const Sweep &sweep)
{
    return std::string(kSvgMark) + "\n" + Chart(sweep).draw();
}

std::string sweepPage(const Sweep &sweep)
{
    const std::string title =
        sweep.files.size() == 1 ? sweep.files[0].path : counted(sweep.bakeable, "file") + " with opacity micromaps";
    std::string page;
    if (sweep.bakeable > 1)
        page +=
            "<p class=\"muted\">Bytes of all files together; the share of the surface is the mean of the files.</p>\n";
    if (sweep.recommendation)
        page += fmt::format("<p><b>Recommended: <code>vellum bake {}</code></b>: {}.</p>\n",
                            markupText(sweep.recommendation->options), markupText(sweep.recommendation->reason));
    page += "<div class=\"scroll\">" + Chart(sweep).draw() + "</div>\n" + htmlTableOf(sweep);
    for (const char *text : {kBytesText, kShaderCallsText, kApproximateText})
        page += fmt::format("<p class=\"muted\">{}</p>\n", text);
    if (const std::string text = exclusionsText(sweep); !text.empty())
        page += fmt::format("<p class=\"muted\">{}.</p>\n", markupText(text));
    return inspect::plainPage(title + " – settings of vellum bake", page);
}

} // namespace vellum::cli
