"""How fast is a particle filter's step, beside two other people's, and where does the time go?

    python benchmarks/particles.py [--rounds 15] [--json FILE] [--figure step.png]

Peers run in the same process, one round of each after the other, so that whatever else the machine does hits
all alike; the median of the rounds is printed.  A peer that cannot be imported is left out and named.  The
``particles`` package (0.4) asks for NumPy < 2 and runs with 2.4; an environment for all peers, in two steps:

    python -m venv peers && peers/bin/pip install -e ".[benchmarks]" joblib numba scikit-learn
    peers/bin/pip install --no-deps particles

A full step is measured twice.  *As each is written by its user*: the course's drive, whose two wheels err, and
its range sensors; the package's state-space model, which wants a density for each coordinate, and so gets normals
of the same spread.  *The same lines in both*: motion and distances are one function, shared, so that only what
the filters themselves do is left to differ.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

# This file is called particles.py and its folder is on the path: without this line it would import itself.
sys.path[0] = str(Path(__file__).resolve().parents[1])

import numpy as np  # noqa: E402

from benchmarks import results  # noqa: E402
from coursekit import particles as ours  # noqa: E402
from coursekit.models import DifferentialDrive, RangeOnly  # noqa: E402
from coursekit.models._vectors import sine_cosine  # noqa: E402
from coursekit.particles._blocks import BLOCK  # noqa: E402

LANDMARKS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [0.0, 6.0]])
CONTROL, DT, SIGMA_U, SIGMA_RANGE = np.array([0.5, 0.2]), 0.1, np.array([0.1, 0.1]), 0.1
START, SPREAD, SPREAD_STEP = np.array([3.0, 2.0, 0.0]), np.array([0.5, 0.5, 0.3]), np.array([0.01, 0.01, 0.01])


def arc(states: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """A unicycle's step with an error on each wheel command; turns of 0.02 rad, so the series of sinc will do."""
    v, omega = CONTROL[0] + SIGMA_U[0] * noise[:, 0], CONTROL[1] + SIGMA_U[1] * noise[:, 1]
    half = 0.5 * omega * DT
    chord, direction = v * DT * (1 - half * half / 6), states[:, 2] + half
    moved = np.empty_like(states)
    moved[:, 0] = states[:, 0] + chord * np.cos(direction)
    moved[:, 1] = states[:, 1] + chord * np.sin(direction)
    moved[:, 2] = states[:, 2] + omega * DT
    return moved


def distance(states: np.ndarray, landmark: np.ndarray) -> np.ndarray:
    dx, dy = states[:, 0] - landmark[0], states[:, 1] - landmark[1]
    return np.sqrt(dx * dx + dy * dy)


def truth(steps: int) -> np.ndarray:
    """Ranges (steps, 4) along the noise-free path."""
    path = [START[None]]
    for _ in range(steps):
        path.append(arc(path[-1], np.zeros((1, 2))))
    return np.array([[distance(pose, landmark)[0] for landmark in LANDMARKS] for pose in path[1:]])


class SharedMotion:
    def sample(self, states, u, dt, rng):
        return arc(states, rng.standard_normal((len(states), 2)))


class SharedRange:
    R = np.array([[SIGMA_RANGE**2]])

    def __init__(self, landmark):
        self.landmark = landmark

    def h(self, states):
        return distance(states, self.landmark)[:, None]

    def residual(self, z, z_hat):
        return z - z_hat


class Ours:
    """Predict, weigh by four ranges, look at the effective sample size, resample: every step, all of it."""

    def __init__(self, n: int, motion, sensors, ranges: np.ndarray):
        self.rng = np.random.default_rng(1)
        self.cloud = ours.Particles(START + SPREAD * self.rng.standard_normal((n, 3)), angles=(2,))
        self.motion, self.sensors, self.ranges = motion, sensors, iter(ranges)

    def step(self) -> None:
        moved = ours.predict(self.cloud, self.motion, CONTROL, DT, self.rng)
        likelihoods = (
            ours.log_likelihood(sensor, [z])(moved.states) for sensor, z in zip(self.sensors, next(self.ranges))
        )
        weighed = ours.weigh(moved, sum(likelihoods))
        ours.effective_sample_size(weighed.weights)
        self.cloud = ours.resample(weighed, self.rng)


