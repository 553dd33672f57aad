// SPDX-License-Identifier: Apache-2.0
// The names of cases, "khr.resolution-query.0042", and their seeds.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "base/text.h"
#include "check/groups/group.h"

namespace vellum::cli
{

struct CaseId {
    check::Api api = check::Api::Khr;
    const check::Group *group = nullptr;
    uint32_t number = 0;

    friend bool operator==(const CaseId &, const CaseId &) = default;
};

const char *nameOf(check::Api api);
// "khr.resolution-query"
std::string nameOf(check::Api api, const check::Group &group);
std::string nameOf(const CaseId &id);
// Nothing if there is no such group, or the name is not of this form.
std::optional<CaseId> parseCase(std::string_view name);
// Returns whether the name of any case is accepted. The cases of a group go on after those of a full run, for
// --minutes: they are tried up to the number 9999.
bool anyCase(const std::function<bool(const std::string &name)> &accepts);
// Null if there is none.
const check::Group *findGroup(std::string_view name);

// Depends on nothing else, so that a case stays the same from one run and one machine to the next.
uint64_t seedOf(uint64_t seed, const CaseId &id);

} // namespace vellum::cli
