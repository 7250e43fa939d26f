"""Functions of the library are short and take few arguments."""

import ast
import dataclasses
import importlib
import inspect
import io
import tokenize
from pathlib import Path

import pytest

import ankleloop

SOURCE = Path(ankleloop.__file__).parent
FILES = sorted(path.relative_to(SOURCE).as_posix() for path in SOURCE.rglob("*.py"))
LONGEST = 60  # lines of a body, without docstring, comments and blank lines
MOST_ARGUMENTS = 10
# The public functions whose options are arguments.
PUBLIC_FACE = {
    ("simulation/simulate.py", "simulate"),
    ("subspace/moesp.py", "moesp"),
    ("records/readers.py", "read_trial"),
    ("records/long_record.py", "LongRecord"),
}
NOT_CODE = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def functions_of(source):
    """Every function of a source text with its qualified name, methods and nested functions among them."""

    def walk(node, prefix):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                yield f"{prefix}{child.name}", child
            named = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef))
            yield from walk(child, f"{prefix}{child.name}." if named else prefix)

    yield from walk(ast.parse(source), "")


def code_lines(source):
    """Numbers of the lines that have more than a comment."""
    lines = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in NOT_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return lines


def body_length(function, lines):
    """Lines of code in the body of a function, without its docstring."""
    body = function.body[1:] if ast.get_docstring(function) is not None else function.body
    if not body:
        return 0
    first = min([body[0].lineno, *(decorator.lineno for decorator in getattr(body[0], "decorator_list", []))])
    return sum(first <= line <= function.end_lineno for line in lines)


def count_arguments(function):
    """Arguments of a function without self and cls."""
    names = [a.arg for a in [*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs]]
    names += [a.arg for a in (function.args.vararg, function.args.kwarg) if a is not None]
    return len([name for name in names if name not in ("self", "cls")])


@pytest.mark.parametrize("file", FILES)
def test_function_bodies_are_short(file):
    source = (SOURCE / file).read_text(encoding="utf-8")
    lines = code_lines(source)
    lengths = {name: body_length(function, lines) for name, function in functions_of(source)}
    assert {name: length for name, length in lengths.items() if length > LONGEST} == {}


@pytest.mark.parametrize("file", FILES)
def test_functions_take_few_arguments(file):
    source = (SOURCE / file).read_text(encoding="utf-8")
    counts = {name: count_arguments(function) for name, function in functions_of(source)}
    module = importlib.import_module(
        ".".join(["ankleloop", *Path(file).with_suffix("").parts]).removesuffix(".__init__")
    )
    for name, member in vars(module).items():
        if dataclasses.is_dataclass(member) and inspect.isclass(member) and member.__module__ == module.__name__:
            counts[name] = sum(field.init for field in dataclasses.fields(member))
    too_many = {name: count for name, count in counts.items() if count > MOST_ARGUMENTS}
    assert {name: count for name, count in too_many.items() if (file, name) not in PUBLIC_FACE} == {}


def test_lines_and_arguments_are_counted():
    source = '''
class A:
    def f(self, a, /, b, *c, d=1, **e):
        """Two lines
        of docstring."""

        # A comment.
        x = """Text of

        three lines."""

        def g():
            """Docstring."""

        return x  # a comment behind code
'''
    lines, functions = code_lines(source), dict(functions_of(source))
    assert {name: body_length(function, lines) for name, function in functions.items()} == {"A.f": 6, "A.f.g": 0}
    assert {name: count_arguments(function) for name, function in functions.items()} == {"A.f": 5, "A.f.g": 0}
