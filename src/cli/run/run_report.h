// SPDX-License-Identifier: Apache-2.0
// What `vellum run` reports: the layer's messages in the processes of a program, what was validated there, and how the
// program ended.
#pragma once

#include <filesystem>
#include <istream>
#include <string>
#include <vector>

#include "base/process.h"

namespace vellum::cli
{

// The layer's messages of one run, as its setting report_file writes them.
enum class MessageSeverity { Info, Warning, Error };

struct MessageSummary {
    struct Kind {
        MessageSeverity severity;
        std::string id;
        std::string text; // of the first
        size_t count;
        bool ignored = false; // by --ignore
    };
    std::vector<Kind> kinds;        // of warnings and errors, in the order of the first of each
    size_t instances = 0;           // Vulkan instances with the layer
    bool validated = false;         // one of them had validation
    size_t devices = 0;             // devices with micromaps of the layer, or with its validation
    size_t plainDevices = 0;        // devices on which the layer does nothing
    bool driversOwn = false;        // one of these has micromaps of the driver
    size_t checked = 0;             // devices on which builds were validated
    std::vector<std::string> parts; // of validation on these, "core, gpu", each set once

    // Without those that are ignored.
    [[nodiscard]] size_t count(MessageSeverity severity) const;
    [[nodiscard]] size_t ignored() const;
    // "core only": where parts of the validation were off; empty if all were on.
    [[nodiscard]] std::string partsInWords() const;
    // Why nothing was checked; empty if something was.
    [[nodiscard]] std::string whyUnchecked() const;
};

// `ignored`: the ids of --ignore.
MessageSummary readMessages(std::istream &lines, const std::vector<std::string> &ignored);

// A run, whole or not.
struct RunReport {
    std::vector<std::string> program; // its words
    std::string failOn;               // the option
    bool requireChecks = false;
    std::vector<std::string> ignored; // ids of --ignore
    std::string notRun;               // why the program was not run; empty if it was
    bool ended = true;
    ProgramEnd end;
    double seconds = 0;
    MessageSummary messages;
    int exitCode = 0; // of `vellum run`

    [[nodiscard]] bool fails(const MessageSummary::Kind &kind) const;
    // Why the layer's messages fail a program that succeeds; empty where they do not.
    [[nodiscard]] std::string failure() const;
    // Ids of --ignore that no message had.
    [[nodiscard]] std::vector<std::string> staleIgnores() const;
};

// Prints to stderr.
void print(const RunReport &report);
// JUnit's format: a test case for the program, one for its devices, and one for each kind of message.
std::string junitXml(const RunReport &report);
// src/cli/schema.json describes it.
std::string reportJson(const RunReport &report);

} // namespace vellum::cli
