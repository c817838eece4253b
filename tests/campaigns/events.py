"""Random oscillators with three events each, against restarts of SciPy's integrator."""

from dataclasses import dataclass, field

from tests.simulation.random_events import SHAPES, compared, model_of


@dataclass
class Report:
    """What a campaign has found."""

    seed: int
    runs: int = 0
    failures: list[str] = field(default_factory=list)

    def __str__(self):
        text = f"seed {self.seed}: {self.runs} runs with events, failures: {len(self.failures)}"
        return "\n".join([text, *(f"    {failure}" for failure in self.failures[:20])])


def campaign(count=510, seed=0):
    """Compare ``count`` runs, of all shapes in turn."""
    report, models = Report(seed), [model_of(shape) for shape in range(len(SHAPES))]
    for k in range(count):
        shape = k % len(models)
        differs = compared(shape, 10_000 * seed + k // len(models), models[shape])
        report.runs += 1
        if differs:
            report.failures.append(f"shape {shape}, {k // len(models)}: {differs}")
    return report
