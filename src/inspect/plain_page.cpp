// SPDX-License-Identifier: Apache-2.0
#include "inspect/plain_page.h"

#include "base/text.h"
#include "inspect/page_files.h"

namespace vellum::inspect
{

std::string plainPage(const std::string &title, const std::string &body)
{
    std::string page;
    std::string_view rest = kPage_plain_html;
    for (const auto &[mark, text] : {std::pair<std::string_view, std::string>("<!--@title-->", markupText(title)),
                                     {"<!--@title-->", markupText(title)},
                                     {"<!--@body-->", body}}) {
        const size_t at = rest.find(mark);
        page.append(rest.substr(0, at)).append(text);
        rest.remove_prefix(at + mark.size());
    }
    return page.append(rest);
}

} // namespace vellum::inspect
