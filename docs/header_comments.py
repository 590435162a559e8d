"""Doxygen's input filter: prints a header with its plain comments in the form that Doxygen reads.

A comment behind a member is about the member, one above it too, and the first one about the file. The library's
namespace is left out: every page would say it again.
"""
import re
import sys

BEHIND = re.compile(r"^(\s*[^\s/}#].*?[;,{)])(\s+)// (.*)$")
ALONE = re.compile(r"^(\s*)// (.*)$")

NAMESPACE = ("namespace raydix {", "}  // namespace raydix")


def converted(lines):
    at_top, behind = True, False
    yield "/// @file"
    for line in lines:
        if line in NAMESPACE:
            continue
        alone = ALONE.match(line)
        if at_top and alone:
            yield "/// " + alone[2]
            continue
        at_top = False
        with_code = None if alone else BEHIND.match(line)
        if with_code:
            behind = True
            yield f"{with_code[1]}{with_code[2]}///< {with_code[3]}"
        elif alone:
            yield f"{alone[1]}///{'<' if behind else ''} {alone[2]}"
        else:
            behind = False
            yield line


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as header:
        print("\n".join(converted(header.read().splitlines())))
