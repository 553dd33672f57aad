# SPDX-License-Identifier: Apache-2.0
"""Mutation operators: each finds places in the tokens of a file and what to write there instead.

The sources are formatted by clang-format: binary operators have spaces on both sides, references, pointers and templates
do not. The parser relies on that.
"""
import dataclasses
import re

from tokens import tokenize

COMPARISONS = {"==": "!=", "!=": "==", "<": "<=", "<=": "<", ">": ">=", ">=": ">"}
ARITHMETIC = {"+": "-", "-": "+", "*": "+", "/": "*", "%": "/", "<<": ">>", ">>": "<<", "&": "|", "|": "&", "^": "|",
              "&&": "||", "||": "&&", "+=": "-=", "-=": "+=", "|=": "&=", "&=": "|=", "<<=": ">>=", ">>=": "<<="}
ASSIGNMENTS = {"=", "+=", "-=", "*=", "/=", "%=", "|=", "&=", "^=", "<<=", ">>="}
OPERAND_ENDS = {"name", "number", "string"}
STATEMENT_WORDS = {"return", "if", "else", "for", "while", "do", "switch", "case", "default", "using", "static_assert",
                   "const", "constexpr", "static", "auto", "typedef", "throw", "goto", "new", "delete", "layout"}
VULKAN_FLAG = re.compile(r"VK_\w+_BIT(?:_[A-Z0-9]+)?")
SHARED_FLAG = re.compile(r"k(Ray|Instance|Hit|State|Kind|Build|From|Descriptor|GeometryRecord)[A-Z]\w*")
NEVER_NEGATED = {"=", ";"}


@dataclasses.dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    operator: str
    ordinal: int  # among those of the operator in the line
    start: int
    end: int
    text: str

    @property
    def id(self):
        return f"{self.file}:{self.line}:{self.operator}:{self.ordinal}"

    def apply(self, source):
        return source[:self.start] + self.text + source[self.end:]


class File:
    """The tokens of one file and the queries of the operators about them."""

    def __init__(self, source, flags):
        self.source = source
        self.tokens = tokenize(source)
        self.flags = flags

    def binary(self, index):
        """Whether an operator has an operand and a space on both sides."""
        token = self.tokens[index]
        if token.kind != "punctuation" or not 0 < index < len(self.tokens) - 1:
            return False
        before = self.tokens[index - 1]
        spaced = self.source[token.start - 1].isspace() and self.source[token.end].isspace()
        return spaced and (before.kind in OPERAND_ENDS or before.text in {")", "]"})

    def text(self, first, last):
        return self.source[self.tokens[first].start:self.tokens[last].end]

    def operand_before(self, index):
        """The first token of the operand that ends before an operator."""
        first = index
        while True:
            first -= 1
            if self.tokens[first].text in {")", "]"}:
                first = self.tokens[first].match
                if first > 0 and self.tokens[first - 1].kind == "name":
                    first -= 1
            if first == 0 or self.tokens[first - 1].text not in {".", "->", "::"}:
                return first
            first -= 1

    def operand_after(self, index):
        """The last token of the operand that begins after an operator."""
        last = index + 1
        while self.tokens[last].text in {"-", "~", "!"}:
            last += 1
        if self.tokens[last].text == "(":
            last = self.tokens[last].match
        while last + 1 < len(self.tokens):
            following = self.tokens[last + 1].text
            if following in {"(", "["}:
                last = self.tokens[last + 1].match
            elif following in {".", "->", "::"}:
                last += 2
            else:
                break
        return last

    def statement(self, index):
        """The last token, a semicolon, of the expression statement that begins here; None if none does."""
        if not self.tokens[index].code or not self.begins_statement(index):
            return None
        first = self.tokens[index]
        if first.kind not in {"name", "punctuation"} or first.text in STATEMENT_WORDS or first.text in {"}", "{", ";"}:
            return None
        at, changes = index, False
        while self.tokens[at].text != ";":
            token, after = self.tokens[at], self.tokens[at + 1]
            declares = token.kind == "name" or (token.text in {">", "&", "*"} and not self.binary(at))
            if declares and after.kind == "name" and not changes:
                return None
            changes = changes or token.text in ASSIGNMENTS | {"++", "--", "("}
            if token.text in {"(", "[", "{"}:
                at = token.match
            elif token.text in {"}", ")", ":"}:
                return None
            at += 1
        return at if changes or first.text in {"break", "continue"} else None

    def begins_statement(self, index):
        before = self.tokens[index - 1]
        if before.text in {"{", "}", ";", "else"}:
            return not self.in_parentheses(index)
        return before.text == ")" and self.tokens[before.match - 1].text in {"if", "for", "while"}

    def in_parentheses(self, index):
        """Whether the closest open bracket is not a brace: the parts of a for loop."""
        at = index - 1
        while at >= 0 and self.tokens[at].text not in {"(", "[", "{"}:
            closing = self.tokens[at].text in {")", "]", "}"} and self.tokens[at].match >= 0
            at = self.tokens[at].match - 1 if closing else at - 1
        return at >= 0 and self.tokens[at].text != "{"