def peers(n: int, ranges: np.ndarray) -> dict[str, Callable[[], None]]:
    """The same filter in the ``particles`` package (Chopin & Papaspiliopoulos, 2020), written both ways."""
    try:
        import particles
        from particles import distributions as dists
        from particles import state_space_models
    except ImportError:
        return {}

    class Robot(state_space_models.StateSpaceModel):
        def PX0(self):
            return dists.IndepProd(*(dists.Normal(loc=m, scale=s) for m, s in zip(START, SPREAD)))

        def PX(self, t, xp):
            mean = arc(xp, np.zeros((1, 2)))
            return dists.IndepProd(*(dists.Normal(loc=mean[:, i], scale=s) for i, s in enumerate(SPREAD_STEP)))

        def PY(self, t, xp, x):
            return dists.IndepProd(*(dists.Normal(loc=distance(x, m), scale=SIGMA_RANGE) for m in LANDMARKS))

    class Moved(dists.ProbDist):
        """The package's way to bring a motion that is no textbook density: say how to draw from it."""

        dim = 3

        def __init__(self, states):
            self.states = states

        def rvs(self, size=None):
            return arc(self.states, np.random.normal(size=(len(self.states), 2)))  # noqa: NPY002 (the package's own)

    class SameLines(Robot):
        def PX(self, t, xp):
            return Moved(xp)

    def run(model):
        bootstrap = state_space_models.Bootstrap(ssm=model, data=list(ranges[:, None]))
        smc = particles.SMC(fk=bootstrap, N=n, resampling="systematic", ESSrmin=1.0)  # 1.0: resample every step
        return lambda: next(smc)

    return {"as its user writes it": run(Robot()), "the same lines in both": run(SameLines())}


def interleaved(contestants: dict[Any, Callable[[], object]], rounds: int) -> dict[Any, float]:
    """Median seconds a call."""
    return {name: float(np.median(seconds)) for name, seconds in results.in_turns(contestants, rounds).items()}


def full_step(rounds: int, rows: results.Rows) -> None:
    print(f"A full step with four ranges, resampling every time (median of {rounds}, ms)")
    for n in (10_000, 100_000, 1_000_000):
        ranges = truth(rounds + 2)
        drive = DifferentialDrive(*SIGMA_U, sigma_pose=(0.0, 0.0, 0.0))
        mine = {
            "as its user writes it": Ours(n, drive, [RangeOnly(m, position=(0, 1)) for m in LANDMARKS], ranges).step,
            "the same lines in both": Ours(n, SharedMotion(), [SharedRange(m) for m in LANDMARKS], ranges).step,
        }
        theirs = peers(n, ranges)
        contestants = {("coursekit", k): call for k, call in mine.items()}
        contestants |= {("particles", k): call for k, call in theirs.items()}
        each = results.in_turns(contestants, rounds)
        seconds = {name: float(np.median(one)) for name, one in each.items()}
        for kind in mine:
            peer, by = each.get(("particles", kind)), ("particles", results.version("particles")) if theirs else None
            rows.add(f"one step of {n:,} particles, four ranges, {kind}", "ms", 1e3 * each["coursekit", kind],
                     None if peer is None else 1e3 * peer, by)  # fmt: skip
            line = f"  n = {n:7,d}  {kind:24s} coursekit {1e3 * seconds['coursekit', kind]:7.2f}"
            if theirs:
                ratio = seconds["particles", kind] / seconds["coursekit", kind]
                line += f"   particles {1e3 * seconds['particles', kind]:7.2f}   {ratio:4.2f} x as fast"
            print(line)
    if not theirs:
        print("  (the particles package is not importable here; see the top of this file)")


def resampling(rounds: int, rows: results.Rows) -> None:
    n = 1_000_000
    weights = np.random.default_rng(0).random(n) ** 4
    weights /= weights.sum()
    rng = np.random.default_rng(1)
    contestants: dict[str, Callable[[], object]] = {
        name: lambda method=method: method(weights, rng) for name, method in ours.RESAMPLERS.items()
    }
    contestants["a search for each position"] = lambda: np.searchsorted(
        np.cumsum(weights), (np.arange(n) + rng.random()) / n
    )
    try:
        from filterpy.monte_carlo import systematic_resample

        contestants["filterpy systematic"] = lambda: systematic_resample(weights)
    except ImportError:
        print("(filterpy is not importable here)")
    each = results.in_turns(contestants, rounds)
    seconds = {name: float(np.median(one)) for name, one in each.items()}
    peer, by = each.get("filterpy systematic"), ("filterpy", results.version("filterpy"))
    rows.add("systematic resampling of 1,000,000 particles", "ms", 1e3 * each["systematic"],
             None if peer is None else 1e3 * peer, None if peer is None else by)  # fmt: skip
    print(f"\nResampling a million particles (median of {rounds}, ms)")
    for name, value in seconds.items():
        print(f"  {name:26s} {1e3 * value:9.2f}")
    if "filterpy systematic" in seconds:
        print(f"  systematic is {seconds['filterpy systematic'] / seconds['systematic']:.0f} x as fast as filterpy's")


