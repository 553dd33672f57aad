#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests what each mutation operator writes, and what none of them touches."""
import unittest

import operators
import tokens


def mutations(source, operator=None):
    """The mutated texts of a source."""
    found = operators.mutants_of("file.cpp", source, operators.collect_flags([source]))
    return [mutant.apply(source) for mutant in found if operator in {None, mutant.operator}]


def inside(body, operator):
    """The mutants of a function's body, without the function."""
    return [text[len("void f()\n{\n"):-len("\n}\n")] for text in mutations(f"void f()\n{{\n{body}\n}}\n", operator)]


class Tokens(unittest.TestCase):
    def test_comments_strings_and_directives_are_no_code(self):
        source = '#include <a>\n#define B \\\n  1 < 2\n// a < b\n/* a\n < b */ const char *s = "a < b"; char c = \'<\';'
        texts = [token.text for token in tokens.tokenize(source)]
        self.assertEqual(texts, ["const", "char", "*", "s", "=", '"a < b"', ";", "char", "c", "=", "'<'", ";"])

    def test_raw_string(self):
        self.assertEqual([token.text for token in tokens.tokenize('f(R"x(a) " < )x", 1)')],
                         ["f", "(", 'R"x(a) " < )x"', ",", "1", ")"])

    def test_lines(self):
        self.assertEqual([token.line for token in tokens.tokenize("a\n/*\n*/ b\n\nc")], [1, 3, 5])

    def test_code_is_in_functions_only(self):
        source = "namespace a { struct B { int c; void d() const { e; } int f = 1; }; g = { h }; }"
        self.assertEqual([token.text for token in tokens.tokenize(source) if token.code], ["e", ";"])


class Operators(unittest.TestCase):
    def test_comparison(self):
        self.assertEqual(inside("return a < b;", "comparison"), ["return a <= b;"])
        self.assertEqual(inside("return a == b || c >= d;", "comparison"),
                         ["return a != b || c >= d;", "return a == b || c > d;"])

    def test_templates_references_and_pointers_are_no_operators(self):
        self.assertEqual(mutations("std::vector<int> f(const A &a, B *b, C &&c);\n"), [])

    def test_arithmetic(self):
        self.assertEqual(inside("x = a & b;", "arithmetic"), ["x = a | b;"])
        self.assertEqual(inside("x = a << b;", "arithmetic"), ["x = a >> b;"])
        self.assertEqual(inside("f(&a, -b, *c);", "arithmetic"), [])
        self.assertEqual(inside('x = "text " + f(a);', "arithmetic"), [])

    def test_constant(self):
        self.assertEqual(inside("x = 0;", "constant"), ["x = 1;"])
        self.assertEqual(inside("x = 12u;", "constant"), ["x = 11u;"])
        self.assertEqual(inside("x = 0x04u;", "constant"), ["x = 0x8u;"])
        self.assertEqual(inside("x = 0x07u;", "constant"), ["x = 0x6u;"])
        self.assertEqual(inside("x = 1.5f;", "constant"), [])

    def test_off_by_one(self):
        self.assertEqual(inside("x = w[i];", "off_by_one"), ["x = w[i + 1];"])
        self.assertEqual(inside("x = min(a, b);", "off_by_one"), ["x = min(a, b + 1);"])
        self.assertEqual(inside("for (i = 0; i < f(n).size(); ++i) {}", "off_by_one"),
                         ["for (i = 0; i < f(n).size() - 1; ++i) {}"])
        self.assertEqual(inside("auto [a, b] = c; [&a] {};", "off_by_one"), [])

    def test_operands(self):
        self.assertEqual(inside("x = a.b - f(c);", "operands"), ["x = f(c) - a.b;"])
        self.assertEqual(inside("f(a, g(b, 1));", "operands"), ["f(g(b, 1), a);", "f(a, g(1, b));"])
        self.assertEqual(inside("x = a ? b : f(c, c);", "operands"), ["x = a ? f(c, c) : b;"])
        self.assertEqual(inside('f("text", a);', "operands"), [])
        self.assertEqual(inside("x = a - 1 > 1;", "operands"), ["x = 1 - a > 1;"])

    def test_statement(self):
        self.assertEqual(inside("a = b;", "statement"), [";"])
        self.assertEqual(inside("if (a)\n    b->c(d);", "statement"), ["if (a)\n    ;"])
        self.assertEqual(inside("for (a = 0; b; ++c)\n    continue;", "statement"), ["for (a = 0; b; ++c)\n    ;"])

    def test_declarations_and_returns_stay(self):
        for text in ("const int a = b;", "Type a = b(c);", "std::vector<int> a(b);", "Type *a = b;", "Type &a = b;",
                     "return a(b);", "auto a = b;", "using namespace a;"):
            self.assertEqual(inside(text, "statement"), [], text)

    def test_barrier(self):
        self.assertEqual(inside("work.barrier(true);", "barrier"), [";"])
        self.assertEqual(inside("memoryBarrierBuffer();", "barrier"), [";"])
        self.assertEqual(inside("work.barrier();", "statement"), [])

    def test_condition(self):
        self.assertEqual(inside("if (a || b)\n    c;", "condition"), ["if (!(a || b))\n    c;"])
        self.assertEqual(inside("if (A *a = b())\n    c;", "condition"), [])

    def test_flag(self):
        self.assertIn("x = kRayNoOpaque & kRayNoOpaque;", inside("x = kRayOpaque & kRayNoOpaque;", "flag"))
        self.assertEqual(inside("f(VK_ACCESS_2_SHADER_READ_BIT, VK_ACCESS_2_SHADER_WRITE_BIT, VK_IMAGE_USAGE_STORAGE_BIT);",
                                "flag"),
                         ["f(VK_ACCESS_2_SHADER_WRITE_BIT, VK_ACCESS_2_SHADER_WRITE_BIT, VK_IMAGE_USAGE_STORAGE_BIT);",
                          "f(VK_ACCESS_2_SHADER_READ_BIT, VK_ACCESS_2_SHADER_READ_BIT, VK_IMAGE_USAGE_STORAGE_BIT);"])

    def test_what_only_the_compiler_sees(self):
        self.assertEqual(mutations("static_assert(a == 1);\nlayout(local_size_x = 64) in;\n"), [])

    def test_lines_keep_their_numbers(self):
        self.assertEqual(inside("f(a,\n  b);\ng(c);", "statement"), [";\n\ng(c);", "f(a,\n  b);\n;"])

    def test_ids(self):
        found = operators.mutants_of("a/b.h", "void f()\n{\n    a = 1 + 2;\n}\n", {})
        self.assertEqual([mutant.id for mutant in found if mutant.operator == "constant"],
                         ["a/b.h:3:constant:0", "a/b.h:3:constant:1"])


if __name__ == "__main__":
    unittest.main()
