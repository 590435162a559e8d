#!/usr/bin/env python3
"""scripts/check_includes.py [ROOT]: who may include what, as data; prints FILE:LINE of each breach and exits 1.

Checked: the table of folders below, system headers that belong to one file, cycles, and the length of files.
"""
import pathlib
import re
import sys

# Folder of src/ -> folders whose headers it may include, besides its own. docs/architecture.md explains the order.
MAY_INCLUDE = {
    "base": set(),
    "exec": {"base"},
    "scene": {"base", "exec"},
    "primitives": {"base", "exec"},
    "keys": {"base", "exec", "primitives"},  # the code of a primitive is made from its box in one go
    "sort": {"base", "exec"},
    "tree": {"base", "exec", "keys"},
    # copies primitives into leaf order, so it must know how a primitive is read
    "layout": {"base", "exec", "sort", "tree", "primitives"},
    "rays": {"base", "exec", "keys", "sort"},
    # an index of its own: sorts points and groups them, then asks the groups
    "points": {"base", "exec", "keys", "sort", "measure"},
    "simt": {"base"},
    "trace": {"base", "exec", "primitives", "layout", "rays", "simt"},
    # walks through the same trees as rays do, with the same stacks
    "proximity": {"base", "exec", "primitives", "sort", "tree", "rays", "trace"},
    # what rays of a user go through: trees of triangles and shapes, and instances over them
    "engine": {"base", "exec", "primitives", "tree", "layout", "rays", "trace", "proximity"},
    "measure": {"base", "exec"},  # exec: the number of threads is a property of the machine
    "report": {"base", "exec", "measure"},
    # stages put together: the public calls that build, refit and lay out trees
    "build": {"base", "exec", "measure", "primitives", "keys", "sort", "tree", "layout"},
    # the same stages as launches, and what is asked of trees on a device
    "gpu": {"base", "exec", "primitives", "keys", "sort", "tree", "layout", "trace", "proximity", "engine", "build"},
    "io": {"base", "exec", "scene", "primitives", "measure", "tree", "simt", "engine"},
    "image": {"base", "exec", "rays", "trace", "report", "engine"},
    # a library of its own on top: the same queries over ranks
    "mpi": {"base", "exec", "primitives", "keys", "points", "rays", "tree", "trace", "engine", "proximity", "image", "scene", "io"},
}
# The lowest folders know only the plain structs, errors and arrays of the public headers.
PUBLIC_HEADERS = {"base": {"types.h", "error.h"},
                  "exec": {"types.h", "error.h", "buffer.h", "result_limit.h", "thread_pool.h"}}
# Programs on top of the public API: none of src/, and their own folder.
PROGRAMS = ("c", "cli", "examples", "python")
# The one public header that needs a library of others.
MPI_HEADER = "include/raydix/mpi.h"
# Headers of one library -> the only files that may include them.
PRIVATE_LIBRARIES = {
    r"(tbb|oneapi)/.*": r"src/exec/parallel\.cpp|tests/(more_threads|exec/caller_onetbb_test)\.cpp",
    r"(cuda|cub|thrust|nv|nvtx3)/.*|cuda.*\.h": r"(src|tests|bench)/.*\.cuh?|src/base/device_words\.h",
    r"(embree\d?|nanoflann).*": r"(tests|bench)/.*",
    r"CGAL/.*": r"bench/.*",
    r"gtest/.*|gmock/.*": r"tests/.*",
    r"nanobind/.*": r"python/.*",
    r"CLI/.*": r"(cli|bench)/.*",
    r"mpi\.h": r"include/raydix/mpi\.h|(src|tests)/mpi/.*|cli/mpi_.*|examples/mpi_.*|python/src/mpi_.*",
}
MAX_LINES = 700
SUFFIXES = {".h", ".cpp", ".cu", ".cuh"}
INCLUDE = re.compile(r'\s*#\s*include\s*([<"])([^>"]+)[>"]')


def includes_of(file):
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        match = INCLUDE.match(line)
        if match:
            yield number, match.group(1), match.group(2)


