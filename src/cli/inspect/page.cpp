// SPDX-License-Identifier: Apache-2.0
#include "cli/inspect/page.h"

#include "cli/inspect/encoding.h"
#include "cli/inspect/page_facts.h"
#include "cli/inspect/page_files.h"
#include "gltf/file/outside_file.h"

namespace vellum::cli
{

std::string makePage(const Document &document, const InspectedFile &file, const PageLimits &limits)
{
    const PageData data = makePageData(file, limits);
    const std::string facts = pageFacts(document, file, data, limits);
    const std::string numbers = base64Encoded(deflated(data.bytes()));
    std::string page;
    page.reserve(facts.size() + numbers.size() + 200'000);
    // The places in page.html where something belongs are comments.
    std::string_view rest = kPage_page_html;
    while (true) {
        const size_t begin = rest.find("<!--@");
        if (begin == std::string_view::npos)
            return page.append(rest);
        const size_t end = rest.find("-->", begin);
        page.append(rest.substr(0, begin));
        const std::string_view what = rest.substr(begin + 5, end - begin - 5);
        if (what == "title")
            page += htmlText(file.name);
        else if (what == "style")
            page.append("<style>\n").append(kPage_style_css).append("</style>");
        else if (what == "facts")
            page += "<script type=\"application/json\" id=\"facts\">" + facts + "</script>";
        else if (what == "numbers")
            page += "<script type=\"text/plain\" id=\"numbers\">" + numbers + "</script>";
        else if (what == "script") {
            page += "<script>\n\"use strict\";\n(() => {\n";
            for (const std::string_view script : {kPage_data_js, kPage_index_js, kPage_raster_js, kPage_viewer_js,
                                                  kPage_charts_js, kPage_details_js, kPage_main_js})
                page.append(script);
            page += "})();\n</script>";
        }
        rest.remove_prefix(end + 3);
    }
}

} // namespace vellum::cli
