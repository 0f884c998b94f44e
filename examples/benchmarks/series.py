"""Ways to sum the series of `HeTorrance`: error by range of g, share of points that are off, and time.

One thread: OMP_NUM_THREADS=1 python examples/benchmarks/series.py --points 131072
"""

import argparse
from pathlib import Path

from matplotlib.figure import Figure

from torchbrdf.accuracy import SeriesLadder, series_ladder


def draw(table: SeriesLadder) -> Figure:
    figure = Figure(figsize=(8.5, 4.6), dpi=90, layout="constrained")
    axis = figure.subplots()
    for row in table.rows:
        shown = [min(max(error, 1e-8), 2.0) for error in row.largest]
        label = f"{row.name}, {row.forward:.0f} x Lambert"
        axis.stairs(shown, table.edges, baseline=None, linewidth=2, label=label)
    axis.set(xscale="log", yscale="log", xlabel="g", ylabel="largest relative error of the series (float32)")
    axis.legend(fontsize=8)
    axis.grid(alpha=0.3)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("output"))
    parser.add_argument("--points", type=int, default=1 << 14)
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    table = series_ladder(points=args.points)
    path = args.output / "series.png"
    draw(table).savefig(path)
    print(f"{table.to_markdown()}\n\nFigure: {path}")


if __name__ == "__main__":
    main()
