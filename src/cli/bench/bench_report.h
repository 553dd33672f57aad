// SPDX-License-Identifier: Apache-2.0
// The report of `vellum bench`: one JSON document, and a web page that holds it.
#pragma once

#include <string>
#include <vector>

#include "cli/bench/part.h"

namespace vellum::cli
{

// The meaning of the results, in sentences: can they be trusted, is the device right, what do micromaps save, what does
// the layer cost.
std::vector<std::string> verdictOf(const std::vector<PartResult> &results);

// Returns whether each self-check tested something, and found no failure.
bool selfChecksPassed(const std::vector<PartResult> &results);

// schema.json describes it. Without anything that names a person or a machine.
std::string benchJson(const std::vector<PartResult> &results, const std::vector<std::string> &verdict, double seconds);

// A page that needs no other file. `json`: of benchJson.
std::string benchPage(const std::string &json);

} // namespace vellum::cli
