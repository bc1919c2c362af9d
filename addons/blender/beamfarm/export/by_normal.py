"""Fresnel and Layer Weight with their own normal as texture graphs: Cycles' formulas of the viewing angle."""

from .arithmetic import Node
from .values import constant


def _math(operation, a, b=None):
    return Node("math", {"operation": operation, "a": a} | ({} if b is None else {"b": b})).output()


def _cosine(normal):
    seen = Node("geometry", {}).output("incoming", 3, True)
    unit = Node("vector_math", {"operation": "normalize", "a": normal}).output(width=3, is_vector=True)
    return _math("absolute", Node("vector_math", {"operation": "dot_product", "a": unit, "b": seen}).output("value"))


def fresnel(normal, index):
    """The share that a boundary without absorption reflects; from behind with the inverse index."""
    cosine = _cosine(normal)
    behind = Node("geometry", {}).output("backfacing")
    inverse = _math("divide", constant(1.0), index)
    index = Node("mix", {"data": "float", "factor": behind, "a": index, "b": inverse}).output()
    root = _math("add", _math("subtract", _math("multiply", index, index), constant(1.0)),
                 _math("multiply", cosine, cosine))
    is_total = _math("less_than", root, constant(0.0))
    g = _math("power", _math("maximum", root, constant(0.0)), constant(0.5))
    sum_, less = _math("add", g, cosine), _math("subtract", g, cosine)
    first = _math("divide", less, sum_)
    second = _math("divide", _math("subtract", _math("multiply", cosine, sum_), constant(1.0)),
                   _math("add", _math("multiply", cosine, less), constant(1.0)))
    squares = [_math("multiply", each, each) for each in (first, second)]
    value = _math("multiply", _math("multiply", constant(0.5), squares[0]),
                  _math("add", constant(1.0), squares[1]))
    return _math("maximum", value, is_total)


def index_of_blend(blend):
    """Index of refraction for Layer Weight's Fresnel."""
    return _math("divide", constant(1.0), _math("maximum", _math("subtract", constant(1.0), blend), constant(1e-5)))


def facing(normal, blend):
    """Layer Weight's Facing; its blend is a constant."""
    share = min(max(blend.number(), 0.0), 1.0 - 1e-5)
    exponent = 2.0 * share if share < 0.5 else 0.5 / (1.0 - share)
    return _math("subtract", constant(1.0), _math("power", _cosine(normal), constant(exponent)))