def comparison(file):
    for index, token in enumerate(file.tokens):
        if token.text in COMPARISONS and file.binary(index):
            yield token.start, token.end, COMPARISONS[token.text]


def arithmetic(file):
    for index, token in enumerate(file.tokens):
        if token.text in ARITHMETIC and file.binary(index):
            neighbours = (file.tokens[index - 1], file.tokens[index + 1], file.tokens[file.operand_before(index)])
            if all(neighbour.kind != "string" for neighbour in neighbours):
                yield token.start, token.end, ARITHMETIC[token.text]


def changed_number(text):
    digits = re.match(r"0[xX][0-9a-fA-F']+|\d[\d']*", text)
    if digits.end() < len(text) and text[digits.end()] in ".eE":
        return None
    suffix = text[digits.end():]
    if digits[0][:2] in {"0x", "0X"}:
        value = int(digits[0].replace("'", ""), 16)
        return hex(value ^ (value & -value) if value & (value - 1) else value << 1 & 0xffffffff) + suffix
    value = int(digits[0].replace("'", ""))
    return str(1 if value == 0 else value - 1) + suffix


def constant(file):
    """A number less by one, or a mask without its lowest bit, or another bit."""
    for index, token in enumerate(file.tokens):
        subscript = index > 0 and file.tokens[index - 1].text == "["
        if token.kind == "number" and not subscript and changed_number(token.text):
            yield token.start, token.end, changed_number(token.text)


def off_by_one(file):
    """One more than a subscript, a bound of a loop, or an argument of min."""
    for index, token in enumerate(file.tokens):
        if not token.code or token.match < 0:
            continue
        if token.text == "]" and file.tokens[token.match - 1].kind == "name" and file.tokens[token.match - 1].text != "auto" and token.match + 1 < index:
            yield token.start, token.end, " + 1]"
        elif token.text == ")" and file.tokens[token.match - 1].text == "min" and token.match + 1 < index:
            yield token.start, token.end, " + 1)"
        elif token.text == "(" and file.tokens[index - 1].text == "for":
            for at in range(index, token.match):
                if file.tokens[at].text in {"<", "<="} and file.binary(at):
                    end = file.tokens[file.operand_after(at)].end
                    yield end, end, " - 1"


def operands(file):
    """Operands of an operator whose order matters, the first two arguments of a call, or the branches of ?: exchanged."""
    for index, token in enumerate(file.tokens):
        if token.text in {"-", "<<", ">>", "<", ">", "/", "%"} and token.code and file.binary(index):
            first, last = file.operand_before(index), file.operand_after(index)
            left, right = file.text(first, index - 1), file.text(index + 1, last)
            yield file.tokens[first].start, file.tokens[last].end, f"{right} {token.text} {left}"
        elif token.text == "(" and token.code and file.tokens[index - 1].kind == "name":
            yield from exchanged_arguments(file, index)
        elif token.text == "?" and token.code:
            yield from exchanged_branches(file, index)


def exchanged_arguments(file, opening):
    closing = file.tokens[opening].match
    commas, at = [], opening + 1
    while at < closing:
        if file.tokens[at].text == "," and len(commas) < 2:
            commas.append(at)
        at = file.tokens[at].match + 1 if file.tokens[at].text in {"(", "[", "{"} else at + 1
    if not commas or file.tokens[opening - 1].text in {"if", "for", "while", "switch"}:
        return
    second = commas[1] if len(commas) > 1 else closing
    if any(token.kind == "string" for token in file.tokens[opening:second]):
        return
    first, other = file.text(opening + 1, commas[0] - 1), file.text(commas[0] + 1, second - 1)
    if first != other:
        yield file.tokens[opening + 1].start, file.tokens[second - 1].end, f"{other}, {first}"


