// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <gtest/gtest.h>

using vellum::matchesPattern;

TEST(NamePattern, Matches)
{
    for (const auto &[name, pattern] : std::vector<std::pair<const char *, const char *>>{{"", ""},
                                                                                          {"", "*"},
                                                                                          {"leaf", "leaf"},
                                                                                          {"leaf", "l*"},
                                                                                          {"leaf", "*f"},
                                                                                          {"leaf", "l??f"},
                                                                                          {"leaf", "*e*f"},
                                                                                          {"aab", "*ab"},
                                                                                          {"leaf", "[k-m]*"},
                                                                                          {"leaf", "[!a-k]eaf"},
                                                                                          {"l]af", "l[]]af"},
                                                                                          {"a*b", "a\\*b"},
                                                                                          {"a-b", "a[x-]b"},
                                                                                          {"a[b", "a[b"},
                                                                                          {"\u00e9", "?"},
                                                                                          {"\u00e9", "[\u00e8-\u00ea]"},
                                                                                          {"a/b", "a*b"},
                                                                                          {"leaf", "leaf**"}})
        EXPECT_TRUE(matchesPattern(name, pattern)) << name << " " << pattern;
}

TEST(NamePattern, DoesNotMatch)
{
    for (const auto &[name, pattern] : std::vector<std::pair<const char *, const char *>>{{"leaf", ""},
                                                                                          {"", "?"},
                                                                                          {"leaf", "eaf"},
                                                                                          {"leaf", "Leaf"},
                                                                                          {"leaf", "lea"},
                                                                                          {"leaf", "l?f"},
                                                                                          {"leaf", "*g*"},
                                                                                          {"leaf", "[!a-z]eaf"},
                                                                                          {"aXb", "a\\*b"},
                                                                                          {"leaf", "[m-k]eaf"},
                                                                                          {"leaf", "leaf?"}})
        EXPECT_FALSE(matchesPattern(name, pattern)) << name << " " << pattern;
}
