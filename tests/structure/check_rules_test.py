#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tests check_rules.py on registries, tables, code and tests that are made up."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

CHECK = pathlib.Path(__file__).resolve().with_name("check_rules.py")
REGISTRY = """<registry><extensions>
  <extension name="VK_EXT_opacity_micromap"><require><command name="vkMapEXT"/></require></extension>
  <extension name="VK_KHR_device_address_commands"><require><command name="vkRangeKHR"/></require></extension>
</extensions></registry>
"""
RULES = {
    "vkMapEXT": ["VUID-vkMapEXT-a-00001", "VUID-vkMapEXT-a-parameter", "VUID-VkCopyMicromapInfoEXT-src-07532"],
    "vkRangeKHR": ["VUID-vkRangeKHR-b-00002", "VUID-vkRangeKHR-b-00003"],
    "vkOld": ["VUID-vkOld-b-00003", "VUID-vkOld-micromap-00004", "VUID-vkOld-c-00005"],
}
VUIDS = {"validation": {place: {"core": [{"vuid": vuid, "text": "words"} for vuid in vuids]}
                        for place, vuids in RULES.items()}}
TABLE = """vuid,extension,where,how,without,test
VUID-*-parameter,all,host,pointers,passed on,Suite.Case
VUID-vkMapEXT-a-00001,VK_EXT_opacity_micromap,gpu,data,works: all,Suite.Ca*
VUID-vkOld-micromap-00004,VK_EXT_opacity_micromap,open,order,undefined,
VUID-vkRangeKHR-b-00002,VK_KHR_device_address_commands,impossible,only the driver knows,ignored,
"""
CODE = 'say("VUID-vkMapEXT-"\n    "a-00001"); say("VUID-vkMapEXT-a-parameter"); // VUID-vkRangeKHR-b-00002\n'
PROGRAMS = 'constexpr WrongProgram kPrograms[] = {{"VUID-vkRangeKHR-b-00002", run}};\n'
TESTS = 'TEST(Suite, Case)\n{\n    expect("VELLUM-VUID-vkOld-micromap-00004");\n}\n'
PAGE = "# Page\n" + "".join(f"<!-- begin {name} -->\n<!-- end {name} -->\n" for name in ("own", "rules", "unchecked", "totals"))
CAUSES = """ids,severity,part,cause,cure
VUID-*-parameter,error,,A handle is null.,Pass an object.
VUID-*-00001 VUID-*-micromap-00004,error,,Wrong data.,Correct it.
"""


