"""The plot of `study clusters`."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from lab.studies.clusters import SPREAD_LIMITS, ClusterRow

COLORS = {
    "random": "#888888",
    "clustered": "#1f77b4",
    "covisible": "#d95f02",
    **dict(zip(SPREAD_LIMITS, ("#7570b3", "#e7298a"), strict=True)),
}
LINES = ("-", "--", ":", "-.")


def cluster_figure(rows: Sequence[ClusterRow], title: str) -> Figure:
    """Cut on held-out views and feature spread over the number of groups, and one against the other."""
    figure = Figure(figsize=(15, 5.6), layout="constrained")
    figure.suptitle(title)
    over_count, spread_over_count, against = figure.subplots(1, 3)
    features = list(dict.fromkeys(row.features for row in rows if row.features is not None))
    for grouping, color in COLORS.items():
        for name in features if grouping != "random" else [None]:
            line = [row for row in rows if row.grouping == grouping and row.features == name]
            points = [row for row in line if row.held_out_cut_percent is not None and row.spread_percent is not None]
            if not points:
                continue
            label = grouping if name is None else f"{grouping}, {name}"
            style = LINES[features.index(name) % len(LINES)] if name is not None else "-"
            counts = [row.groups for row in points]
            cuts, spreads = [row.held_out_cut_percent for row in points], [row.spread_percent for row in points]
            over_count.plot(counts, cuts, style, marker="o", markersize=3, color=color, label=label)
            spread_over_count.plot(counts, spreads, style, marker="o", markersize=3, color=color)
            against.plot(spreads, cuts, style, marker="o", markersize=3, color=color)
    for row in rows:
        if row.grouping == "category" or row.grouping.startswith("pack "):
            marker = "*" if row.grouping == "category" else "D"
            text = row.grouping + (f" {row.psnr_db:.1f} dB" if row.psnr_db is not None else "")
            over_count.plot([row.groups], [row.held_out_cut_percent], marker, color="black")
            place = (row.groups, row.held_out_cut_percent or 0.0)
            over_count.annotate(text, place, (6, 5), textcoords="offset points", fontsize=7)
            against.plot([row.spread_percent], [row.held_out_cut_percent], marker, color="black")
    for axes, x, y in (
        (over_count, "groups (decoders)", "excess cut on held-out views, %"),
        (spread_over_count, "groups (decoders)", "feature spread in groups, % of the whole"),
        (against, "feature spread in groups, % of the whole", "excess cut on held-out views, %"),
    ):
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        axes.grid(alpha=0.3)
    for axes in (over_count, spread_over_count):
        axes.set_xscale("log")
        ticks = sorted({row.groups for row in rows if row.grouping in COLORS})
        axes.set_xticks(ticks, [str(tick) for tick in ticks], fontsize=7)
        axes.minorticks_off()
    over_count.margins(x=0.15)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8)
    return figure
