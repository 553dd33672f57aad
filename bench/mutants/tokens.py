# SPDX-License-Identifier: Apache-2.0
"""Tokens of C++ and GLSL, and which of them are in the body of a function."""
import dataclasses
import re

TOKEN = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/)
      |(?P<directive>^[ \t]*\#(?:\\\n|[^\n])*)
      |(?P<string>R"(?P<tag>[^(\s]*)\(.*?\)(?P=tag)"|"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)+')
      |(?P<number>(?:0[xX][0-9a-fA-F']+|\d[\d']*\.?\d*(?:[eE][+-]?\d+)?)[a-zA-Z]*)
      |(?P<name>[A-Za-z_]\w*)
      |(?P<punctuation><<=|>>=|<=>|\.\.\.|->|::|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE)

CLOSING = {"(": ")", "[": "]", "{": "}"}
SCOPES = {"namespace", "class", "struct", "union", "enum", "extern", "buffer", "uniform"}


@dataclasses.dataclass
class Token:
    kind: str
    text: str
    start: int
    end: int
    line: int
    code: bool = False  # in the body of a function
    match: int = -1     # index of the bracket that belongs to this one


def tokenize(source):
    """Tokens without comments, directives and white space."""
    tokens, line, at = [], 1, 0
    while at < len(source):
        found = TOKEN.match(source, at)
        kind = found.lastgroup if found.lastgroup != "tag" else "string"
        if kind not in {"skip", "directive"}:
            tokens.append(Token(kind, found[0], at, found.end(), line))
        line += found[0].count("\n")
        at = found.end()
    pair_brackets(tokens)
    mark_code(tokens)
    return tokens


def pair_brackets(tokens):
    open_ones = []
    for index, token in enumerate(tokens):
        if token.kind != "punctuation":
            continue
        if token.text in CLOSING:
            open_ones.append(index)
        elif token.text in CLOSING.values() and open_ones:
            token.match = open_ones.pop()
            tokens[token.match].match = index


def opens_code(tokens, brace):
    """Whether a brace outside of functions opens the body of one: parentheses are before it, and no name of a scope."""
    words = []
    at = brace - 1
    while at >= 0 and tokens[at].text not in {";", "{", "}"}:
        words.append(tokens[at].text)
        at = tokens[at].match - 1 if tokens[at].text in {")", "]"} and tokens[at].match >= 0 else at - 1
    return ")" in words and "=" not in words and not SCOPES & set(words)


def mark_code(tokens):
    end = -1
    for index, token in enumerate(tokens):
        if index < end:
            token.code = True
        elif token.text == "{" and token.kind == "punctuation" and opens_code(tokens, index):
            end = token.match