class CheckRules(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.root = pathlib.Path(self.folder.name)
        self.put("validusage.json", json.dumps(VUIDS))
        self.put("vk.xml", REGISTRY)
        self.put("src/layer/validation/rules.csv", TABLE)
        self.put("src/layer/validation/some.cpp", CODE)
        self.put("tests/validation/some_test.cpp", TESTS)
        self.put("tests/validation/some_programs.cpp", PROGRAMS)
        self.put("docs/messages.md", PAGE)
        self.put("src/layer/messages.csv", CAUSES)

    def put(self, name, text):
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(text, encoding="utf-8")

    def read(self, name):
        return (self.root / name).read_text(encoding="utf-8")

    def run_check(self, *options):
        result = subprocess.run([sys.executable, str(CHECK), *options, str(self.root / "validusage.json"),
                                 str(self.root)], stdout=subprocess.PIPE, text=True, check=False)
        return result.returncode, result.stdout

    def expect_finding(self, expected, table):
        self.put("src/layer/validation/rules.csv", table)
        self.run_check("--write")
        code, out = self.run_check()
        self.assertEqual(code, 1, out)
        self.assertIn(expected, out)

    def test_id_that_is_stated_twice(self):
        self.put("src/layer/base/other.cpp", 'say("VUID-vkMapEXT-a-00001");\n')
        self.expect_finding("src/layer: VUID-vkMapEXT-a-00001 is stated twice", TABLE)

    def test_impossible_rule_in_code(self):
        self.put("src/layer/base/other.cpp", 'say("VUID-vkRangeKHR-b-00002");\n')
        self.expect_finding("VUID-vkRangeKHR-b-00002: src/layer names it, and where is impossible", TABLE)

    def test_row_with_another_severity(self):
        self.put("src/layer/validation/some.cpp", 'say("VELLUM-VUID-vkMapEXT-a-parameter");\n')
        self.put("src/layer/rules/rows.cpp", 'Rule kRows[] = {{"VUID-vkMapEXT-a-00001", Reject, nullptr, find}};\n')
        self.expect_finding("VUID-vkMapEXT-a-00001: without is works: all, in src/layer/rules Reject", TABLE)

    def test_page_is_written(self):
        self.put("src/layer/messages.csv", CAUSES.replace(" VUID-*-micromap-00004", ""))
        code, out = self.run_check("--write")
        self.assertEqual((code, out), (0, "1 rules are open\n\n0 findings in 4 rules\n"))
        page = self.read("docs/messages.md")
        unchecked = page[page.index("begin unchecked"):]
        self.assertIn("| `VUID-vkRangeKHR-b-00002` | only the driver knows | ignored |\n", unchecked)
        self.assertIn("| `VUID-vkOld-micromap-00004` | order | undefined |\n", unchecked)
        self.assertNotIn("vkMapEXT", unchecked)
        self.assertIn("| gpu | 1 |", page)
        self.assertIn("| open | 1 |", page)
        rules = page[page.index("begin rules"):page.index("end rules")]
        self.assertIn("| `VELLUM-VUID-vkMapEXT-a-00001` | error | gpu | Wrong data. | Correct it. | works: all |\n", rules)
        self.assertIn("| `VELLUM-VUID-vkMapEXT-a-parameter` | error | core | A handle is null. | Pass an object. | passed on |\n",
                      rules)
        self.assertNotIn("vkRangeKHR", rules)

    def test_ids_that_are_put_together(self):
        self.put("src/layer/validation/rules/rule_check.h", '{"vkCmdOne", kAll}, {"vkCmdTwo", kAll},')
        self.put("src/layer/validation/rules/rule_check.cpp", 'say("-renderpass");\n')
        self.put("src/layer/messages.csv", CAUSES + "VUID-*-renderpass,error,,Inside.,Record outside.\n")
        self.put("src/layer/validation/rules.csv", TABLE + "VUID-*-renderpass,all,host,state,passed on,Suite.Case\n")
        self.run_check("--write")
        page = self.read("docs/messages.md")
        for command in ("vkCmdOne", "vkCmdTwo"):
            self.assertIn(f"| `VELLUM-VUID-{command}-renderpass` | error | core | Inside. | Record outside. | passed on |\n", page)

    def test_row_for_several_commands(self):
        self.put("src/layer/base/commands.inc", "VELLUM_DRAW(CmdDraw, Never)\nVELLUM_DEVICE(CmdCopy, Never)\n")
        self.put("src/layer/validation/traces.cpp", 'say("-micromap-00004");\n')
        self.put("src/layer/validation/ranges.cpp", 'FlaggedRange kRange{"vkRangeKHR", "b", "c"}; say("13097"); say("13100");\n')
        self.put("src/layer/messages.csv", CAUSES + "VUID-vkRangeKHR-*,error,,A range.,Pass another one.\n")
        self.put("src/layer/validation/rules.csv", TABLE.replace("VUID-vkOld-micromap-00004", "VUID-*-micromap-00004").replace(
            "open,order", "shader,order").replace("undefined,", "undefined,Suite.Case") +
            "".join(f"VUID-*-{number},all,host,flags,ignored,Suite.Case\n" for number in (13097, 13100)))
        self.put("tests/validation/b_programs.cpp", 'program("VUID-vkRangeKHR-b-13097");\n')
        code, out = self.run_check("--write")
        self.assertEqual(code, 1, out)
        self.assertIn("VUID-vkRangeKHR-c-13100: there is no test\n", out)
        self.assertNotIn("VUID-vkRangeKHR-b-13097", out)
        self.put("tests/validation/c_programs.cpp", 'program("VUID-vkRangeKHR-c-13100");\n')
        code, out = self.run_check("--write")
        self.assertEqual((code, out), (0, "0 rules are open\n\n0 findings in 6 rules\n"))
        page = self.read("docs/messages.md")
        for vuid in ("vkCmdDraw-micromap-00004", "vkRangeKHR-b-13097", "vkRangeKHR-c-13100"):
            self.assertIn(f"| `VELLUM-VUID-{vuid}` | error |", page)
        self.assertNotIn("vkCmdCopy", page)

    def test_messages_without_validation(self):
        self.put("src/layer/micromaps/some.cpp", 'reject("VELLUM-own"); reject("VUID-vkMapEXT-b-parameter");\n')
        self.put("src/layer/messages.csv", CAUSES + "VELLUM-own,error,,Words.,More words.\n")
        self.run_check("--write")
        page = self.read("docs/messages.md")
        self.assertIn("| `VELLUM-own` | error | always | Words. | More words. |\n", page[:page.index("end own")])
        self.assertIn("| `VELLUM-VUID-vkMapEXT-b-parameter` | error | always | A handle is null. | Pass an object. | rejected |\n",
                      page)

    def test_causes(self):
        self.put("src/layer/messages.csv", CAUSES.replace("VUID-*-00001 ", ""))
        self.expect_finding("messages.csv: VUID-vkMapEXT-a-00001 has 0 causes", TABLE)
        self.put("src/layer/messages.csv", CAUSES + "VUID-*-a-00001,error,,Words.,Words.\n")
        self.expect_finding("messages.csv: VUID-vkMapEXT-a-00001 has 2 causes", TABLE)
        self.put("src/layer/messages.csv", CAUSES + "VUID-*-00009,error,,Words.,Words.\n")
        self.expect_finding("messages.csv: there is no message VUID-*-00009", TABLE)

    def test_stale_page(self):
        self.run_check("--write")
        self.put("docs/messages.md", self.read("docs/messages.md").replace("Correct it.", "Ignore it."))
        self.assertIn("docs/messages.md: the tables are stale", self.run_check()[1])

    def test_only_the_implementation_reports(self):
        self.put("src/layer/micromaps/some.cpp", CODE)
        self.put("src/layer/validation/some.cpp", "")
        self.run_check("--write")
        self.assertIn("| total | 4 | 2 of them are not", self.read("docs/messages.md"))

    def test_tests_are_filled_in(self):
        self.run_check("--write")
        table = self.read("src/layer/validation/rules.csv")
        self.assertIn("order,undefined,Suite.Case\n", table)
        self.assertIn("pointers,passed on,Suite.Case\n", table)
        self.assertIn("knows,ignored,some_programs.cpp\n", table)

    def test_ends_of_ids(self):
        self.put("src/layer/validation/more.cpp", 'say("-micromap-00004");\n')
        self.put("tests/validation/some_test.cpp", TESTS.replace("vkOld", "vkOther"))
        self.put("src/layer/validation/rules.csv", TABLE.replace("open,order,undefined,", "sync,order,undefined,"))
        self.assertEqual(self.run_check("--write"), (0, "0 rules are open\n\n0 findings in 4 rules\n"))
        self.assertIn("order,undefined,Suite.Case\n", self.read("src/layer/validation/rules.csv"))

    def test_wrong_programs(self):
        table = TABLE.replace("knows,ignored,", "knows,ignored,WrongPrograms.VUID")
        self.put("src/layer/validation/rules.csv", table)
        self.run_check("--write")
        self.assertIn("knows,ignored,some_programs.cpp\n", self.read("src/layer/validation/rules.csv"))
        self.put("tests/validation/some_programs.cpp", "")
        self.assertEqual(self.run_check()[0], 1)

    def test_missing_rows(self):
        for vuid in ("VUID-vkMapEXT-a-00001", "VUID-vkOld-micromap-00004", "VUID-vkRangeKHR-b-00002"):
            rest = "".join(line for line in TABLE.splitlines(True) if vuid not in line)
            self.expect_finding(f"rules.csv: no row for {vuid}\n", rest)

    def test_unknown_words(self):
        self.expect_finding("where is cpu", TABLE.replace("gpu", "cpu"))
        self.expect_finding("extension is VK_EXT_other", TABLE.replace("VK_EXT_opacity_micromap", "VK_EXT_other"))
        self.expect_finding("without is fine", TABLE.replace("works: all", "fine"))
        self.expect_finding("how is empty", TABLE.replace("only the driver knows", ""))

    def test_order(self):
        lines = TABLE.splitlines(True)
        self.put("src/layer/validation/rules.csv", "".join([*lines, lines[-1]]))
        self.assertIn("a rule has two", self.run_check()[1])

    def test_missing_tests(self):
        self.expect_finding("there is no test Suite.Cz*\n", TABLE.replace("Suite.Ca*", "Suite.Cz*"))
        self.put("src/layer/validation/rules.csv", TABLE.replace("Suite.Ca*", "some_programs.cpp"))
        self.assertIn("there is no test some_programs.cpp\n", self.run_check()[1])

    def test_other_ids_in_code(self):
        self.put("src/layer/validation/some.cpp", CODE.replace("a-00001", "a-00009"))
        self.run_check("--write")
        self.assertIn("rules.csv has no row for VUID-vkMapEXT-a-00009\n", self.run_check()[1])
        self.assertIn("| open | 2 |", self.read("docs/messages.md"))


if __name__ == "__main__":
    unittest.main()
