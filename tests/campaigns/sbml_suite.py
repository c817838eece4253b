"""The semantic cases of the SBML Test Suite, read, simulated and compared with its results.

``python -m tests.campaigns sbml_suite FOLDER [OUTPUT]`` takes the folder ``cases/semantic`` of
https://github.com/sbmlteam/sbml-test-suite. Of each case the latest level is read. OUTPUT is a
table in Markdown of the cases that are refused or differ.
"""

import csv
import signal
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import sympy as sp

import fastslow as fs
from fastslow.errors import FastSlowError

#: Seconds for a case.
SECONDS = 60


@dataclass
class Report:
    """Rows (case, verdict, remark)."""

    rows: list = field(default_factory=list)

    @property
    def failures(self):
        return [row for row in self.rows if row[1] in ("differs", "error")]

    def __str__(self):
        counts = Counter(row[1] for row in self.rows)
        lines = [f"{len(self.rows)} cases: " + ", ".join(f"{v} {k}" for k, v in counts.items())]
        return "\n".join([*lines, *(f"{row[0]}: {row[1]}, {row[2]}" for row in self.failures)])

    def table(self):
        rows = [f"| {n} | {v} | {r} |" for n, v, r in self.rows if v != "agrees"]
        return "\n".join(["| case | result | remark |", "|---|---|---|", *rows, ""])


def campaign(folder, output=None, first=0, last=10**6):
    """Return the report of a folder."""
    report = Report()
    for case in sorted(Path(str(folder)).iterdir()):
        if not case.name.isdigit() or not first <= int(case.name) <= last:
            continue
        settings = settings_of(case)
        if "RandomEventExecution" in (case / f"{case.name}-model.m").read_text():
            report.rows.append(
                (case.name, "not compared", "events of equal priority in random order")
            )
            continue
        if (
            settings.get("steps") is None
            or "time" not in (case / f"{case.name}-results.csv").open().readline().lower()
        ):
            continue
        report.rows.append((case.name, *verdict_of(case, settings)))
        if output:
            Path(output).write_text(report.table())
    return report


def settings_of(case):
    """The settings of a case by name."""
    lines = (case / f"{case.name}-settings.txt").read_text().splitlines()
    return dict(map(str.strip, line.split(":", 1)) for line in lines if ":" in line)


def verdict_of(case, settings):
    """Verdict and remark."""

    def late(number, frame):
        raise TimeoutError(f"longer than {SECONDS} s")

    signal.signal(signal.SIGALRM, late)
    signal.alarm(SECONDS)
    try:
        return compared(case, settings)
    except FastSlowError as error:
        return "refused", " ".join(str(error).split())[:160]
    except TimeoutError as error:
        return "slow", str(error)
    except Exception as error:  # the campaign goes on
        return "error", f"{type(error).__name__}: {' '.join(str(error).split())[:160]}"
    finally:
        signal.alarm(0)


def compared(case, settings):
    """Compare all columns of the results at the tolerances of the case."""
    path = max(case.glob("*-sbml-l*.xml"), key=lambda p: p.name.split("-")[2])
    with (case / f"{case.name}-results.csv").open() as lines:
        rows = [[cell.strip() for cell in row] for row in csv.reader(lines) if row]
    head, table = rows[0], np.array([[number(c) for c in row] for row in rows[1:]])
    file = fs.read_sbml(path)
    times = table[:, 0]
    until = times[-1] * (1 + 1e-9)
    run = fs.simulate(
        file.model, file.initial, t=(times[0], until), integration=fs.Integration(rtol=1e-11)
    )
    amounts = {name.strip() for name in settings.get("amount", "").split(",")}
    columns = run.dense_columns(times)
    known = dict(zip(run.columns, columns, strict=True))
    known |= {n: np.full(len(times), v) for n, v in file.model.parameters.items() if n not in known}
    known["t"] = times
    relative, absolute = float(settings["relative"]), float(settings["absolute"])
    worst = 0.0
    for k, name in enumerate(head[1:], start=1):
        kind = "amount" if name in amounts else "concentration"
        expression = file.auxiliary.get(f"{kind} of {name}", file.auxiliary.get(name))
        if expression is None:
            expression = sp.Symbol(file.renamed.get(name, name), real=True)
        symbols = sorted(expression.free_symbols, key=str)
        value = sp.lambdify(symbols, expression, ["numpy", {"Mod": np.mod}])
        own = np.broadcast_to(value(*(known[s.name] for s in symbols)), times.shape)
        error = np.abs(own - table[:, k]) / (absolute + relative * np.abs(table[:, k]))
        worst = max(worst, float(np.nanmax(error)))
    if not run.outcome and worst <= 1:
        return "ends early", str(run.outcome)
    return ("agrees" if worst <= 1.0 else "differs"), f"{worst:.2g} of the tolerance; {run.outcome}"


def number(cell):
    return {"INF": np.inf, "-INF": -np.inf}.get(cell.upper()) or float(cell)