def stages(n: int, rounds: int) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds of each stage, and the bytes it cannot avoid: its input read once, its output written once."""
    ranges = truth(rounds + 3)
    motion = DifferentialDrive(*SIGMA_U, sigma_pose=(0.0, 0.0, 0.0))
    sensors = [RangeOnly(m, position=(0, 1)) for m in LANDMARKS]
    rng = np.random.default_rng(1)
    cloud = ours.predict(
        ours.Particles(START + 0.1 * SPREAD * rng.standard_normal((n, 3)), angles=(2,)), motion, CONTROL, DT, rng
    )
    gains = [ours.log_likelihood(s, [z]) for s, z in zip(sensors, ranges[0])]
    gained = sum(gain(cloud.states) for gain in gains)
    weighed = ours.weigh(cloud, gained)
    indices = ours.systematic(weighed.weights, rng)
    parts, column = np.array_split(cloud.states[:, 2].copy(), -(-n // BLOCK)), 8 * n
    calls: dict[str, tuple[Callable[[], object], float]] = {
        "predict": (lambda: ours.predict(cloud, motion, CONTROL, DT, rng), 6 * column),
        "  of it: normals": (lambda: [rng.standard_normal((2, *part.shape)) for part in parts], 0),
        "  of it: sine and cosine": (lambda: [sine_cosine(part) for part in parts], 0),
        "four ranges": (lambda: sum(gain(cloud.states) for gain in gains), 4 * 4 * column),
        "weigh": (lambda: ours.weigh(cloud, gained), 4 * column),
        "effective sample size": (lambda: ours.effective_sample_size(weighed.weights), column),
        "systematic indices": (lambda: ours.systematic(weighed.weights, rng), 2 * column),
        "copy the chosen": (lambda: cloud.states.take(indices, axis=0), 7 * column),
        "plain copy, for scale": (lambda: cloud.states.copy(), 6 * column),
    }  # fmt: skip
    seconds = interleaved({name: call for name, (call, _) in calls.items()}, rounds)
    return seconds, {name: moved for name, (_, moved) in calls.items()}


def where_the_time_goes(rounds: int, figure: Path | None) -> None:
    sizes = (10_000, 100_000, 1_000_000)
    table = {n: stages(n, rounds) for n in sizes}
    print("\nWhere the time goes: ns a particle (and GB/s of the bytes that had to move)")
    print(f"  {'':26s}" + "".join(f"{n:>18,d}" for n in sizes))
    for name in table[sizes[0]][0]:
        cells = []
        for n in sizes:
            seconds, moved = table[n][0][name], table[n][1][name]
            rate = f"({moved / seconds / 1e9:5.1f})" if moved else ""
            cells.append(f"{1e9 * seconds / n:10.2f} {rate:>7s}")
        print(f"  {name:26s}" + "".join(cells))
    if figure is not None:
        draw(table, figure)


def draw(table: dict[int, tuple[dict[str, float], dict[str, float]]], path: Path) -> None:
    """Bars: time of each stage a particle; hollow bars: what moving its bytes alone would take."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [name for name in next(iter(table.values()))[0] if not name.startswith("plain")]
    fig, axes = plt.subplots(1, len(table), figsize=(10, 4), sharey=True, sharex=True, layout="constrained")
    for ax, (n, (seconds, moved)) in zip(axes, table.items()):
        rate = moved["plain copy, for scale"] / seconds["plain copy, for scale"]
        y = np.arange(len(names))[::-1]
        ax.barh(
            y, [1e9 * seconds[k] / n for k in names], color=["#9db8cc" if "of it" in k else "#33658a" for k in names]
        )
        ax.barh(
            y, [1e9 * moved[k] / rate / n for k in names], fill=False, edgecolor="#c1440e", height=0.5, linewidth=1.2
        )
        ax.set(title=f"{n:,d} particles", xlabel="ns a particle")
        ax.set_yticks(y, [k.strip() for k in names])
    fig.suptitle("Arithmetic, not memory: each stage (blue) beside the time its bytes alone need (red outline)")
    fig.savefig(path, dpi=150)
    print(f"  figure: {path}")


if __name__ == "__main__":
    parser = results.parser(__doc__, rounds=15)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args()
    if options.rounds < 7:
        parser.error("--rounds: a median of fewer than 7 says little")
    rows = results.Rows("Particle filter", threads=1)
    print(f"NumPy {np.__version__}")
    full_step(options.rounds, rows)
    resampling(options.rounds, rows)
    rows.store(options.json)
    where_the_time_goes(min(options.rounds, 9), options.figure)
