"""The right-hand side of an .ode file, read a second time: independent of `fastslow.readers`.

A formula is translated to Python by the algorithm of XPPAUT's own parser, a stack of operators with
its priorities, and the result is evaluated in floating-point numbers. Events are not known here.
"""

import math
import re

import numpy as np

PRIORITY = {"|": 4, "+": 4, "-": 4, "*": 6, "/": 6, "&": 6, "~": 6, "not": 6, "^": 7, "**": 7}
PRIORITY |= dict.fromkeys(["<", ">", "<=", ">=", "==", "!="], 7)
TOKEN = re.compile(
    r"\s*((?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?(?![\w.])|\d*[a-z_][\w.]*'?|\*\*|<=|>=|==|!=|\S)"
)
BINARY = {"&": "float({0}!=0 and {1}!=0)", "|": "float({0}!=0 or {1}!=0)", "^": "pw({0},{1})"}
BINARY |= {"**": "pw({0},{1})", "/": "dv({0},{1})"}
BINARY |= {c: f"float({{0}}{c}{{1}})" for c in ("<", ">", "<=", ">=", "==", "!=")}
BINARY |= {c: f"({{0}}{c}{{1}})" for c in "+-*"}
UNARY = {"~": "(-{0})", "not": "float({0}==0)"}


def pw(a, b):
    try:
        found = a**b
        return math.nan if isinstance(found, complex) else found
    except (OverflowError, ZeroDivisionError):
        return math.inf


def dv(a, b):
    return a / b if b else math.copysign(math.inf, a) if a else math.nan


def ex(x):
    return math.exp(x) if x < 700 else math.inf


def safe(function):
    def found(*a):
        try:
            return function(*a)
        except (ValueError, OverflowError):
            return math.nan

    return found


FUNCTIONS = {
    n: safe(getattr(math, n)) for n in ["sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh"]
}
FUNCTIONS |= {n: safe(getattr(math, n)) for n in ["tanh", "sqrt", "atan2", "erf", "erfc", "lgamma"]}
FUNCTIONS |= {
    "ln": safe(math.log),
    "log": safe(math.log),
    "log10": safe(math.log10),
    "exp": ex,
    "abs": abs,
    "max": max,
    "min": min,
    "heav": lambda x: float(x >= 0),
    "sign": lambda x: float(x > 0) - float(x < 0),
    "flr": math.floor,
    "ceil": math.ceil,
    "mod": lambda x, y: math.fmod(x, y) + (y if math.fmod(x, y) < 0 else 0),
}