def exchanged_branches(file, question):
    at = question + 1
    while file.tokens[at].text not in {":", ";", ")", "?"}:
        at = file.tokens[at].match + 1 if file.tokens[at].text in {"(", "[", "{"} else at + 1
    if file.tokens[at].text != ":":
        return
    colon = at
    at += 1
    while file.tokens[at].text not in {";", ")", ",", "]", "}", "?"}:
        at = file.tokens[at].match + 1 if file.tokens[at].text in {"(", "[", "{"} else at + 1
    if file.tokens[at].text != "?":
        yes, no = file.text(question + 1, colon - 1), file.text(colon + 1, at - 1)
        yield file.tokens[question + 1].start, file.tokens[at - 1].end, f"{no} : {yes}"


def is_barrier(file, first, last):
    return any("barrier" in token.text.lower() for token in file.tokens[first:last] if token.kind == "name")


def statement(file):
    for index in range(len(file.tokens)):
        last = file.statement(index)
        if last is not None and not is_barrier(file, index, last):
            yield file.tokens[index].start, file.tokens[last].end, ";"


def barrier(file):
    for index in range(len(file.tokens)):
        last = file.statement(index)
        if last is not None and is_barrier(file, index, last):
            yield file.tokens[index].start, file.tokens[last].end, ";"


def condition(file):
    for index, token in enumerate(file.tokens):
        if token.text != "if" or not token.code or file.tokens[index + 1].text != "(":
            continue
        closing = file.tokens[index + 1].match
        if any(inner.text in NEVER_NEGATED for inner in file.tokens[index + 2:closing]):
            continue
        yield (file.tokens[index + 2].start, file.tokens[closing - 1].end,
               f"!({file.text(index + 2, closing - 1)})")


def family(name):
    """Flags that may be mistaken for each other; None: not a flag."""
    if VULKAN_FLAG.fullmatch(name):
        return "_".join(name.split("_")[:3])
    found = SHARED_FLAG.fullmatch(name)
    return found[1] if found else None


def collect_flags(sources):
    """Families with their flags, from the texts of all files."""
    flags = {}
    for source in sources:
        for name in re.findall(r"\b(?:VK_\w+|k[A-Z]\w+)\b", source):
            if family(name):
                flags.setdefault(family(name), set()).add(name)
    return {name: sorted(members) for name, members in flags.items()}


def flag(file):
    """Another flag of the family."""
    for token in file.tokens:
        members = file.flags.get(family(token.text), []) if token.kind == "name" and token.code else []
        if token.text in members and len(members) > 1:
            yield token.start, token.end, members[(members.index(token.text) + 1) % len(members)]


OPERATORS = {function.__name__: function for function in (
    comparison, arithmetic, constant, off_by_one, operands, statement, barrier, condition, flag)}


def constant_expressions(tokens):
    """Ranges of tokens that only the compiler sees: static_assert, layout qualifiers."""
    for index, token in enumerate(tokens[:-1]):
        if token.text in {"static_assert", "layout"} and tokens[index + 1].text == "(":
            yield token.start, tokens[tokens[index + 1].match].end


def mutants_of(name, source, flags):
    """All mutants of a file. No two have the same text."""
    file = File(source, flags)
    excluded = list(constant_expressions(file.tokens))
    seen, mutants = set(), []
    for operator, find in OPERATORS.items():
        ordinals = {}
        for start, end, text in sorted(find(file)):
            if any(first <= start < last for first, last in excluded) or (start, end, text) in seen:
                continue
            if text == source[start:end]:  # equal operands, exchanged
                continue
            seen.add((start, end, text))
            line = source.count("\n", 0, start) + 1
            ordinal = ordinals.get(line, 0)
            ordinals[line] = ordinal + 1
            # A line keeps its number, because messages and assertions name it.
            lines = source.count("\n", start, end) - text.count("\n")
            mutants.append(Mutant(name, line, operator, ordinal, start, end, text + "\n" * lines))
    return mutants