def library_fault(where, name):
    c_header = (where == "include/raydix_c.h" and name in ("math.h", "stddef.h", "stdint.h") or
                where == "include/raydix_c_double.h" and name == "raydix_c.h")
    own = re.fullmatch(r"raydix/.*|[a-z_]+", name) or c_header or where == MPI_HEADER
    if where.startswith("include/") and not own:
        return f"a public header includes the standard library and <raydix/...> only, not <{name}>"
    for library, home in PRIVATE_LIBRARIES.items():
        if re.fullmatch(library, name) and not re.fullmatch(home, where):
            return f"{where} may not include <{name}>; only {home} may"
    return None


def quoted_fault(root, file, where, name):
    """A header in quotes is one of this project: beside the file, in src/, or in tests/."""
    top = where.split("/")[0]
    if top == "src":
        if not (root / "src" / name).is_file():
            return f'"{name}" is not a path below src/'
        own, other = where.split("/")[1], name.split("/")[0]
        allowed = MAY_INCLUDE.get(own)
        if allowed is None:
            return f"folder src/{own} is not in the table of scripts/check_includes.py"
        if other != own and other not in allowed and "*" not in allowed:
            return f'src/{own} may not include "{name}"; it may include {", ".join(sorted(allowed)) or "nothing"}'
    elif top == "include":
        return f'a public header includes others as <raydix/...>, not "{name}"'
    elif top in PROGRAMS and ("/" in name or not (file.parent / name).is_file()):
        return f'{top} may include public headers and its own only, not "{name}"'
    return None


def public_fault(root, where, name):
    header = name.removeprefix("raydix/")
    if not (root / "include" / "raydix" / header).is_file():
        return f"<{name}> does not exist"
    parts = where.split("/")
    if parts[0] == "src" and header not in PUBLIC_HEADERS.get(parts[1], {header}):
        return f"src/{parts[1]} may not include <{name}>; it may include {', '.join(sorted(PUBLIC_HEADERS[parts[1]]))}"
    return None


def target_of(root, file, kind, name):
    """The file of this project that an include names, or None."""
    places = [root / "include" / name] if kind == "<" else [file.parent / name, root / "src" / name, root / "tests" / name]
    return next((place.resolve() for place in places if place.is_file()), None)


def cycles_of(graph):
    """One message per cycle of `graph`: file -> {(line, file)}."""
    faults, done, path = [], set(), []

    def visit(file):
        path.append(file)
        for line, other in sorted(graph.get(file, ())):
            if other in path:
                around = path[path.index(other):] + [other]
                faults.append(f"{file}:{line}: the includes go in a circle: {' -> '.join(around)}")
            elif other not in done:
                visit(other)
        path.pop()
        done.add(file)

    for file in sorted(graph):
        if file not in done:
            visit(file)
    return faults


def table_faults():
    graph = {folder: {(0, other) for other in allowed if other != "*"} for folder, allowed in MAY_INCLUDE.items()}
    return cycles_of(graph)


def check(root):
    """All faults of the tree at `root`, and how many files and includes were looked at."""
    root = root.resolve()
    faults, graph, files, includes = table_faults(), {}, 0, 0
    for top in ("include", "src", "c", "cli", "examples", "python", "tests", "bench", "fuzz"):
        for file in sorted((root / top).rglob("*")):
            if file.suffix not in SUFFIXES:
                continue
            files += 1
            where = file.relative_to(root).as_posix()
            length = len(file.read_text(encoding="utf-8").splitlines())
            if length > MAX_LINES:
                faults.append(f"{where}:{length}: {length} lines; split the file (at most {MAX_LINES})")
            for line, kind, name in includes_of(file):
                includes += 1
                fault = library_fault(where, name)
                if fault is None and kind == '"':
                    fault = quoted_fault(root, file, where, name)
                elif fault is None and name.startswith("raydix/"):
                    fault = public_fault(root, where, name)
                if fault:
                    faults.append(f"{where}:{line}: {fault}")
                target = target_of(root, file, kind, name)
                if target is not None:
                    graph.setdefault(where, set()).add((line, target.relative_to(root).as_posix()))
    return faults + cycles_of(graph), files, includes


def main(arguments):
    root = pathlib.Path(arguments[0]) if arguments else pathlib.Path(__file__).resolve().parent.parent
    faults, files, includes = check(root)
    for fault in faults:
        print(fault)
    print(f"{files} files, {includes} includes, {len(faults)} faults")
    return 1 if faults or not files else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