class Reference:
    """States, initial values, span of time and rates of a file."""

    def __init__(self, text, folder=None):
        self.folder = folder
        self.states, self.fixed, self.functions, self.tables = {}, {}, {}, {}
        self.constants, self.initial, self.formulas, self.options = {}, {}, {}, {}
        for line in expanded(joined(text)):
            if self.statement(line):
                break
        self.names = list(self.states)
        self.t0 = float(self.options.get("t0", 0))
        self.total = float(self.options.get("total", 20))
        self.compile()

    def statement(self, line):
        low = line.strip().lower()
        if not low or low[0] in '#"%':
            return False
        if low[0] == "@":
            self.options |= dict(pairs(low[1:]))
            return False
        if rate := re.match(r"([^\s=/'(]+)\s*'[^=]*=(.*)|d([^\s=/'(]+)/dt\s*=(.*)", low):
            a, b, c, d = rate.groups()
            self.states[a or c] = b if a else d
        elif first := re.match(r"([^\s=/'(]+)\s*\(\s*0\s*\)\s*=(.*)", low):
            self.formulas[first[1]] = first[2]
        elif own := re.match(r"([^\s=/'(]+)\(([^)]*)\)\s*=(.*)", low):
            self.functions[own[1]] = [a.strip() for a in own[2].split(",")], own[3]
        elif quantity := re.match(r"!?([^\s=/'(]+)\s*=(.*)", low):
            self.fixed[quantity[1]] = quantity[2]
        else:
            word, _, rest = low.partition(" ")
            if word[0] in "pn":
                self.constants |= {n: number(v) for n, v in pairs(rest)}
            elif word[0] == "i":
                self.initial |= dict(pairs(rest))
            elif word[:2] == "ta":
                name, what = rest.split(None, 1)
                self.tables[name] = what
            return word[0] == "d"
        return False

    def python(self, formula, local=()):
        tokens, at = [], 0
        formula = formula.strip()
        while at < len(formula):
            found = TOKEN.match(formula, at)
            tokens.append(found[1])
            at = found.end()
        return self.value(tokens, local)

    def value(self, tokens, local):
        out, signs, operand, k = [], [], True, 0

        def reduce():
            sign = signs.pop()
            if sign in UNARY:
                out.append(UNARY[sign].format(out.pop()))
            else:
                right, left = out.pop(), out.pop()
                out.append(BINARY[sign].format(left, right))

        while k < len(tokens):
            token = tokens[k]
            if operand and token in ("-", "not"):
                signs.append("~" if token == "-" else token)
            elif not operand:
                while signs and PRIORITY[signs[-1]] >= PRIORITY[token]:
                    reduce()
                signs.append(token)
                operand = True
            else:
                made, k = self.operand(tokens, k, local)
                out.append(made)
                operand = False
                continue
            k += 1
        while signs:
            reduce()
        (whole,) = out
        return whole

    def operand(self, tokens, k, local):
        token = tokens[k]
        if token == "(":
            inside, k = bracket(tokens, k)
            return self.value(inside, local), k
        if (token[0].isdigit() and token not in self.known) or token[0] == ".":
            return f"{float(token)!r}", k + 1
        if k + 1 < len(tokens) and tokens[k + 1] == "(":
            inside, k = bracket(tokens, k + 1)
            arguments = [self.value(a, local) for a in split(inside)] if token != "shift" else []
            if token == "if":
                then, k = bracket(tokens, k + 1)
                other, k = bracket(tokens, k + 1)
                yes, no = self.value(then, local), self.value(other, local)
                return f"({yes} if {arguments[0]}!=0 else {no})", k
            if token == "sum":
                term, k = bracket(tokens, k + 1)
                low, high = arguments
                what = self.value(term, local)
                return f"sum({what} for i_ in range(int({low}),int({high})+1))", k
            if token == "shift":
                name, by = split(inside)
                return f"Y[{self.names_of.index(name[0])}+int({self.value(by, local)})]", k
            return f"{self.own(token)}({','.join(arguments)})", k
        if token == "i'":
            return "i_", k + 1
        if token in local:
            return f"a_{token.replace('.', '_')}", k + 1
        if token == "t":
            return "T", k + 1
        if token == "pi":
            return repr(math.pi), k + 1
        if token in self.states:
            return f"Y[{self.names_of.index(token)}]", k + 1
        if token in self.fixed:
            return f"F_{token.replace('.', '_')}(T,Y)", k + 1
        return f"C[{token!r}]", k + 1

    def own(self, name):
        return f"U_{name.replace('.', '_')}" if name in self.functions else f"X[{name!r}]"

    def compile(self):
        self.names_of = list(self.states)
        self.known = {*self.states, *self.fixed, *self.constants, *self.functions}
        space = {"C": self.constants, "X": dict(FUNCTIONS), "pw": pw, "dv": dv}
        code = []
        for name, (arguments, body) in self.functions.items():
            inner = ",".join(f"a_{a.replace('.', '_')}" for a in arguments)
            made = self.python(body, arguments)
            # the state and the time are those of the call
            code.append(f"def {self.own(name)}({inner}):\n T,Y=G\n return {made}")
        for name, body in self.fixed.items():
            made = self.python(body)
            code.append(
                f"def F_{name.replace('.', '_')}(T,Y):\n"
                f" if {name!r} not in M: M[{name!r}]={made}\n return M[{name!r}]"
            )
        rates = ",".join(self.python(body) for body in self.states.values())
        code.append(f"def rates(T,Y):\n M.clear()\n G[:]=[T,Y]\n return [{rates}]")
        space |= {"M": {}, "G": [0.0, []]}
        exec("\n".join(code), space)
        self.rates = space["rates"]
        for name, what in self.tables.items():
            space["X"][name] = self.table(what, space)
        start = [0.0] * len(self.names)
        for name, written in self.initial.items():
            start[self.names.index(name)] = number(written)
        for name, written in self.formulas.items():
            space["G"][:] = [self.t0, start]
            space["M"].clear()
            value = eval(self.python(written), {**space, "T": self.t0, "Y": start})
            start[self.names.index(name)] = value
        self.start = np.array(start, dtype=float)

    def table(self, what, space):
        if what.startswith("%"):
            count, low, high, formula = what[1:].split(None, 3)
            xs = np.linspace(float(low), float(high), int(count))
            made = self.python(formula)
            ys = [eval(made, {**space, "T": float(x), "Y": []}) for x in xs]
        else:
            words = (self.folder / what.strip()).read_text().split()
            xs = np.linspace(float(words[1]), float(words[2]), int(words[0]))
            ys = [float(w) for w in words[3 : 3 + len(xs)]]
        return lambda x: float(np.interp(x, xs, ys))


