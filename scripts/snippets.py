"""The code in the guides, as programs. A page's blocks of one language go on from each other.

    snippets.py cpp OUT.cpp PAGE...   writes a program that runs the C++ of all pages
    snippets.py python PAGE...        runs the Python of each page in a folder of its own
    snippets.py sh PAGE...            runs the shell commands of each page in a folder of its own

A page without code in the language is passed over; a run without any code fails.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

LANGUAGES = ("cpp", "python", "sh")
STANDS_ALONE = re.compile(r"^int main\(", re.MULTILINE)


def blocks(page, language):
    """[(line of the page, code)] of its fenced blocks."""
    found, lines = [], page.read_text(encoding="utf-8").splitlines()
    start = None
    for number, line in enumerate(lines, 1):
        if start is None and line == f"```{language}":
            start = number
        elif start is not None and line == "```":
            found.append((start + 1, "\n".join(lines[start:number - 1]) + "\n"))
            start = None
    if start is not None:
        raise SystemExit(f"{page}:{start}: this block does not end")
    return found


def cpp_program(pages):
    """Includes come first, and each page is a function that main() calls."""
    includes, functions, names = set(), [], []
    for page in pages:
        body = []
        for line, code in blocks(page, "cpp"):
            if STANDS_ALONE.search(code):
                continue
            body.append(f'#line {line} "{page.name}"')
            for text in code.splitlines():
                included = text.startswith("#include")
                if included:
                    includes.add(text)
                body.append("" if included else text)
        if body:
            name = re.sub(r"\W", "_", page.stem) + "_page"
            names.append(name)
            functions.append("\n".join([f"void {name}() {{", *body, "}"]))
    if not names:
        raise SystemExit("snippets.py: no C++ on these pages")
    calls = "\n".join(f"    {name}();" for name in names)
    return "\n".join([*sorted(includes), "", "namespace {", *functions, "}  // namespace", "", "int main() {", calls, "}", ""])


def run_each(pages, language, run):
    ran = 0
    for page in pages:
        code = blocks(page, language)
        if not code:
            continue
        ran += len(code)
        with tempfile.TemporaryDirectory(prefix="raydix-guide-") as folder:
            run(page, code, folder)
    if not ran:
        raise SystemExit(f"snippets.py: no {language} on these pages")
    print(f"{ran} blocks of {language} on {len(pages)} pages: all ran")


def run_python(page, code, folder):
    # Lines keep their numbers in the page, so that an error names them.
    text = ""
    for line, part in code:
        text += "\n" * (line - 1 - text.count("\n")) + part
    os.chdir(folder)
    exec(compile(text, str(page), "exec"), {"__name__": page.stem})


def run_shell(page, code, folder):
    script = "".join(part for _, part in code)
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", script], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{page}: exit code {done.returncode}\n{done.stdout}{done.stderr}")


def main(arguments):
    if len(arguments) < 2 or arguments[0] not in LANGUAGES:
        raise SystemExit(__doc__)
    language = arguments[0]
    pages = [pathlib.Path(name).resolve() for name in arguments[2 if language == "cpp" else 1:]]
    if language == "cpp":
        program = cpp_program(pages)
        out = pathlib.Path(arguments[1])
        if not out.exists() or out.read_text(encoding="utf-8") != program:
            out.write_text(program, encoding="utf-8")
    else:
        run_each(pages, language, run_python if language == "python" else run_shell)


if __name__ == "__main__":
    main(sys.argv[1:])
