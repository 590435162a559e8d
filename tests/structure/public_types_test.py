"""The user's floor stays small: raydix/raydix.h reaches no header of trees, and at most 80 types of its own."""
import pathlib
import re
import unittest

INCLUDE = pathlib.Path(__file__).resolve().parents[2] / "include"
MOST_TYPES = 80
TOKEN = re.compile(r"namespace\s+[\w:]+\s*\{|\{|\}|\b(?:struct|class|enum class|enum|union)\s+(\w+)\s*(?:final\s*)?(?::[^{;]*)?(?=\{)")


def types_in(text):
    """Names of the types that stand in a namespace, not in another type. Other names of a type (`using`) are not counted."""
    scopes, names = [], []
    for token in TOKEN.finditer(re.sub(r"//.*", "", text)):
        word = token.group(0)
        if word.startswith("namespace"):
            scopes.append("namespace" if "detail" not in word else "detail")
        elif word == "{":
            scopes.append("other")
        elif word == "}":
            scopes.pop()
        elif all(scope == "namespace" for scope in scopes):
            names.append(token.group(1))
    return names


def reached_from(header, seen):
    if header not in seen:
        seen.add(header)
        for name in re.findall(r"#include\s+<(raydix/\w+\.h)>", (INCLUDE / header).read_text(encoding="utf-8")):
            reached_from(name, seen)
    return seen


class PublicTypes(unittest.TestCase):
    def test_counts(self):
        text = """namespace a { struct One { struct Inner { int x; }; }; enum class Two : int { x }; template <class T> class Three
        { void f() {} }; using Four = One; struct Five; namespace detail { struct Six {}; } class Seven : One { }; }"""
        self.assertEqual(types_in(text), ["One", "Two", "Three", "Seven"])

    def test_the_users_floor_is_small(self):
        floor = reached_from("raydix/raydix.h", set())
        names = {header: types_in((INCLUDE / header).read_text(encoding="utf-8")) for header in sorted(floor)}
        total = sum(map(len, names.values()))
        print(f"raydix.h: {total} types in {len(floor)} headers")
        self.assertGreater(total, 40)  # the count finds them at all
        self.assertLessEqual(total, MOST_TYPES, names)
        self.assertFalse(floor & {f"raydix/{name}.h" for name in ("bvh", "double", "closest", "overlap", "pairs", "rdx", "refit", "trace")})

    def test_two_floors_reach_every_header(self):
        reached = reached_from("raydix/raydix.h", set()) | reached_from("raydix/expert.h", set()) | {"raydix/mpi.h"}
        self.assertEqual({f"raydix/{file.name}" for file in (INCLUDE / "raydix").glob("*.h")}, reached)


if __name__ == "__main__":
    unittest.main()