def joined(text):
    found, open_line = [], ""
    for line in text.splitlines():
        start, slash, _ = line.partition("\\")
        open_line += start.replace("\t", " ")
        if not slash:
            found.append(open_line)
            open_line = ""
    return [*found, open_line]


def expanded(lines):
    waiting = iter(lines)
    for line in waiting:
        array = re.search(r"\[\s*(\d+)\s*\.\.+\s*(\d+)\s*\]", line)
        if line.lstrip().startswith("#") or not array:
            yield index(line, 0)
            continue
        first, last = int(array[1]), int(array[2])
        block = [line.replace(array[0], "[j]")]
        if line.lstrip().startswith("%"):
            block = []
            for inner in waiting:
                if inner.lstrip().startswith("%"):
                    break
                block.append(inner)
        for j in range(first, last + 1) if last >= first else range(first, last - 1, -1):
            for inner in block:
                yield index(re.sub(re.escape(array[0]), "[j]", inner), j)


def index(line, j):
    line = re.sub(r"\[\s*j\s*\]", str(j), line, flags=re.I)
    line = re.sub(r"\[\s*j\s*\+\s*(\d+)\s*\]", lambda m: str(j + int(m[1])), line, flags=re.I)
    line = re.sub(r"\[\s*j\s*-\s*(\d+)\s*\]", lambda m: str(j - int(m[1])), line, flags=re.I)
    line = re.sub(r"\[\s*j\s*\*\s*(\d+)\s*\]", lambda m: str(j * int(m[1])), line, flags=re.I)
    return re.sub(r"\[\s*(-?\d+)\s*\]", r"\1", line)


def bracket(tokens, k):
    depth = 0
    for end in range(k, len(tokens)):
        depth += (tokens[end] == "(") - (tokens[end] == ")")
        if depth == 0:
            return tokens[k + 1 : end], end + 1
    raise ValueError("a bracket is not closed")


def split(tokens):
    found, depth = [[]], 0
    for token in tokens:
        depth += (token == "(") - (token == ")")
        if token == "," and depth == 0:
            found.append([])
        else:
            found[-1].append(token)
    return found


def pairs(text):
    found = re.findall(r"([^\s=,]+)(?:\s*=\s*([^\s,]*))?", text.partition("#")[0])
    return [(name, value) for name, value in found]


def number(text):
    found = re.match(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", text)
    return float(found[0]) if found else 0.0
