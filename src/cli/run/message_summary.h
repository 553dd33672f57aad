// SPDX-License-Identifier: Apache-2.0
// The layer's messages of one run, as its setting report_file writes them.
#pragma once

#include <cstddef>
#include <istream>
#include <string>
#include <vector>

namespace vellum::cli
{

enum class MessageSeverity { Info, Warning, Error };

struct MessageSummary {
    struct Kind {
        MessageSeverity severity;
        std::string id;
        std::string text; // of the first
        size_t count;
    };
    std::vector<Kind> kinds; // of warnings and errors, in the order of the first of each
    size_t errors = 0;
    size_t warnings = 0;
    size_t devices = 0; // whose micromaps the layer provides or validates
};

MessageSummary readMessages(std::istream &lines);

// On stderr.
void print(const MessageSummary &summary);

} // namespace vellum::cli
